"""Animation: chains that topple side by side, as frames at equal steps of time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

from domino_env.core.checks import require, require_extra
from domino_env.core.files import write_bytes
from domino_env.physics.motion import Motion
from domino_env.view.comparison import ComparedLayout, require_compared
from domino_env.view.drawing import AHEAD, Scale, draw_strip, draw_title, palette, stack_strips
from domino_env.view.ground import relief

MAX_DOMINOES = 5_000  # of a chain that can be drawn
MAX_WIDTH = 10_000  # [px]
MAX_PIXELS = 500_000_000  # pixels of all images, one byte each in few colours
STRIP_HEIGHT, POSE_HEIGHT = 150, 100  # [px] on flat ground, in an animation and in poses
MAX_LEADER_PLACE = 0.97  # of the width of a picture of poses
LAST_DURATION = 2000.0  # [ms] duration of the last image of an animation
REST = 0.08  # [s] before the push and after the end, in the time of the wave


def frames(
    compared: Sequence[ComparedLayout],
    rate: float = 30.0,
    slow: float = 5.0,
    width: int = 1000,
    heading: str = "",
) -> Iterator[Image.Image]:
    """Draw chains that topple at once, one below the other, until all lie.

    All chains have one scale and one camera, and a finish line at their last pivots.

    Parameters
    ----------
    compared
        The chains.
    rate
        Images per second.
    slow
        Time in the film over time in nature.
    width
        Width of an image [px], even.
    heading
        Text above all chains, followed by the time factor; empty for none.

    Yields
    ------
    Image
        Next frame.

    Raises
    ------
    ValueError
        For a rate, time factor or width out of range, for a chain of more than 5 000 dominoes, and
        for more than 500 million pixels.
    """
    require("rate", rate, above=0.0, unit="1/s", hint="25 is a film's")
    require("slow", slow, above=0.0, hint="5 times slower than real time")
    motions, scale = _motions_and_scale(compared, width, STRIP_HEIGHT)
    end = max(motion.end for motion in motions)
    images = int((end + 2.0 * REST) * rate * slow)
    _require_pixels(images * len(compared), scale, "--width, --rate or --slow")
    times = np.arange(-REST, end + REST, 1.0 / (rate * slow))
    pace = "real time" if slow == 1.0 else f"{slow:g} times slower than real time"
    above = [draw_title(heading, pace, width)] if heading else []
    for t in times:
        yield stack_strips([*above, *_strips(compared, motions, float(t), scale, AHEAD)])


def poses(
    compared: Sequence[ComparedLayout], moments: int = 4, width: int = 1000, heading: str = ""
) -> Image.Image:
    """Draw chains at a few moments, below each other in one picture.

    Parameters
    ----------
    compared
        The chains.
    moments
        Number of moments, at equal intervals while the waves run.
    width
        Width of the picture [px], even.
    heading
        Text above all chains; empty for none.

    Returns
    -------
    Image
        The picture.

    Raises
    ------
    ValueError
        For less than one moment, and as of `frames`.
    """
    require("moments", moments, 1, whole=True)
    motions, scale = _motions_and_scale(compared, width, POSE_HEIGHT)
    _require_pixels(moments * len(compared), scale, "--width or --moments")
    end = max(float(entry.wave.arrival_times[entry.wave.hit - 1]) for entry in compared)
    strips = [draw_title(heading, "", width)] if heading else []
    for k in range(moments):
        t = end * (k + 0.5) / moments
        strips += _strips(compared, motions, t, scale, MAX_LEADER_PLACE)
    return stack_strips(strips)


def require_drawable(name: str, count: int) -> None:
    """Raise ValueError for a chain with too many dominoes to draw each."""
    if count > MAX_DOMINOES:
        raise ValueError(f"{name}: {count:,} dominoes: give at most {MAX_DOMINOES:,} to draw")


def write_png(image: Image.Image, path: Path) -> None:
    """Write a picture in few colours as a PNG file."""
    write_bytes(path, lambda file: _in_few_colours(image).save(file, "PNG", optimize=True))


def write_gif(images: Iterator[Image.Image], path: Path, rate: float) -> int:
    """Write an animated GIF, and return its number of images."""
    first, *rest = map(_in_few_colours, images)
    durations = [1000.0 / rate] * len(rest) + [LAST_DURATION]
    options: dict[str, Any] = {"duration": durations, "loop": 0, "optimize": True}
    options |= {"save_all": True, "append_images": rest}
    write_bytes(path, lambda file: first.save(file, "GIF", **options))
    return 1 + len(rest)


def write_mp4(images: Iterator[Image.Image], path: Path, rate: float) -> int:
    """Write a film, and return its number of images.

    Raises
    ------
    ImportError
        Without imageio-ffmpeg; the message names what to install.
    """
    require_extra("a film", "render", "imageio_ffmpeg")
    import imageio_ffmpeg

    first, number = next(images), 0
    with TemporaryDirectory() as folder:
        film = Path(folder) / "film.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(film), first.size, fps=rate, macro_block_size=2, quality=8
        )
        with closing(writer):
            writer.send(None)
            for image in chain([first], images):
                writer.send(image.tobytes())
                number += 1
        write_bytes(path, lambda file: file.write(film.read_bytes()))
    return number


def _in_few_colours(image: Image.Image) -> Image.Image:
    return image.quantize(palette=palette(), dither=Image.Dither.NONE)


def _motions_and_scale(
    compared: Sequence[ComparedLayout], width: int, height: int
) -> tuple[list[Motion], Scale]:
    """Return the motions of chains, and a scale at which all of them fit the width."""
    require("width", width, 200, MAX_WIDTH, unit="px", hint="1000 is usual", whole=True)
    if width % 2:
        raise ValueError(f"width = {width} px: give an even number, as films need one")
    require_compared(compared)
    for entry in compared:
        require_drawable(entry.name, entry.wave.layout.count)
    motions = [Motion(entry.wave.layout, entry.wave.physics) for entry in compared]
    layouts = [entry.wave.layout for entry in compared]
    longest = max(float(layout.length) for layout in layouts)
    tallest = max(float(layout.height.max()) for layout in layouts)
    return motions, Scale.fitting(longest, tallest, width, height, max(map(relief, layouts)))


def _require_pixels(strips: int, scale: Scale, options: str) -> None:
    """Raise ValueError for images that take too much memory."""
    pixels = strips * scale.width * scale.height
    if pixels > MAX_PIXELS:
        raise ValueError(
            f"{strips:,} strips of {scale.width:,} by {scale.height:,} px have {pixels:,} pixels: "
            f"at most {MAX_PIXELS:,} are drawn; choose a lower {options}"
        )


def _strips(
    compared: Sequence[ComparedLayout],
    motions: Sequence[Motion],
    t: float,
    scale: Scale,
    ahead: float,
) -> list[Image.Image]:
    """Draw all chains at one instant, at the same places of the picture."""
    leaders = [int(motion.leader([t])[0][0]) for motion in motions]
    # the picture moves only if the longest chain does not fit, with the foremost leader
    longest = max(float(motion.layout.pivots[-1, 0]) for motion in motions)
    tallest = max(float(motion.layout.height.max()) for motion in motions)
    camera = 0.0
    if (longest + 2.0 * tallest) * scale.pixels > scale.width - 39:
        places = zip(motions, leaders, strict=True)
        camera = max(float(motion.layout.pivots[leader, 0]) for motion, leader in places)
    strips = []
    for entry, motion, leader in zip(compared, motions, leaders, strict=True):
        finish = float(motion.layout.pivots[-1, 0])
        leans, line = motion.angles([t])[0], _status_line(entry, t)
        chain = motion.layout, leans, leader, scale
        strips.append(draw_strip(*chain, line, ahead, camera=camera, finish=finish))
    return strips


def _status_line(entry: ComparedLayout, t: float) -> str:
    """Return the text above a chain: the time up to the last hit, and the speed after it."""
    wave = entry.wave
    hit = int(np.searchsorted(wave.arrival_times[: wave.hit], max(t, 0.0), side="right"))
    end = float(wave.arrival_times[wave.hit - 1])
    line = f"{entry.name}   {min(max(t, 0.0), end):.3f} s   {hit} of {wave.layout.count} hit"
    if t < end or hit < wave.hit:
        return line
    if wave.mean_speed > 0.0:
        return f"{line}   {1e3 * wave.layout.length:.0f} mm at {wave.mean_speed:.4f} m/s"
    return f"{line}   {wave.outcome.label}"
