"""Drawing: a falling chain as an image, with Pillow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFont

from domino_env.core import colours
from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.view.ground import ground_line

BACKGROUND, STANDING_COLOUR = (255, 255, 255), (176, 186, 197)
INK, PALE, SOFT, FALLEN_COLOUR, LEADER_COLOUR = map(
    ImageColor.getrgb, (colours.INK, colours.PALE, colours.SOFT, colours.BLUE, colours.RED)
)
TITLE_HEIGHT = 40  # height of the line above all strips [px]
AHEAD = 0.72  # of the width of a moving picture: largest place of the leader
ZOOM = 2  # factor by which strips are drawn larger before they are scaled down
MAX_RELIEF = 2.0  # [strip heights] added for uneven ground; on higher ground the strip follows


@dataclass(frozen=True)
class Scale:
    """Scale of a layout in a strip of a picture.

    Attributes
    ----------
    width
        Width of the strip [px].
    height
        Height of the strip [px].
    pixels
        Pixels per metre.
    floor
        Place of the lowest ground, from the top [px].
    room
        Height of the ground above it [px].
    """

    width: int
    height: int
    pixels: float
    floor: int
    room: int = 0

    @classmethod
    def fitting(
        cls, length: float, tallest: float, width: int, height: int, relief: float = 0.0
    ) -> Scale:
        """Return the scale at which a layout fits a strip.

        Parameters
        ----------
        length
            Length of the layout [m].
        tallest
            Height of its tallest domino [m], which takes at least a fifth of the strip's height.
        width, height
            Size of the strip on flat ground [px].
        relief
            Height of the ground above its lowest place [m], which makes the strip higher.
        """
        margin = 2.0 * tallest
        pixels = min((width - 40) / (length + margin), 0.62 * height / tallest)
        pixels = max(pixels, height / 5.0 / tallest)
        room = 2 * round(0.5 * min(relief * pixels, MAX_RELIEF * height))  # even, for films
        return cls(width, height + room, pixels, int(0.80 * height) + room, room)


def draw_strip(
    layout: Layout,
    leans: Floats,
    leader: int,
    scale: Scale,
    line: str,
    ahead: float = AHEAD,
    ground: Ground | None = None,
    camera: float | None = None,
    finish: float | None = None,
) -> Image.Image:
    """Draw a chain at one instant.

    Parameters
    ----------
    layout
        The layout.
    leans
        Angles from the vertical (N,) [rad].
    leader
        Number of the leading domino, which has its own colour.
    scale
        Scale of the layout in the picture.
    line
        Text above the chain.
    ahead
        Fraction of the width beyond which the picture follows the camera.
    ground
        Ground ahead of the layout; None if it is unknown.
    camera
        Position that the picture follows [m]; None for that of the leader.
    finish
        Position of a finish line [m]; None for none.

    Returns
    -------
    Image
        Image of the size of the scale.
    """
    w, h, k = scale.width * ZOOM, scale.height * ZOOM, scale.pixels * ZOOM
    image = Image.new("RGB", (w, h), BACKGROUND)
    draw = ImageDraw.Draw(image)
    pivots = layout.pivots
    front, high = map(float, pivots[leader])
    left = 20 * ZOOM + 1.2 * float(layout.thickness[0]) * k
    left -= max(0.0, left + (front if camera is None else camera) * k - ahead * w)
    # the lowest ground at the floor; where the relief is too high, the leader in the middle
    under = ground_line(layout, max(left / k, 0.0), w / k, ground)
    shown = pivots if ground is None else under[under[:, 0] < (w - left) / k]
    lowest, highest = float(shown[:, 1].min()), float(shown[:, 1].max())
    room = scale.room / scale.pixels
    base = float(scale.floor * ZOOM)
    base += min(max(high - 0.5 * room, lowest), max(highest - room, lowest)) * k
    points = [(left + x * k, base - z * k) for x, z in under]
    draw.line(points, fill=PALE if layout.is_flat else SOFT, width=ZOOM, joint="curve")
    if finish is not None:  # dashed, from above the chain to below the ground
        end, dash = left + finish * k, 6 * ZOOM
        for y in range(34 * ZOOM, round(base - float(pivots[-1, 1]) * k) + 2 * dash, 2 * dash):
            draw.line([(end, y), (end, y + dash)], fill=INK, width=ZOOM)
    corners = outlines(layout, leans)
    across, down = left + corners[..., 0] * k, base - corners[..., 1] * k
    for i in np.flatnonzero((across.max(axis=1) > 0.0) & (across.min(axis=1) < w)):
        colour = LEADER_COLOUR if i == leader else FALLEN_COLOUR if i < leader else STANDING_COLOUR
        draw.polygon(list(zip(across[i], down[i], strict=True)), fill=colour, outline=BACKGROUND)
    x, below, r = left + front * k, base - high * k, 5 * ZOOM  # a triangle points at the leader
    triangle = [(x, below + ZOOM), (x - r, below + 2 * r), (x + r, below + 2 * r)]
    draw.polygon(triangle, fill=LEADER_COLOUR)
    image = image.resize((scale.width, scale.height), Image.Resampling.LANCZOS)
    ImageDraw.Draw(image).text((20, 10), line, fill=INK, font=font(15))
    return image


def draw_hand(image: Image.Image, thickness: Floats, height: float, scale: Scale) -> None:
    """Draw the pieces in hand at the top right of a strip, upright and to scale.

    Parameters
    ----------
    image
        The strip.
    thickness
        Thicknesses of the pieces [m].
    height
        Their height [m].
    scale
        Scale of the strip.
    """
    draw, k = ImageDraw.Draw(image), scale.pixels
    top, right = 34.0, scale.width - 20.0
    for size in thickness[::-1]:
        box = right - size * k, top, right, top + height * k
        draw.rectangle(box, fill=STANDING_COLOUR, outline=INK)
        right = box[0] - 8.0
    draw.text((scale.width - 20, 10), "in hand", fill=INK, font=font(15), anchor="ra")


def draw_title(text: str, right: str, width: int) -> Image.Image:
    """Draw the line above all strips, with a second text at its right end."""
    image = Image.new("RGB", (width, TITLE_HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(image)
    room = width - 60 - draw.textlength(right, font(14))
    size = next((s for s in range(19, 9, -1) if draw.textlength(text, font(s)) <= room), 9)
    draw.text((20, TITLE_HEIGHT - 6), text, fill=INK, font=font(size), anchor="lb")
    draw.text((width - 20, TITLE_HEIGHT - 6), right, fill=SOFT, font=font(14), anchor="rb")
    return image


def stack_strips(strips: list[Image.Image]) -> Image.Image:
    """Stack strips below each other."""
    image = Image.new("RGB", (strips[0].width, sum(s.height for s in strips)), BACKGROUND)
    y = 0
    for strip in strips:
        image.paste(strip, (0, y))
        y += strip.height
    return image


@cache
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Load Pillow's own font."""
    return ImageFont.load_default(size)


@cache
def palette() -> Image.Image:
    """Return a palette of the colours of a picture and their blends with the background."""
    shades = []
    for colour in (INK, PALE, STANDING_COLOUR, FALLEN_COLOUR, LEADER_COLOUR):
        for part in np.linspace(1.0, 0.0, 9)[:-1]:
            mixed = part * np.array(colour) + (1.0 - part) * np.array(BACKGROUND)
            shades += [round(x) for x in mixed]
    image = Image.new("P", (1, 1))
    image.putpalette(shades + list(BACKGROUND))
    return image
