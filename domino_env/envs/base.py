"""What all environments of a row share: episodes of a scene, frames on demand, checks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from domino_env.envs.problems import Generators, Problems
from domino_env.envs.snapshot import Snapshot
from domino_env.physics.layout import Layout
from domino_env.scenes.distribution import SceneDistribution, load_any
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]
Observations = NDArray[np.float32]
Bools = NDArray[np.bool_]
Start = Sequence[Layout | None] | Layout | None

RENDER_MODES = ("rgb_array", "human", "ansi")
RENDER_FPS = 20
RTOL = 1e-6
WINDOW = 8


class Episodes(ABC):
    """B episodes side by side; those of a single environment are one.

    Attributes
    ----------
    problems
        The scenes that they may be in.
    number
        B.
    actions
        (A,) space of the actions of one row.
    observations
        (O,) space of the observations of one row.
    options
        What a reset can be given, by name.
    """

    problems: Problems
    number: int
    actions: Box
    observations: Box
    options: tuple[str, ...] = ()

    @abstractmethod
    def scene(self, row: int) -> Scene:
        """Return what is built in a row."""

    @abstractmethod
    def reset(
        self,
        chosen: Bools,
        observations: Observations,
        generators: Generators,
        layout: Start = None,
        scene: Sequence[Scene | None] | Scene | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Begin anew in the chosen rows.

        Parameters
        ----------
        chosen
            (B,) which rows.
        observations
            (B, O), written for the chosen rows.
        generators
            Of each row, by its number: what scenes are drawn with.
        layout
            The first dominoes of each row, or of all, which stand already; None for the first
            alone. Only where it is among `options`.
        scene
            Of each row, or of all; None for one that is drawn. Only where it is among `options`.

        Returns
        -------
        dict
            What is known of the chosen rows, arrays in their order: "scene" where one is drawn at
            every reset.

        Raises
        ------
        ValueError
            Where `layout` breaks the scene's rules or its wave dies, and for a `scene` of another
            kind than those drawn; every row is then left as it was.
        """

    @abstractmethod
    def step(self, actions: Floats) -> tuple[Observations, Floats, Bools, dict[str, NDArray[Any]]]:
        """Take a step in every row that runs.

        Parameters
        ----------
        actions
            (B, A) in [-1, 1].

        Returns
        -------
        observations : NDArray
            (B, O); the entries of rows that did not run are not set.
        rewards : NDArray
            (B,); 0 for rows that did not run.
        ended : NDArray
            (B,) which episodes ended.
        infos : dict
            What is known of those, (E,) arrays in the order of the rows; empty if there are none.
        """

    @abstractmethod
    def snapshot(self, row: int) -> Snapshot:
        """Show a row at its latest hit."""


class RowEnv(gymnasium.Env[Observations, Observations]):
    """An environment of one row that can be looked at.

    Parameters
    ----------
    scene
        The design problem: a name, the path of a TOML file, a `Scene`, or a `SceneDistribution`.
    render_mode
        None, "rgb_array", "human" or "ansi".
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(RENDER_MODES),
        "render_fps": RENDER_FPS,
    }
    _episodes: Episodes

    def __init__(self, render_mode: str | None) -> None:
        self.render_mode = checked_render_mode(render_mode)
        self._all = np.ones(1, np.bool_)
        self._begun = self._over = False
        self._painter: Any = None

    def _use(self, episodes: Episodes) -> None:
        """Stand on these episodes, of which there is one."""
        self._episodes = episodes
        self.action_space = episodes.actions  # type: ignore[assignment]
        self.observation_space = episodes.observations  # type: ignore[assignment]

    @property
    def scene(self) -> Scene:
        """What is built; where a scene is drawn at every reset, the latest."""
        return self._episodes.scene(0)

    @property
    def distribution(self) -> SceneDistribution | None:
        """What scenes are drawn from; None where there is but one."""
        return self._episodes.problems.distribution

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed
            Of `np_random`, which scenes are drawn with; where the scene is fixed, nothing is
            random.
        options
            As of the class.

        Returns
        -------
        tuple
            The observation and an info, which holds the "scene" if one was drawn.

        Raises
        ------
        ValueError
            For other options, for a layout that breaks the scene's rules or dies, and for a scene
            of another kind than those drawn.
        """
        super().reset(seed=seed)
        given = checked_options(options, self._episodes.options)
        observations = np.empty((1, *self._episodes.observations.shape), np.float32)
        infos = self._episodes.reset(self._all, observations, lambda _: self.np_random, **given)
        self._begun, self._over = True, False
        if self.render_mode == "human":
            self.render()
        return observations[0], {key: values.item(0) for key, values in infos.items()}

    def step(self, action: ArrayLike) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Parameters
        ----------
        action
            (A,) in [-1, 1], as of the class.

        Returns
        -------
        tuple
            Observation, reward, terminated, truncated and info, as of the class.

        Raises
        ------
        ValueError
            For an action of another shape or with entries that are not finite.
        ResetNeeded
            Before `reset`, and once the episode is over.
        """
        values = checked_actions(action, self._episodes.actions)
        if self._over or not self._begun:
            raise ResetNeeded(
                "the episode is over: call reset() before the next step()"
                if self._over
                else "call reset() before the first step()"
            )
        observations, rewards, ended, infos = self._episodes.step(values[None])
        self._over = bool(ended[0])
        if self.render_mode == "human":
            self.render()
        info = {key: values.item(0) for key, values in infos.items()}
        return observations[0], float(rewards[0]), self._over, False, info

    def snapshot(self) -> Snapshot:
        """Show the row at the latest hit."""
        return self._episodes.snapshot(0)

    moment = snapshot  # its name in version 0.1.0

    def render(self) -> NDArray[np.uint8] | str | None:
        """Draw the row at the latest hit: an image, a text, or None for a window."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render() shows nothing without a render mode: gymnasium.make(…, render_mode="…") '
                f"with one of {', '.join(RENDER_MODES)}"
            )
            return None
        if self._painter is None:
            self._painter = new_painter(self.render_mode)
        frame: NDArray[np.uint8] | str | None = self._painter.frame(self.snapshot(), self.scene)
        return frame

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_painter": None}  # windows stay where they are


def loaded(scene: str | Path | Scene | SceneDistribution) -> Scene | SceneDistribution:
    """Return a scene, or what scenes are drawn from, by its name or path where that is given."""
    return scene if isinstance(scene, Scene | SceneDistribution) else load_any(scene)


def new_painter(render_mode: str) -> Any:
    """Load what draws, now that somebody asks for it."""
    from domino_env.envs.render import Painter

    return Painter(render_mode)


def checked_render_mode(mode: str | None, allowed: tuple[str, ...] = RENDER_MODES) -> str | None:
    """Return the mode, if there is such a one."""
    if mode is not None and mode not in allowed:
        raise ValueError(f"render_mode = {mode!r}: choose None or one of {', '.join(allowed)}")
    return mode


def checked_options(options: dict[str, Any] | None, allowed: tuple[str, ...]) -> dict[str, Any]:
    """Return the options of a reset, if they are known ones."""
    for key in options or {}:
        if key not in allowed:
            known = ", ".join(allowed) or "none"
            raise ValueError(f"unknown reset option '{key}': allowed: {known}")
    return options or {}


def checked_actions(actions: ArrayLike, space: gymnasium.Space[Any]) -> Floats:
    """Return actions as float64, if they have the shape of a space and are finite."""
    values = np.asarray(actions, dtype=np.float64)
    if values.shape != space.shape:
        raise ValueError(
            f"action of shape {values.shape}: expected {space.shape}, entries from -1 to 1"
        )
    if not np.isfinite(values).all():
        place = tuple(np.argwhere(~np.isfinite(values))[0])
        where = ", ".join(str(i) for i in place)
        raise ValueError(
            f"action[{where}] = {values[place]}: every entry must be finite, from -1 to 1"
        )
    return values
