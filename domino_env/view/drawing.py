"""Images of a falling chain, drawn with Pillow. Lengths in the code are in pixels unless marked."""

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
MAX_PLACE = 0.72  # largest place of the leader in a moving picture, as a fraction of its width
ZOOM = 2  # strips are drawn larger by this factor and scaled down, which smooths their edges
MAX_RELIEF = 2.0  # [strip heights] added for uneven ground; above it the picture follows the leader


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
        Distance of the lowest ground from the top of the strip [px].
    room
        Height added to the strip for uneven ground, even [px].
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
            Height of the highest ground above the lowest [m], which makes the strip higher.

        Returns
        -------
        Scale
            Scale of the strip.
        """
        margin = 2.0 * tallest
        # 20 px at both sides, `margin` for the last domino when it lies; the tallest one
        # takes at most half of the height, below the text
        pixels = min((width - 40) / (length + margin), 0.5 * height / tallest)
        pixels = max(pixels, height / 5.0 / tallest)
        room = 2 * round(0.5 * min(relief * pixels, MAX_RELIEF * height))  # films need even heights
        return cls(width, height + room, pixels, int(0.80 * height) + room, room)


def draw_strip(
    layout: Layout,
    leans: Floats,
    leader: int,
    scale: Scale,
    text: str,
    max_place: float = MAX_PLACE,
    ground: Ground | None = None,
    camera: float | None = None,
    finish: float | None = None,
    result: str = "",
    fallen: str = colours.RESULT,
) -> Image.Image:
    """Draw a chain at one instant.

    Parameters
    ----------
    layout
        The layout.
    leans
        Angles from the vertical (N,) [rad].
    leader
        Index of the leading domino, which has its own colour.
    scale
        Scale of the layout in the picture.
    text
        Text above the chain.
    max_place
        Largest place of the camera, as a fraction of the width; the picture moves to keep it.
    ground
        Ground ahead of the layout; None if it is unknown.
    camera
        Position that the picture follows [m]; None for that of the leader.
    finish
        Position of a finish line [m]; None for none.
    result
        Text at the finish line.
    fallen
        Colour of the fallen dominoes.

    Returns
    -------
    Image
        Image of `scale.width` by `scale.height` pixels.
    """
    # enlarged: width and height [px], pixels per metre k; left, base: pixels of x = 0 and z = 0
    w, h, k = scale.width * ZOOM, scale.height * ZOOM, scale.pixels * ZOOM
    image = Image.new("RGB", (w, h), BACKGROUND)
    draw = ImageDraw.Draw(image)
    pivots = layout.pivots
    leader_x, leader_z = map(float, pivots[leader])  # [m]
    left = left_end(layout, scale) * ZOOM
    left -= max(0.0, left + (leader_x if camera is None else camera) * k - max_place * w)
    # The lowest ground is at the floor; if the relief is too high, the leader is in the middle.
    surface = ground_line(layout, max(left / k, 0.0), w / k, ground)  # [m], as the next four names
    shown = pivots if ground is None else surface[surface[:, 0] < (w - left) / k]
    lowest, highest = float(shown[:, 1].min()), float(shown[:, 1].max())
    room = scale.room / scale.pixels
    base = float(scale.floor * ZOOM)
    base += min(max(leader_z - 0.5 * room, lowest), max(highest - room, lowest)) * k
    points = [(left + x * k, base - z * k) for x, z in surface]
    draw.line(points, fill=PALE if layout.is_flat else SOFT, width=ZOOM, joint="curve")
    if finish is not None:  # dashed, from below the text to below the ground
        end, dash = left + finish * k, 6 * ZOOM
        for y in range(34 * ZOOM, round(base - float(pivots[-1, 1]) * k) + 2 * dash, 2 * dash):
            draw.line([(end, y), (end, y + dash)], fill=INK, width=ZOOM)
    corners = outlines(layout, leans)
    across, down = left + corners[..., 0] * k, base - corners[..., 1] * k
    for i in np.flatnonzero((across.max(axis=1) > 0.0) & (across.min(axis=1) < w)):
        colour = LEADER_COLOUR if i == leader else fallen if i < leader else STANDING_COLOUR
        draw.polygon(list(zip(across[i], down[i], strict=True)), fill=colour, outline=BACKGROUND)
    # a triangle under the leader's pivot points at it
    x, top, r = left + leader_x * k, base - leader_z * k, 5 * ZOOM
    triangle = [(x, top + ZOOM), (x - r, top + 2 * r), (x + r, top + 2 * r)]
    draw.polygon(triangle, fill=LEADER_COLOUR)
    image = image.resize((scale.width, scale.height), Image.Resampling.LANCZOS)
    draw = ImageDraw.Draw(image)
    draw.text((20, 10), text, fill=INK, font=font(15))
    if finish is not None:
        place = (left + finish * k) / ZOOM - 8, 34
        draw.text(place, result, fill=LEADER_COLOUR, font=font(24), anchor="ra")
    return image


def left_end(layout: Layout, scale: Scale) -> float:
    """Return the place of the first pivot in a picture that does not move [px]."""
    return 20 + 1.2 * float(layout.thickness[0]) * scale.pixels


def draw_hand(
    image: Image.Image, thickness: Floats, height: float, scale: Scale, chosen: float = np.nan
) -> None:
    """Draw the pieces in hand at the top right of a strip, upright and to its scale.

    Parameters
    ----------
    image
        Image of the strip, to which the pieces are added.
    thickness
        Thicknesses of the pieces [m].
    height
        Height of each piece [m].
    scale
        Scale of the strip.
    chosen
        Thickness of the piece that is placed next [m], drawn in the colour of the leading domino.
    """
    draw, k = ImageDraw.Draw(image), scale.pixels  # k: pixels per metre
    top, right = 34.0, scale.width - 20.0  # below the text
    for d in thickness[::-1]:
        box = right - d * k, top, right, top + height * k
        draw.rectangle(box, fill=LEADER_COLOUR if d == chosen else STANDING_COLOUR, outline=INK)
        right, chosen = box[0] - 8.0, np.nan if d == chosen else chosen  # one piece of equal ones
    draw.text((scale.width - 20, 10), "in hand", fill=INK, font=font(15), anchor="ra")


def draw_title(title: str, note: str, width: int) -> Image.Image:
    """Draw the line above all strips.

    Parameters
    ----------
    title
        Text at the left end, in the largest size that fits.
    note
        Text at the right end.
    width
        Width of the strips [px].

    Returns
    -------
    Image
        Image of `width` by 40 pixels.
    """
    image = Image.new("RGB", (width, TITLE_HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(image)
    room = width - 60 - draw.textlength(note, font(14))
    size = next((s for s in range(19, 9, -1) if draw.textlength(title, font(s)) <= room), 9)
    draw.text((20, TITLE_HEIGHT - 6), title, fill=INK, font=font(size), anchor="lb")
    draw.text((width - 20, TITLE_HEIGHT - 6), note, fill=SOFT, font=font(14), anchor="rb")
    return image


def stack_strips(strips: list[Image.Image]) -> Image.Image:
    """Join images of equal width into one, the first at the top."""
    image = Image.new("RGB", (strips[0].width, sum(s.height for s in strips)), BACKGROUND)
    y = 0
    for strip in strips:
        image.paste(strip, (0, y))
        y += strip.height
    return image


@cache
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return Pillow's own font in a size [px]."""
    return ImageFont.load_default(size)


@cache
def palette() -> Image.Image:
    """Return an image whose palette has the colours of a strip and blends with the background.

    Each of six colours has eight blends, which are enough for smoothed edges.
    """
    shades = []
    uniform = ImageColor.getrgb(colours.UNIFORM)
    for colour in (INK, PALE, STANDING_COLOUR, FALLEN_COLOUR, uniform, LEADER_COLOUR):
        for opacity in np.linspace(1.0, 0.0, 9)[:-1]:
            mixed = opacity * np.array(colour) + (1.0 - opacity) * np.array(BACKGROUND)
            shades += [round(x) for x in mixed]
    image = Image.new("P", (1, 1))
    image.putpalette(shades + list(BACKGROUND))
    return image
