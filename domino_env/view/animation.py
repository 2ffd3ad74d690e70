"""Animations of chains that topple one below the other, and pictures of several moments."""

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
from domino_env.view import drawing
from domino_env.view.compared import ComparedLayout, require_drawable
from domino_env.view.ground import relief

MAX_WIDTH = 10_000  # [px]
MAX_PIXELS = 500_000_000  # of all images of a file; a GIF keeps one byte per pixel in memory
STRIP_HEIGHT, POSE_HEIGHT = 120, 100  # [px] on flat ground, in an animation and in poses
MAX_POSE_PLACE = 0.97  # largest place of the leader in poses, as a fraction of the width
MAX_GIF_RATE = 50.0  # [Hz] viewers slow down images that are shown for less than 20 ms
LAST_DURATION = 2000.0  # [ms] duration of the last image of a GIF
REST = 0.08  # [s] shown before the push and after the end, in the time of the wave


def frames(
    compared: Sequence[ComparedLayout],
    rate: float = 30.0,
    slow: float = 5.0,
    width: int = 1000,
    heading: str = "",
) -> Iterator[Image.Image]:
    """Draw chains that topple at once, one below the other, until the last wave has ended.

    All chains have one scale and one camera. A dashed line marks the last pivot of each.

    Parameters
    ----------
    compared
        The chains.
    rate
        Images per second.
    slow
        Time in the film over time of the wave, the time factor.
    width
        Width of an image [px], even, from 200 to 10 000.
    heading
        Text above all chains, with the time factor at its right; empty for neither.

    Yields
    ------
    Image
        Next frame.

    Raises
    ------
    ValueError
        For a width that is odd or out of range, a chain of more than 5 000 dominoes, and more than
        500 million pixels.
    """
    motions, scale = _motions_and_scale(compared, width, STRIP_HEIGHT)
    end = max(motion.end for motion in motions)
    images = int((end + 2.0 * REST) * rate * slow)
    _require_pixels(images * len(compared), scale, "--width, --rate or --slow")
    times = np.arange(-REST, end + REST, 1.0 / (rate * slow))
    factor = f"{slow:g} times slower" if slow > 1.0 else f"{1.0 / slow:g} times faster"
    pace = "real time" if slow == 1.0 else f"{factor} than real time"
    title = [drawing.draw_title(heading, pace, width)] if heading else []
    for t in times:
        strips = _strips(compared, motions, float(t), scale, drawing.MAX_PLACE)
        yield drawing.stack_strips([*title, *strips])


def poses(
    compared: Sequence[ComparedLayout], moments: int = 4, width: int = 1000, heading: str = ""
) -> Image.Image:
    """Draw chains at a few moments, below each other in one picture.

    Parameters
    ----------
    compared
        The chains.
    moments
        Number of moments, the middles of equal intervals from the push to the last hit of all
        chains.
    width
        Width of the picture [px], even, from 200 to 10 000.
    heading
        Text above all chains; empty for none.

    Returns
    -------
    Image
        The picture.

    Raises
    ------
    ValueError
        For a width that is odd or out of range, a chain of more than 5 000 dominoes, and more than
        500 million pixels.
    """
    motions, scale = _motions_and_scale(compared, width, POSE_HEIGHT)
    _require_pixels(moments * len(compared), scale, "--width or --moments")
    end = max(map(_end, compared))
    strips = [drawing.draw_title(heading, "", width)] if heading else []
    for k in range(moments):
        t = end * (k + 0.5) / moments
        strips += _strips(compared, motions, t, scale, MAX_POSE_PLACE)
    return drawing.stack_strips(strips)


def write_png(image: Image.Image, path: Path) -> None:
    """Write a picture as a PNG file with the colours of `palette`."""
    write_bytes(path, lambda file: _with_palette(image).save(file, "PNG", optimize=True))


def write_gif(images: Iterator[Image.Image], path: Path, rate: float) -> float:
    """Write an animated GIF with the colours of `palette`.

    Parameters
    ----------
    images
        Images of one size, at least one.
    path
        Output file.
    rate
        Images per second; the last image is shown for two seconds.

    Returns
    -------
    float
        Duration [s].

    Raises
    ------
    ValueError
        For more than 50 images per second, which viewers do not show.
    """
    require("rate", rate, above=0.0, high=MAX_GIF_RATE, unit="Hz", hint="more in an MP4 film")
    first, *rest = map(_with_palette, images)
    times = np.round(np.arange(len(rest) + 1) * 100.0 / rate) * 10.0  # a GIF has hundredths of 1 s
    durations = [*np.diff(times).tolist(), LAST_DURATION]
    options: dict[str, Any] = {"duration": durations, "loop": 0, "optimize": True}
    options |= {"save_all": True, "append_images": rest}
    write_bytes(path, lambda file: first.save(file, "GIF", **options))
    return 1e-3 * float(sum(durations))


def write_mp4(images: Iterator[Image.Image], path: Path, rate: float) -> float:
    """Write an MP4 film.

    Parameters
    ----------
    images
        Images of one size, at least one; width and height are even.
    path
        Output file.
    rate
        Images per second.

    Returns
    -------
    float
        Duration [s].

    Raises
    ------
    ImportError
        Without imageio-ffmpeg; the message has the command that installs it.
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
            writer.send(None)  # the generator of imageio-ffmpeg starts with it
            for image in chain([first], images):
                writer.send(image.tobytes())
                number += 1
        write_bytes(path, lambda file: file.write(film.read_bytes()))
    return number / rate


def _with_palette(image: Image.Image) -> Image.Image:
    """Return an image with the colours of `palette`, one byte per pixel."""
    return image.quantize(palette=drawing.palette(), dither=Image.Dither.NONE)


def _motions_and_scale(
    compared: Sequence[ComparedLayout], width: int, height: int
) -> tuple[list[Motion], drawing.Scale]:
    """Return the motions of chains, and their common scale in strips of a width and height [px]."""
    require("width", width, 200, MAX_WIDTH, unit="px", hint="1000 is usual", whole=True)
    if width % 2:
        raise ValueError(f"width = {width} px: give an even number, which films need")
    for entry in compared:
        require_drawable(entry.name, entry.wave.layout.count)
    motions = [Motion(entry.wave.layout, entry.wave.physics) for entry in compared]
    layouts = [entry.wave.layout for entry in compared]
    longest = max(float(layout.length) for layout in layouts)
    tallest = max(float(layout.height.max()) for layout in layouts)
    sizes = longest, tallest, width, height
    return motions, drawing.Scale.fitting(*sizes, max(map(relief, layouts)))


def _require_pixels(strips: int, scale: drawing.Scale, options: str) -> None:
    """Raise ValueError for images that take too much memory; options: those to lower, as a text."""
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
    scale: drawing.Scale,
    max_place: float,
) -> list[Image.Image]:
    """Draw all chains at an instant [s]; max_place: of the camera, which they share."""
    leaders = [int(motion.leader([t])[0][0]) for motion in motions]
    longest = max(float(motion.layout.pivots[-1, 0]) for motion in motions)
    tallest = max(float(motion.layout.height.max()) for motion in motions)
    camera = 0.0
    # The camera follows the foremost leader if the longest chain does not fit the width.
    # `Scale.fitting` leaves 40 px at the sides; with 39 here rounding does not matter.
    if (longest + 2.0 * tallest) * scale.pixels > scale.width - 39:
        leading = zip(motions, leaders, strict=True)
        camera = max(float(motion.layout.pivots[leader, 0]) for motion, leader in leading)
    strips = []
    for entry, motion, leader in zip(compared, motions, leaders, strict=True):
        result = f"{_end(entry):.3f} s" if t >= _end(entry) and entry.wave.mean_speed else ""
        strips.append(drawing.draw_strip(
            motion.layout, motion.angles([t])[0], leader, scale, _status_line(entry, t), max_place,
            camera=camera, finish=float(motion.layout.pivots[-1, 0]), result=result,
            fallen=entry.colour,
        ))  # fmt: skip
    return strips


def _end(entry: ComparedLayout) -> float:
    """Return the time of the last hit [s]."""
    return float(entry.wave.arrival_times[entry.wave.hit - 1])


def _status_line(entry: ComparedLayout, t: float) -> str:
    """Return the text above a chain at an instant [s]; after the last hit it has the result."""
    wave = entry.wave
    hit = int(np.searchsorted(wave.arrival_times[: wave.hit], max(t, 0.0), side="right"))
    end = _end(entry)
    line = f"{entry.name}   {min(max(t, 0.0), end):.3f} s   {hit} of {wave.layout.count} hit"
    if t < end or hit < wave.hit:
        return line
    if wave.mean_speed > 0.0:
        return f"{line}   {1e3 * wave.layout.length:.0f} mm at {wave.mean_speed:.4f} m/s"
    return f"{line}   {wave.outcome.label}"
