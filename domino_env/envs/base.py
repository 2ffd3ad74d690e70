"""What the environments of a row have in common: a scene, frames on demand, checks at the door."""

from __future__ import annotations

from abc import abstractmethod
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from domino_env.envs.episodes import Floats, Seen, shared_scene
from domino_env.envs.snapshot import Moment
from domino_env.scenes.scene import Scene

RENDER_MODES = ("rgb_array", "human", "ansi")
RENDER_FPS = 20
RTOL = 1e-6
WINDOW = 8


class RowEnv(gymnasium.Env[Seen, Seen]):
    """An environment of one row that can be looked at.

    Parameters
    ----------
    scene
        The design problem: a name, the path of a TOML file, or a `Scene`.
    render_mode
        None, "rgb_array", "human" or "ansi".
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(RENDER_MODES),
        "render_fps": RENDER_FPS,
    }

    def __init__(self, scene: str | Path | Scene, render_mode: str | None) -> None:
        self.render_mode = checked_render_mode(render_mode)
        self.scene = shared_scene(scene)
        self._painter: Any = None

    @abstractmethod
    def moment(self) -> Moment:
        """Show the row at the latest hit."""

    def render(self) -> NDArray[np.uint8] | str | None:
        """Draw the row at the latest hit: an image, a text, or None for a window."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render() shows nothing without a render mode: gymnasium.make(…, render_mode="…") '
                f"with one of {', '.join(RENDER_MODES)}"
            )
            return None
        if self._painter is None:
            self._painter = new_painter(self.scene, self.render_mode)
        frame: NDArray[np.uint8] | str | None = self._painter.frame(self.moment())
        return frame

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_painter": None}  # windows stay where they are


def new_painter(scene: Scene, render_mode: str) -> Any:
    """Load what draws, now that somebody asks for it."""
    return import_module("domino_env.envs.render").Painter(scene, render_mode)


def checked_render_mode(mode: str | None, allowed: tuple[str, ...] = RENDER_MODES) -> str | None:
    """Return the mode, if there is such a one."""
    if mode is not None and mode not in allowed:
        raise ValueError(f"render_mode = {mode!r}: choose None or one of {', '.join(allowed)}")
    return mode


def checked_options(
    options: dict[str, Any] | None, allowed: tuple[str, ...] = ("layout",)
) -> dict[str, Any]:
    """Return the options of a reset, if they are known ones."""
    for key in options or {}:
        if key not in allowed:
            known = ", ".join(allowed) or "none"
            raise ValueError(f"unknown reset option '{key}': allowed: {known}")
    return options or {}


def wrong_actions(values: Floats, space: gymnasium.Space[Any]) -> str:
    """Say what is wrong with actions that do not fit a space."""
    if values.shape != space.shape:
        return f"action of shape {values.shape}: expected {space.shape}, entries from -1 to 1"
    place = np.argwhere(~np.isfinite(values))[0]
    where = ", ".join(str(i) for i in place)
    return f"action[{where}] = {values[tuple(place)]}: every entry must be finite, from -1 to 1"
