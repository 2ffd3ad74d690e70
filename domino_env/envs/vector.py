"""Base classes of vector environments, and of single ones as batches of one."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, cast

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from domino_env.core.checks import require, require_choice, require_type
from domino_env.core.types import Bools, Floats, Singles
from domino_env.envs import rendering
from domino_env.envs.episodes import EpisodeResults, object_array, placed_layout
from domino_env.envs.sources import Generators, SceneSource
from domino_env.envs.spaces import check_actions
from domino_env.physics.layout import Layout
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.scene import Scene

Indices = NDArray[np.intp]  # (E,) indices of environments
Infos = dict[str, NDArray[Any]]

RTOL = 1e-6  # default relative error of the arrival times
SAME_KIND = 1e-9  # [m] less than this below it, a thickness counts as that of a kind
WINDOW = 8  # default number of gaps and thicknesses that are observed


class DominoVectorEnv(VectorEnv[Singles, Singles, NDArray[Any]]):
    """B environments that are reset and stepped together; see `DominoChainVector`.

    Parameters
    ----------
    num_envs
        B, the number of environments.
    source
        Scenes of their episodes.
    render_mode
        None, "rgb_array" or "ansi".
    autoreset_mode
        See `DominoChainVector`.

    Attributes
    ----------
    source
        Scenes of the episodes.
    observation_layout
        Slice of each part of an observation, by name.

    Raises
    ------
    ValueError
        For another render mode or autoreset mode.
    """

    # names of options of a reset, besides "reset_mask", and "scene" if scenes are sampled
    options: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        num_envs: int,
        source: SceneSource,
        render_mode: str | None,
        autoreset_mode: str | AutoresetMode,
    ) -> None:
        self.num_envs = int(num_envs)
        self.render_mode = render_mode
        self._renderer = rendering.Renderer(render_mode, rendering.VECTOR_MODES)
        modes = [mode.value for mode in AutoresetMode]
        require_choice("autoreset_mode", getattr(autoreset_mode, "value", autoreset_mode), modes)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            "render_modes": list(rendering.VECTOR_MODES),
            "render_fps": rendering.FRAMES_PER_SECOND,
            "autoreset_mode": self.autoreset_mode,
        }
        self.source = source
        self.observation_layout = source.observation_layout
        self._batch = source.new_batch(self.num_envs)
        self._episodes = self._batch.episodes
        self._pieces = self._remaining_kinds(np.array([source.first.first_thickness]))
        if self._batch.order.shape[1]:
            self._batch.order[:] = self._pieces
        # before the first reset, all environments have one scene of those that are sampled
        self._batch.scene[:] = source.sample(np.random.default_rng(0))
        source.begin_layouts(self._batch, np.arange(self.num_envs))
        self._waves = np.full(self.num_envs, None, object)  # of episodes that are over
        self._over = np.zeros(self.num_envs, np.bool_)  # environments whose episode is over
        self._begun = np.zeros(self.num_envs, np.bool_)  # environments that have been reset
        self._seeds: list[int | None] = [None] * self.num_envs
        self._generators: list[np.random.Generator | None] = [None] * self.num_envs

    def _set_spaces(self, action_size: int, observation: Box) -> None:
        """Set the spaces; actions have `action_size` entries."""
        self.single_action_space = Box(-1.0, 1.0, (action_size,), np.float32)
        self.single_observation_space = observation
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(observation, self.num_envs)
        self._observations: Singles = np.zeros(self.observation_space.shape or (), np.float32)

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """Scene of each environment."""
        return tuple(self._scene(b) for b in range(self.num_envs))

    @property
    def distribution(self) -> SceneDistribution | None:
        """Distribution that scenes are sampled from; None if the scene is fixed."""
        return self.source.distribution

    def _scene(self, env: int) -> Scene:
        return cast("Scene", self.source.scenes[self._batch.scene[env]])

    # reset ----------------------------------------------------------------------------------------

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Singles, dict[str, Any]]:
        """Begin episodes in all environments, or in those of a mask.

        Parameters
        ----------
        seed
            Seeds of the generators, which sample scenes, placement errors and orders of pieces: one
            for each environment, or a number s, with which environment i has seed s + i. None
            continues with a generator, or with a random seed if there is none.
        options
            Options of the class, and "reset_mask": (B,) booleans. Environments where it is False
            stay as they are.

        Returns
        -------
        observations : NDArray
            (B, O).
        infos : dict
            "scene" of each environment that was reset, if scenes are sampled.

        Raises
        ------
        ValueError
            For unknown options, for a mask or seeds of another shape, for seeds below 0, for a
            layout that breaks the scene's rules or whose wave stops, and for a scene that the
            distribution does not cover.
        TypeError
            For options that are not a dictionary.
        """
        start = self.check_options(options, "reset_mask")
        mask = self._check_mask(start.pop("reset_mask", None))
        for i, value in enumerate(self._check_seeds(seed)):
            if mask[i] and value is not None:
                self._seeds[i], self._generators[i] = value, None
        infos = self.begin(mask, self._observations, self._generator, **start)
        self._over &= ~mask
        self._begun |= mask
        return self._observations.copy(), self._spread({}, infos, mask)

    @abstractmethod
    def begin(
        self, mask: Bools, observations: Singles, generators: Generators, **options: Any
    ) -> Infos:
        """Begin episodes in some environments.

        Parameters
        ----------
        mask
            (B,) mask of the environments.
        observations
            (B, O) array to which their first observations are written.
        generators
            Function that returns the random generator of an environment, by its index.
        options
            Options of the reset, without the mask.

        Returns
        -------
        dict
            Arrays of infos, in the order of these environments: "scene" if scenes are sampled.

        Raises
        ------
        ValueError
            For options from which no episode can begin; all environments are then unchanged.
        """

    def _randomise(self, envs: Indices, generators: Generators, starts: dict[int, Layout]) -> None:
        """Sample placement errors and the order of the pieces, if the scene has them.

        starts: layouts that episodes start from, by environment.
        """
        errors, order = self._batch.errors, self._batch.order
        for env in envs.tolist() if len(errors) or order.shape[1] else ():
            scene = self._scene(env)
            if len(errors):
                errors[env, : scene.count - 1] = scene.placement_errors(generators(env))
            if order.shape[1]:
                given = starts.get(env)
                pieces = self._pieces if given is None else self._remaining_kinds(given.thickness)
                order[env, order.shape[1] - len(pieces) :] = generators(env).permutation(pieces)
                if given is not None:
                    placed = np.searchsorted(self._batch.kinds[0], given.thickness[1:] - SAME_KIND)
                    order[env, : len(placed)] = placed

    def _remaining_kinds(self, taken: Floats) -> NDArray[np.int16]:
        """Return the kind of each piece in the stock, without dominoes of thicknesses `taken`."""
        stock, kinds = self.source.first.stock, self._batch.kinds[0]
        left = np.empty(0) if stock is None else stock.without(*taken).dominoes
        return np.searchsorted(kinds, left).astype(np.int16)

    def check_options(self, options: dict[str, Any] | None, *others: str) -> dict[str, Any]:
        """Return a copy of the options of a reset, after a check of their names.

        Parameters
        ----------
        options
            Options; None for none.
        others
            Names that are accepted besides the options of the class.

        Returns
        -------
        dict
            Copy of the options; empty for None.

        Raises
        ------
        ValueError
            For an unknown name.
        TypeError
            For options that are not a dictionary.
        """
        require_type("options", options, dict | None, "a dictionary of options, or None")
        known = (*self.options, *("scene",) * (self.distribution is not None), *others)
        for key in options or {}:
            if key not in known:
                allowed = ", ".join(known) or "none"
                raise ValueError(f"unknown reset option '{key}'; accepted: {allowed}")
        return {**(options or {})}

    def _check_mask(self, mask: ArrayLike | None) -> Bools:
        flags = np.ones(self.num_envs, np.bool_) if mask is None else np.asarray(mask)
        if flags.dtype != np.bool_ or flags.shape != (self.num_envs,) or not flags.any():
            raise ValueError(
                f"options['reset_mask'] is {flags.dtype} of shape {flags.shape}: give "
                f"({self.num_envs},) booleans, at least one of them True"
            )
        return flags

    def _check_seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None or isinstance(seed, int | np.integer):
            seed = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        seeds = list(seed) if np.iterable(seed) else [seed] * self.num_envs
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed of length {len(seeds)}: give a number or {self.num_envs} seeds")
        for value in seeds:
            require("seed", value, 0, whole=True, optional=True)
        return [None if value is None else int(value) for value in seeds]

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """Seed of each environment; None if it has none yet."""
        return tuple(self._seeds)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Random generator of each environment."""
        return tuple(self._generator(i) for i in range(self.num_envs))

    def _generator(self, i: int) -> np.random.Generator:
        generator = self._generators[i]
        if generator is None:
            generator, self._seeds[i] = seeding.np_random(self._seeds[i])
            self._generators[i] = generator
        return generator

    # step -----------------------------------------------------------------------------------------

    def step(self, actions: ArrayLike) -> tuple[Singles, Floats, Bools, Bools, dict[str, Any]]:
        """Take a step in every environment.

        Parameters
        ----------
        actions
            (B, A) in [-1, 1]; entries beyond are clipped.

        Returns
        -------
        observations : NDArray
            (B, O).
        rewards : NDArray
            (B,) float64.
        terminated, truncated : NDArray
            (B,) masks of episodes that ended; none is ever truncated.
        infos : dict
            Infos of the class, for episodes that ended or, if scenes are sampled, began.

        Raises
        ------
        ValueError
            For actions of another shape or with entries that are not finite.
        ResetNeeded
            Before `reset`, and with DISABLED once an episode is over.
        """
        values = check_actions(actions, self.action_space.shape)
        if not self._begun.all():
            raise ResetNeeded("call reset() before the first step()")
        over = self._over
        if self.autoreset_mode == AutoresetMode.DISABLED and over.any():
            raise ResetNeeded(
                f"the episode of environment {int(np.argmax(over))} is over: "
                'call reset(options={"reset_mask": …}) before the next step()'
            )
        observations, rewards, ended, last_infos = self.advance(values)
        infos = self._spread({}, last_infos, ended)
        if over.any():
            infos = self._spread(infos, self.begin(over, observations, self._generator), over)
        self._over = ended
        if last_infos and self.autoreset_mode == AutoresetMode.SAME_STEP:
            final = self._spread({}, {"final_obs": object_array(observations[ended])}, ended)
            infos = final | {"final_info": infos, "_final_info": ended.copy()}
            infos = self._spread(infos, self.begin(ended, observations, self._generator), ended)
            self._over = np.zeros(self.num_envs, np.bool_)
        self._observations[:] = observations
        return observations, rewards, ended.copy(), np.zeros(self.num_envs, np.bool_), infos

    @abstractmethod
    def advance(self, actions: Floats) -> tuple[Singles, Floats, Bools, Infos]:
        """Take a step in every environment whose episode is not over.

        Parameters
        ----------
        actions
            (B, A) in [-1, 1]; entries beyond are clipped.

        Returns
        -------
        observations : NDArray
            (B, O); not set for environments whose episode is over.
        rewards : NDArray
            (B,); 0 for environments whose episode is over.
        ended : NDArray
            (B,) mask of episodes that ended.
        infos : dict
            Arrays (E,) of the infos of the E episodes that ended, in their order; empty if E = 0.
        """

    def _end(self, envs: Indices) -> tuple[Floats, Infos]:
        """Return the last rewards (E,) and the infos of environments (E,) whose episodes ended.

        The whole layout is simulated again in three cases: the score is not the mean speed of the
        wave; the error estimate exceeds the tolerance, as only a new simulation can be more exact;
        or the layout is uniform, for which `simulate` has another algorithm. The score of the
        uniform baseline is known.
        """
        batch, episodes = self._batch, self._episodes[envs]
        scenes = self._batch.scene[envs]
        results = EpisodeResults(
            scenes=[self._scene(env) for env in envs],
            baseline=self.source.score[scenes],
            unit=self.source.rules["score_unit"][scenes],
            rtol=self.source.rtol,
            spacing=batch.spacing[envs],
            thickness=batch.thickness[envs],
            height=batch.height[envs] if len(batch.height) == self.num_envs else batch.height,
            placed=episodes["placed"].tolist(),
            outcome=episodes["outcome"],
            reach=episodes["reach"],
            score=episodes["score"],
        )
        unknown = episodes["uncertain"] & ~episodes["as_uniform"]
        if unknown.any():
            results.simulate(np.flatnonzero(unknown).tolist())
        if (same := episodes["as_uniform"]).any():
            for name in ("score", "outcome", "reach"):
                getattr(results, name)[same] = getattr(self.source, name)[scenes[same]]
        self._episodes["outcome"][envs] = results.outcome
        infos = results.infos()
        if self.distribution is not None:
            infos["scene"] = object_array(results.scenes)
        self._waves[envs] = infos["wave"]
        return results.returns - episodes["reward_sum"], infos

    def _spread(self, infos: dict[str, Any], values: Infos, mask: Bools) -> dict[str, Any]:
        """Write arrays of infos of the environments of a mask into arrays of all environments."""
        for key, entries in values.items():
            if key not in infos:
                blank = np.empty if entries.dtype == object else np.zeros  # empty objects are None
                infos[key] = blank(self.num_envs, entries.dtype)
                infos[f"_{key}"] = np.zeros(self.num_envs, np.bool_)
            infos[key][mask] = entries
            infos[f"_{key}"] |= mask
        return infos

    # rendering ------------------------------------------------------------------------------------

    def snapshot(self, env: int) -> rendering.Snapshot:
        """Return the chain of an environment, by its index, at its latest hit."""
        batch, placed, wave = self._batch, int(self._episodes[env].placed), self._waves[env]
        sizes = batch.spacing[env], batch.thickness[env], batch.height[env % len(batch.height)]
        hand = self._scene(env).hand  # its pieces follow those placed in the order of the draw
        kinds = np.sort(batch.order[env, placed : placed + hand])
        time = batch.states[env].time if wave is None else wave.arrival_times[wave.hit - 1]
        return rendering.Snapshot(
            layout=placed_layout(self._scene(env), placed, *sizes),
            hit=placed + 1 if wave is None else wave.hit,
            time=float(time),
            uniform_speed=float(self.source.speed[self._batch.scene[env]]),
            wave=wave,
            hand=batch.kinds[0, kinds],
        )

    def render(self) -> tuple[Any, ...] | None:
        """Return a frame of every environment at its latest hit; None without a render mode."""
        if self.render_mode is None:
            return None
        frame = self._renderer.frame
        return tuple(frame(self.snapshot(b), self._scene(b)) for b in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Release the renderer."""
        self._renderer.close()


class DominoEnv(gymnasium.Env[Singles, Singles]):
    """Single environment, which steps a vector environment of one.

    Parameters
    ----------
    vector
        Vector environment with one environment.
    render_mode
        None, "rgb_array", "human" or "ansi".

    Attributes
    ----------
    observation_layout
        Slice of each part of an observation, by name.

    Raises
    ------
    ValueError
        For another render mode.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(rendering.OFFERED_MODES),
        "render_fps": rendering.FRAMES_PER_SECOND,
    }

    def __init__(self, vector: DominoVectorEnv, render_mode: str | None) -> None:
        self.render_mode = render_mode
        self._renderer = rendering.Renderer(render_mode, rendering.MODES)
        self._vector = vector
        self._all = np.ones(1, np.bool_)
        self._begun = self._over = False
        self.observation_layout = vector.observation_layout
        self.action_space = vector.single_action_space
        self.observation_space = vector.single_observation_space

    @property
    def scene(self) -> Scene:
        """Scene of the current episode."""
        return self._vector.scenes[0]

    @property
    def distribution(self) -> SceneDistribution | None:
        """Distribution that scenes are sampled from; None if the scene is fixed."""
        return self._vector.distribution

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Singles, dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed
            Seed of `np_random`, which samples scenes, placement errors and orders of pieces. None
            continues with the generator, or with a random seed if there is none.
        options
            Options of the class.

        Returns
        -------
        observation : NDArray
            (O,).
        info : dict
            "scene" if scenes are sampled.

        Raises
        ------
        ValueError
            For unknown options, for a layout that breaks the scene's rules or whose wave stops,
            and for a scene that the distribution does not cover.
        TypeError
            For options that are not a dictionary.
        """
        super().reset(seed=seed)
        start = self._vector.check_options(options)
        observations = np.empty(self._vector.observation_space.shape or (), np.float32)
        infos = self._vector.begin(self._all, observations, lambda _: self.np_random, **start)
        self._begun, self._over = True, False
        if self.render_mode == "human":
            self.render()
        return observations[0], {key: values.item(0) for key, values in infos.items()}

    def step(self, action: ArrayLike) -> tuple[Singles, float, bool, bool, dict[str, Any]]:
        """Take a step.

        Parameters
        ----------
        action
            (A,) in [-1, 1]; entries beyond are clipped.

        Returns
        -------
        observation : NDArray
            (O,).
        reward : float
            Reward, as the class defines it.
        terminated : bool
            True if the episode has ended.
        truncated : bool
            False.
        info : dict
            Info of the class after the last step, else empty.

        Raises
        ------
        ValueError
            For an action of another shape or with entries that are not finite.
        ResetNeeded
            Before `reset`, and once the episode is over.
        """
        values = check_actions(action, self.action_space.shape)
        if self._over or not self._begun:
            reason = "the episode is over: " if self._over else ""
            raise ResetNeeded(f"{reason}call reset() before the next step()")
        observations, rewards, ended, infos = self._vector.advance(values[None])
        self._over = bool(ended[0])
        if self.render_mode == "human":
            self.render()
        info = {key: values.item(0) for key, values in infos.items()}
        return observations[0], float(rewards[0]), self._over, False, info

    def snapshot(self) -> rendering.Snapshot:
        """Return the chain at its latest hit."""
        return self._vector.snapshot(0)

    def render(self) -> NDArray[np.uint8] | str | None:
        """Return the chain at its latest hit as an image or text; None for a window or no mode."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render() shows nothing without a render mode: gymnasium.make(…, render_mode="…") '
                f"takes one of {', '.join(rendering.MODES)}"
            )
            return None
        return self._renderer.frame(self.snapshot(), self.scene)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._renderer.close()
