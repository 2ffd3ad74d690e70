"""Animation: rows that topple side by side, as frames at equal steps of time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from domino_env.core.checks import require
from domino_env.core.files import write_bytes
from domino_env.core.types import Floats
from domino_env.physics.motion import Motion
from domino_env.view.drawing import AHEAD, Scale, palette, stacked, strip, title
from domino_env.view.ground import relief
from domino_env.view.race import Racer

MOST_DOMINOES = 5_000  # in a picture of a row: drawing takes time by its square
MOST_IMAGES = 5_000  # more than three minutes at 25 a second; 1 GB
STRIP, POSE = 150, 100  # [px] height of a row on flat ground, in an animation and in poses
FURTHEST = 0.97  # of the width of a picture that stands still: where the front may come to
REST = 0.08  # [s] of stillness before the push and after the end, in the time of the row


def frames(
    racers: Sequence[Racer],
    rate: float = 30.0,
    slow: float = 5.0,
    width: int = 1000,
    heading: str = "",
) -> Iterator[Image.Image]:
    """Draw all rows toppling at once, one below the other, until all lie.

    Parameters
    ----------
    racers
        The rows.
    rate
        Images a second.
    slow
        How many times slower than nature.
    width
        Of an image [px], even.
    heading
        What is said above all rows, with how slow the motion is; nothing where it is empty.

    Yields
    ------
    Image
        Frame after frame.

    Raises
    ------
    ValueError
        For a rate, a slowness or a width that is not positive, and for rows that are longer or
        take longer than `MOST_DOMINOES` and `MOST_IMAGES`.
    """
    require("rate", rate, above=0.0, unit="1/s", hint="25 is a film's")
    require("slow", slow, above=0.0, hint="5 times slower than nature")
    motions, scale = _stage(racers, width, STRIP)
    end = max(motion.end for motion in motions)
    images = int((end + 2.0 * REST) * rate * slow)
    if images > MOST_IMAGES:
        raise ValueError(
            f"{end:.4g} s of toppling take {images:,} images, where at most {MOST_IMAGES:,} are "
            "drawn: ask for fewer a second, or for a less slow motion"
        )
    times = np.arange(-REST, end + REST, 1.0 / (rate * slow))
    pace = "true time" if slow == 1.0 else f"{slow:g} times slower than nature"
    above = [title(heading, pace, width)] if heading else []
    for t in times:
        yield stacked(
            above
            + [
                _strip(one, motion, float(t), scale)
                for one, motion in zip(racers, motions, strict=True)
            ]
        )


def poses(
    racers: Sequence[Racer], moments: int = 4, width: int = 1000, heading: str = ""
) -> Image.Image:
    """Draw all rows at a few moments, below each other in one picture.

    Parameters
    ----------
    racers
        The rows.
    moments
        How many, equally far apart, while the waves run.
    width
        Of the picture [px], even.
    heading
        What is said above; nothing where it is empty.

    Raises
    ------
    ValueError
        For fewer than one moment, and as of `frames`.
    """
    require("moments", moments, 1, whole=True)
    motions, scale = _stage(racers, width, POSE)
    end = max(float(one.wave.arrival_times[one.wave.hit - 1]) for one in racers)
    strips = [title(heading, "", width)] if heading else []
    for k in range(moments):
        t = end * (k + 0.5) / moments
        for one, motion in zip(racers, motions, strict=True):
            strips.append(_strip(one, motion, t, scale, ahead=FURTHEST))
    return stacked(strips)


def require_drawable(name: str, count: int) -> None:
    """Refuse a row too long to be drawn domino by domino.

    Raises
    ------
    ValueError
        With its name and its number of dominoes.
    """
    if count > MOST_DOMINOES:
        raise ValueError(
            f"{name}: it has {count:,} dominoes, where rows of at most {MOST_DOMINOES:,} are drawn"
        )


def write_png(image: Image.Image, path: Path) -> None:
    """Write a picture whole, in few colours."""
    write_bytes(path, lambda file: _in_few_colours(image).save(file, "PNG", optimize=True))


def write_gif(images: Iterator[Image.Image], path: Path, rate: float) -> int:
    """Write an animated GIF whole, and return the number of images."""
    first, *rest = map(_in_few_colours, images)
    looks: dict[str, Any] = {
        "append_images": rest,
        "duration": 1000.0 / rate,
        "loop": 0,
        "optimize": True,
    }
    write_bytes(path, lambda file: first.save(file, "GIF", save_all=True, **looks))
    return 1 + len(rest)


def write_mp4(images: Iterator[Image.Image], path: Path, rate: float) -> int:
    """Write a film whole, and return the number of images.

    Raises
    ------
    ImportError
        Without imageio-ffmpeg; says what to install.
    """
    try:
        import imageio_ffmpeg
    except ImportError:
        raise ImportError(
            'films need imageio-ffmpeg: pip install "domino-chains[render]", or ask for --gif'
        ) from None
    path.parent.mkdir(parents=True, exist_ok=True)
    first = next(images)
    draft = path.with_name(f".{path.stem}.draft.mp4")
    writer = imageio_ffmpeg.write_frames(
        str(draft), first.size, fps=rate, macro_block_size=2, quality=8
    )
    number = 0
    try:
        writer.send(None)
        for image in chain([first], images):
            writer.send(image.tobytes())
            number += 1
        writer.close()
        draft.replace(path)
    finally:
        writer.close()
        draft.unlink(missing_ok=True)
    return number


def _in_few_colours(image: Image.Image) -> Image.Image:
    return image.quantize(palette=palette(), dither=Image.Dither.NONE)


def _stage(racers: Sequence[Racer], width: int, height: int) -> tuple[list[Motion], Scale]:
    """How the rows move, and how all of them fit the width."""
    require("width", width, 200, unit="px", hint="1000 is usual", whole=True)
    if width % 2:
        raise ValueError(f"width = {width} px: give an even number, as films need one")
    for one in racers:
        require_drawable(one.name, one.wave.layout.count)
    motions = [Motion(one.wave.layout, one.wave.physics) for one in racers]
    longest = max(float(one.wave.layout.length) for one in racers)
    tallest = max(float(one.wave.layout.height.max()) for one in racers)
    hills = max(relief(one.wave.layout) for one in racers)
    return motions, Scale.fitting(longest, tallest, width, height, hills)


def _strip(one: Racer, motion: Motion, t: float, scale: Scale, ahead: float = AHEAD) -> Image.Image:
    wave = one.wave
    leans: Floats = motion.angles([t])[0]
    leader = int(motion.leader([t])[0][0])
    hit = int(np.searchsorted(wave.arrival_times[: wave.hit], max(t, 0.0), side="right"))
    clock = min(max(t, 0.0), float(wave.arrival_times[wave.hit - 1]))
    speed = f"{wave.mean_speed:.4f} m/s" if wave.mean_speed > 0.0 else ""
    line = f"{one.name}   {speed}   {clock * 1e3:6.0f} ms   {hit} of {wave.layout.count}"
    if t >= clock > 0.0 and hit == wave.hit and not speed:
        line += f"   {wave.outcome.name.lower().replace('_', ' ')}"
    return strip(wave.layout, leans, leader, scale, line, ahead=ahead)
