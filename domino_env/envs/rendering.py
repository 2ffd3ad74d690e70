"""Frames of the environments: images, a window.

A frame shows the chain at the latest hit; the leans are those of the model.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.checks import require_extra
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.motion import stack_leans
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene

FRAMES_PER_SECOND = 20  # largest frame rate of a window [1/s]
WIDTH, HEIGHT = 1200, 200  # of an image [px]


def _window_works() -> bool:
    """Return True if pygame is installed and, on Linux, there is a display for a window."""
    displays = "DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"
    has_display = not sys.platform.startswith("linux") or any(map(os.environ.get, displays))
    return has_display and find_spec("pygame") is not None


VECTOR_MODES = ("rgb_array",)
MODES = (*VECTOR_MODES, "human")
CHECKED_MODES = MODES if _window_works() else VECTOR_MODES  # Gymnasium's checker tries each of them


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The chain placed so far and its wave at the instant of the latest hit.

    Attributes
    ----------
    layout
        The dominoes that stand: those placed so far, and those of the run-out, if the scene has
        one and all its dominoes are placed. At the end of an episode it is `wave.layout`.
    hit
        Number of these dominoes that were hit; the leading domino is number hit - 1.
    time
        Time of the latest hit [s].
    uniform_speed
        Mean speed of the scene's uniform baseline up to this domino [m/s]; 0 if not known.
    wave
        The wave through `layout`; None before the end of the episode.
    hand
        Thicknesses of the pieces in hand [m]; empty unless they are drawn in random order.
    """

    layout: Layout
    hit: int
    time: float
    uniform_speed: float
    wave: Wave | None
    hand: Floats


class Renderer:
    """Frames of one or several environments in one render mode.

    Parameters
    ----------
    mode
        One of `allowed`, or None for no frames.
    allowed
        Modes of the environment.

    Raises
    ------
    ValueError
        For a mode that is not allowed.
    ImportError
        If a window needs pygame-ce; the message has the command that installs it.
    """

    def __init__(self, mode: str | None, allowed: tuple[str, ...]) -> None:
        if mode is not None and mode not in allowed:
            raise ValueError(f"render_mode = {mode!r}: choose None or one of {', '.join(allowed)}")
        if mode == "human":
            require_extra("a window", "render", "pygame")
        self.mode = mode
        self._window: _Window | None = None
        self._scale: Any = None
        self._scaled_to: Scene | None = None

    def frame(self, snapshot: Snapshot, scene: Scene) -> NDArray[np.uint8] | None:
        """Return an image (H, W, 3); None after a frame was shown in a window.

        Parameters
        ----------
        snapshot
            The chain.
        scene
            Its scene, which sets the scale.
        """
        layout, leader = snapshot.layout, max(snapshot.hit - 1, 0)
        leans = stack_leans(layout, np.array([leader]), np.zeros(1))[0]
        from domino_env.view.drawing import Scale, draw_hand, draw_strip
        from domino_env.view.ground import relief

        if self._scaled_to is not scene:
            uniform = scene.uniform().layout
            row = scene.row(uniform)  # with the run-out
            length = scene.length or 1.1 * float(uniform.length)  # for slightly longer layouts
            length += float(row.length - uniform.length)
            tallest = float(row.height.max())
            self._scale = Scale.fitting(length, tallest, WIDTH, HEIGHT, relief(row))
            self._scaled_to = scene
        line = status_line(snapshot)
        image = draw_strip(layout, leans, leader, self._scale, line, ground=scene.ground)
        if len(snapshot.hand):
            draw_hand(image, snapshot.hand, scene.height, self._scale)
        if self.mode != "human":
            return np.array(image)
        if self._window is None:
            self._window = _Window(image.size)
        self._window.show(image.tobytes())
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_window": None}  # a copy opens a window of its own


def status_line(snapshot: Snapshot) -> str:
    """Return a line with the time, the number of hits, and the mean speed, as far as known."""
    layout = snapshot.layout
    line = f"{snapshot.time * 1e3:7.1f} ms   {snapshot.hit} of {layout.count} hit"
    if snapshot.time > 0.0 and snapshot.hit > 1:
        speed = float(layout.positions[snapshot.hit - 1]) / snapshot.time
        line += f"   {speed:.4f} m/s so far"
        if snapshot.uniform_speed > 0.0:
            line += f" ({speed / snapshot.uniform_speed - 1.0:+z.1%} against uniform here)"
    if len(snapshot.hand):
        line += "   in hand " + ", ".join(f"{1e3 * d:g}" for d in snapshot.hand) + " mm"
    if snapshot.wave is not None:
        line += f"   {snapshot.wave.outcome.label}"
    return line


class _Window:
    """A pygame window for images of a size (width, height) [px]."""

    def __init__(self, size: tuple[int, int]) -> None:
        import pygame

        pygame.display.init()  # not pygame.init: its mixer prints errors if there is no sound
        pygame.display.set_caption("toppling dominoes")
        self._pygame, self._clock = pygame, pygame.time.Clock()
        self._surface = pygame.display.set_mode(size)

    def show(self, image: bytes) -> None:
        pygame, size = self._pygame, self._surface.get_size()
        pygame.event.pump()
        self._surface.blit(pygame.image.frombuffer(image, size, "RGB"), (0, 0))
        pygame.display.flip()
        self._clock.tick(FRAMES_PER_SECOND)

    def close(self) -> None:
        self._pygame.display.quit()
