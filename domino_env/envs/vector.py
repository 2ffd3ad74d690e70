"""DominoChainVector: batches of environments in which one action places one domino."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, cast

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from domino_env.core.checks import numbers, require, require_choice, require_type
from domino_env.core.files import as_text
from domino_env.core.threads import share_evenly
from domino_env.core.types import Bools, Floats, Singles
from domino_env.envs import rendering
from domino_env.envs.arguments import SceneLike, WritableSpec
from domino_env.envs.baselines import Baselines
from domino_env.envs.batch import SceneArrays, piece_kinds
from domino_env.envs.catalogue import Catalogue, Generators
from domino_env.envs.episodes import EpisodeResults, placed_layout
from domino_env.envs.spaces import action_entries, check_actions
from domino_env.kernels.step import environment as kernels
from domino_env.kernels.step.batch import BEGINNING, RUNNING
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave, simulate
from domino_env.scenes.design_space import LENGTH_TOLERANCE
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.rules import SAME_THICKNESS
from domino_env.scenes.scene import Scene

Indices = NDArray[np.intp]  # (E,) indices of environments
Infos = dict[str, NDArray[Any]]

MIN_PER_THREAD = 128  # environments; their steps take at least ten times as long as waking a thread
RTOL = 1e-6  # default relative error of the arrival times
INFOS = ("all", "numbers")  # values of `info`
CUT_INFOS = ("layout", "wave", "scene")  # keys of the infos of truncated episodes
NO_OUTCOME = -1  # in place of an `Outcome`, before the end of an episode
WINDOW = 8  # default number of gaps and thicknesses that are observed


class DominoChainVector(WritableSpec, VectorEnv[Singles, Singles, NDArray[Any]]):
    """Vector environment of `DominoChain`, bitwise equal to single environments.

    Actions (B, A), observations (B, O) and rewards (B,) float64 are as in Gymnasium's vector
    environments; infos hold an array of length B for each key of the single environment's info, and
    under "_key" the mask of entries that are set. `numba.set_num_threads` limits the threads.

    The options of a reset are "reset_mask", a (B,) mask of the environments to reset, and "layout",
    the first dominoes: one `Layout` for all environments, or a list with a `Layout` or None for
    each. If scenes are sampled, "scene" chooses them: one for all environments, or a list with a
    `Scene` or None for each. Options hold for the episodes that this reset begins; episodes that
    begin after them, by themselves or by a reset without options, begin without.

    Parameters
    ----------
    num_envs
        B, the number of environments.
    scene
        See `DominoChain`.
    render_mode
        None or "rgb_array".
    rtol
        See `DominoChain`.
    window
        See `DominoChain`.
    autoreset_mode
        Step on which an environment resets after the last step of an episode:

        - NEXT_STEP: the following step, which ignores the action and has reward 0.
        - SAME_STEP: the last step itself; the last observation and info are in infos["final_obs"]
          and infos["final_info"].
        - DISABLED: none; call `reset(options={"reset_mask": …})` before the next step.
    num_scenes, first_scene, hide, info
        See `DominoChain`.
    max_episode_steps
        Number of steps after which an episode is truncated, as by `gymnasium.wrappers.TimeLimit`;
        None for no limit. The info of a truncated episode has the `layout` of the dominoes that it
        placed and their `wave`.

    Attributes
    ----------
    catalogue
        Scenes of the episodes.
    baselines
        Their uniform baselines.
    observation_layout
        Slice of each part of an observation, by name.

    Raises
    ------
    ValueError
        As for `DominoChain`, and for another number of environments or autoreset mode.

    Examples
    --------
    >>> import gymnasium, domino_env
    >>> envs = gymnasium.make_vec("DominoChain-v2", num_envs=1024, scene="sprint")
    >>> observations, infos = envs.reset(seed=0)
    """

    # names of options of a reset, besides "reset_mask", and "scene" if scenes are sampled
    options: ClassVar[tuple[str, ...]] = ("layout",)

    def __init__(
        self,
        num_envs: int = 1,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        window: int = WINDOW,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        num_scenes: int | None = None,
        first_scene: int = 0,
        hide: Sequence[str] = (),
        info: str = "all",
        max_episode_steps: int | None = None,
    ) -> None:
        require_choice("info", info, INFOS)
        limit = None if max_episode_steps == -1 else max_episode_steps  # -1 as in gymnasium.make
        require("max_episode_steps", limit, 1, whole=True, optional=True)
        self.catalogue = Catalogue(scene, num_envs, num_scenes, first_scene, hide)
        self._tables = SceneArrays(self.catalogue, rtol, window)
        self.num_envs, first = self.catalogue.num_envs, self.catalogue.first
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
        self.info, self.max_episode_steps = info, limit
        self.baselines = Baselines(self.catalogue, self._tables)
        self.longest_episode = self.catalogue.longest_episode
        self.observation_layout = self._tables.layout
        self._batch = self._tables.new_batch(self.num_envs)
        self._episodes = self._batch.episodes
        # before the first reset, all environments have one scene of those that are sampled
        self._batch.scene[:] = self.catalogue.sample(np.random.default_rng(0))
        self.baselines.load(self._batch.scene[:1])
        self._batch.order[:] = self._tables.pieces[self._batch.scene]
        self._tables.begin_layouts(self._batch, np.arange(self.num_envs))
        self._waves = np.full(self.num_envs, None, object)  # of episodes that are over
        self._over = np.zeros(self.num_envs, np.bool_)  # environments whose episode is over
        self._begun = np.zeros(self.num_envs, np.bool_)  # environments that have been reset
        self._steps = np.zeros(self.num_envs, np.int64)  # of episodes, if their number is limited
        self._seeds: list[int | None] = [None] * self.num_envs
        self._generators: list[np.random.Generator | None] = [None] * self.num_envs
        self._nothing: list[Any] = [None] * self.num_envs  # value of an option that is not given
        self._set_spaces(action_entries(first), self.observation_layout.space)

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
        return tuple(self.baselines.scenes[self._batch.scene])

    @property
    def distribution(self) -> SceneDistribution | None:
        """Distribution that scenes are sampled from; None if the scene is fixed."""
        return self.catalogue.distribution

    def _scene(self, env: int) -> Scene:
        return cast("Scene", self.baselines.scenes[self._batch.scene[env]])

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
            "scene" of each environment that was reset, if scenes are sampled. See `DominoChain` for
            `info="numbers"`.

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
            For options from which no episode can begin; all episodes then go on.
        """
        infos = self._prepare(mask, generators, **options)
        no_actions, rewards = np.empty((self.num_envs, 0)), np.empty(self.num_envs)
        ended = np.empty(self.num_envs, np.bool_)
        kernels.step_batch(0, self.num_envs, self._batch, no_actions, observations, rewards, ended)
        return infos

    def _prepare(self, mask: Bools, generators: Generators, **options: Any) -> Infos:
        """Prepare episodes, which the next call of the kernel begins; as `begin` otherwise."""
        envs, indices = np.flatnonzero(mask), self._batch.scene.copy()
        baselines, sample = self.baselines, self.catalogue.sample
        layouts = self._value_per_env("layout", options.get("layout"), Layout)
        if self.distribution is not None:
            scenes = self._value_per_env("scene", options.get("scene"), Scene)
            indices[envs] = [
                baselines.add(b, scenes[b], indices[b]) if scenes[b] else sample(generators(b))
                for b in envs.tolist()
            ]
            baselines.load(indices[envs])
        starts = {b: layouts[b] for b in envs.tolist() if layouts[b] is not None}
        for b, start in starts.items():
            _check_start(start, baselines.scenes[indices[b]], self._tables.rtol, b)
        self._batch.scene[:] = indices  # from here on nothing is rejected
        self._tables.begin_layouts(self._batch, envs)
        self._randomise(envs, generators, starts)
        batch, placed = self._batch, np.zeros(self.num_envs, np.int64)
        for b, start in starts.items():
            placed[b] = start.count - 1
            batch.spacing[b, : placed[b]] = start.spacing
            batch.thickness[b, : start.count] = start.thickness
            if self._scene(b).growth is not None:
                batch.height[b, : start.count] = start.height
        self._episodes["phase"][mask], self._episodes["placed"][mask] = BEGINNING, placed[mask]
        self._waves[mask], self._steps[mask] = None, 0
        if self.distribution is None or self.info == "numbers":
            return self.unfinished(len(envs))
        return {"scene": baselines.scenes[indices[envs]]}

    def unfinished(self, number: int) -> Infos:
        """Return the infos of some episodes that are not over: none, or arrays without results."""
        if self.info == "all":
            return {}
        score, gain = np.zeros((2, number))  # not NaN, which checkers find unequal to itself
        return {"score": score, "gain": gain, "outcome": np.full(number, NO_OUTCOME)}

    def _value_per_env(self, name: str, value: Any, kind: type) -> list[Any]:
        """Return a list of one value per environment from a shared value, a sequence or None."""
        if value is None:
            return self._nothing
        values = list(value) if np.iterable(value) else [value] * self.num_envs
        types = set(map(type, values)) - {type(None)}
        if len(values) != self.num_envs or not all(issubclass(given, kind) for given in types):
            raise ValueError(
                f"{name} = {as_text(value)}: give one {kind.__name__} for all, or a list with one "
                f"for each of the {self.num_envs} environments"
            )
        return values

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
                given, index = starts.get(env), self._batch.scene[env]
                pieces = self._tables.pieces[index]
                if given is not None:
                    pieces = piece_kinds(scene, given.thickness)
                order[env, order.shape[1] - len(pieces) :] = generators(env).permutation(pieces)
                if given is not None:
                    kinds = self._tables.kinds[index, 0]
                    placed = np.searchsorted(kinds, given.thickness[1:] - SAME_THICKNESS)
                    order[env, : len(placed)] = placed

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

    def _check_seeds(self, seed: object) -> list[int | None]:
        if seed is None or isinstance(seed, int | np.integer):
            seed = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        seeds: list[Any] = list(seed) if np.iterable(seed) else [seed] * self.num_envs
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
            (B,) masks of episodes that ended; none is truncated without `max_episode_steps`.
        infos : dict
            Infos of the class, for episodes that ended or, if scenes are sampled, began.

        Raises
        ------
        ValueError
            For actions of another shape or with entries that are not finite.
        ResetNeeded
            Before `reset`, and with DISABLED once an episode is over.
        """
        over, mode = self._over, self.autoreset_mode
        ignored = over if mode == AutoresetMode.NEXT_STEP else None
        values = check_actions(actions, self.action_space.shape, ignored)
        if not self._begun.all():
            raise ResetNeeded("call reset() before the first step()")
        if mode == AutoresetMode.DISABLED and over.any():
            raise ResetNeeded(
                f"the episode of environment {int(np.argmax(over))} is over: "
                'call reset(options={"reset_mask": …}) before the next step()'
            )
        infos = self._spread({}, self.unfinished(self.num_envs), np.ones(self.num_envs, np.bool_))
        if over.any():
            infos = self._spread(infos, self._prepare(over, self._generator), over)
        observations, rewards, terminated, last = self.advance(values)
        truncated = np.zeros(self.num_envs, np.bool_)
        if self.max_episode_steps is not None:
            self._steps += ~over
            truncated = self._steps >= self.max_episode_steps
        ended = terminated | truncated
        at_once = mode == AutoresetMode.SAME_STEP and bool(ended.any())
        last_infos = self._spread({} if at_once else infos, last, terminated)
        cut = np.flatnonzero(truncated & ~terminated)
        if len(cut):
            self._spread(last_infos, self._end(cut)[1], truncated & ~terminated)
        self._over = ended
        if at_once:
            final = observations[ended] if self.info == "numbers" else _rows(observations[ended])
            infos = self._spread(infos, {"final_obs": final}, ended)
            infos |= {"final_info": last_infos, "_final_info": ended.copy()}
            infos = self._spread(infos, self.begin(ended, observations, self._generator), ended)
            self._over = np.zeros(self.num_envs, np.bool_)
        self._observations[:] = observations
        return observations, rewards, terminated.copy(), truncated, infos

    def advance(self, actions: Floats) -> tuple[Singles, Floats, Bools, Infos]:
        """Take a step in every environment whose episode is not over, and begin prepared episodes.

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
        observations = np.empty(self._observations.shape, np.float32)
        rewards = np.empty(self.num_envs)
        ended = np.empty(self.num_envs, np.bool_)
        share_evenly(
            kernels.step_batch, self.num_envs, MIN_PER_THREAD,
            self._batch, actions, observations, rewards, ended,
        )  # fmt: skip
        infos: Infos = {}
        if np.count_nonzero(ended):  # faster than any()
            envs = np.flatnonzero(ended)
            rewards[envs], infos = self._end(envs)
        return observations, rewards, ended, infos

    def _end(self, envs: Indices) -> tuple[Floats, Infos]:
        """Return the last rewards (E,) and the infos of environments (E,) whose episodes ended.

        Truncated episodes, which are still running, have a layout and a wave only.
        """
        results = EpisodeResults(self.baselines, self._batch, envs)
        infos = results.infos()
        self._waves[envs] = infos["wave"]
        if self._episodes["phase"][envs[0]] == RUNNING:
            kept: Infos = {name: infos[name] for name in CUT_INFOS if name in infos}
            return results.last_rewards, self.unfinished(len(envs)) or kept
        self._episodes["outcome"][envs] = results.outcome
        if self.info == "numbers":
            names = ("score", "gain")
            infos = {name: infos[name] for name in names} | {"outcome": results.outcome.copy()}
        return results.last_rewards, infos

    def _spread(self, infos: dict[str, Any], values: Infos, mask: Bools) -> dict[str, Any]:
        """Write arrays of infos of the environments of a mask into arrays of all environments."""
        if not values:
            return infos
        envs = np.flatnonzero(mask)  # faster than the mask if it is sparse
        for key, entries in values.items():
            if key not in infos:
                blank = np.empty if entries.dtype == object else np.zeros  # empty objects are None
                infos[key] = blank((self.num_envs, *entries.shape[1:]), entries.dtype)
                infos[f"_{key}"] = np.zeros(self.num_envs, np.bool_)
            infos[key][envs] = entries
            infos[f"_{key}"][envs] = True
        return infos

    def wave(self, env: int) -> Wave:
        """Return the wave in the dominoes that an environment, by its index, has placed so far."""
        if self._waves[env] is None:
            return EpisodeResults(self.baselines, self._batch, np.array([env])).wave(0)
        return cast("Wave", self._waves[env])

    # planning -------------------------------------------------------------------------------------

    def actions_towards(self, layout: Layout | Sequence[Layout]) -> Floats:
        """Return actions that place the next domino of every environment as in a layout.

        Parameters
        ----------
        layout
            Layout of all environments, or a list with one for each.

        Returns
        -------
        ndarray
            Actions (B, A), the nearest ones that the rules allow; 0 where episodes are over.

        Raises
        ------
        ValueError
            If the number of layouts is not that of the environments, or if one is not a `Layout`.
        """
        layouts = self._value_per_env("layout", layout, Layout)
        # gap, thickness, heights behind and ahead of it; without a target the smallest sizes
        targets = np.tile([0.0, 0.0, 1.0, 1.0], (self.num_envs, 1))
        for b, (n, target) in enumerate(zip(self._episodes["placed"], layouts, strict=True)):
            if target is not None and n < target.count - 1:
                sizes = target.spacing[n], target.thickness[n + 1]
                targets[b] = *sizes, *target.height[n : n + 2]
        actions = np.zeros((self.num_envs, action_entries(self.catalogue.first)))
        kernels.encode_batch(0, self.num_envs, self._batch, targets, actions)
        return actions

    def place_all(self, actions: Floats) -> tuple[Floats, Floats, Floats]:
        """Place all dominoes of every environment without simulating the wave.

        No placement errors are added. Afterwards all episodes are over; they have no result.

        Parameters
        ----------
        actions
            (B, P, A) in [-1, 1], for the P dominoes of the longest chain after its first one;
            surplus actions of shorter chains are ignored.

        Returns
        -------
        tuple of ndarray
            Gaps, thicknesses and heights of dominoes 1 … P, (B, P) each [m].

        Raises
        ------
        ValueError
            For actions of another shape or with entries that are not finite.
        """
        shape, batch = self._placing_shape, self._batch
        batch = batch._replace(errors=batch.errors[:0], order=batch.order.copy())
        mask, pairs = np.ones(self.num_envs, np.bool_), shape[1]
        kernels.place_batch(0, self.num_envs, batch, mask, check_actions(actions, shape))
        self._over[:] = True
        height = np.broadcast_to(batch.height, batch.thickness.shape)
        return (
            batch.spacing[:, :pairs].copy(),
            batch.thickness[:, 1 : pairs + 1].copy(),
            height[:, 1 : pairs + 1].copy(),
        )

    def place_all_vjp(self, actions: Floats, derivatives: Floats) -> Floats:
        """Compute the vector-Jacobian product of the preceding `place_all`.

        Parameters
        ----------
        actions
            (B, P, A) actions of that call. Outside [-1, 1] derivatives are those at the nearer end,
            and 0 where a nearer entry reaches the bound. If the baseline is at a bound, those on
            that side of 0 are those at 0. Preferences have derivative 0.
        derivatives
            (B, P, 3) derivatives with respect to gap, thickness and height [1/m].

        Returns
        -------
        ndarray
            Derivatives with respect to the actions, (B, P, A); 0 for surplus actions.

        Raises
        ------
        ValueError
            For arrays of another shape or with entries that are not finite.
        """
        shape = self._placing_shape
        derivatives = numbers("derivatives", derivatives, None, (*shape[:2], 3), finite=True)
        gradient = np.zeros(shape)
        actions = check_actions(actions, shape)
        kernels.place_vjp(0, self.num_envs, self._batch, actions, derivatives, gradient)
        return gradient

    @property
    def _placing_shape(self) -> tuple[int, ...]:
        """Shape (B, P, A) of the actions of `place_all`."""
        longest = int(self._batch.rules["count"][self._batch.scene].max())
        return self.num_envs, longest - 1, action_entries(self.catalogue.first)

    # rendering ------------------------------------------------------------------------------------

    def snapshot(self, env: int) -> rendering.Snapshot:
        """Return the chain of an environment, by its index, at its latest hit."""
        batch, placed, wave = self._batch, int(self._episodes[env].placed), self._waves[env]
        sizes = batch.spacing[env], batch.thickness[env], batch.height[env % len(batch.height)]
        hand = self._scene(env).hand  # its pieces follow those placed in the order of the draw
        kinds = np.sort(batch.order[env, placed : placed + hand])
        time = batch.states[env].time if wave is None else wave.arrival_times[wave.hit - 1]
        layout = placed_layout(self._scene(env), placed, *sizes) if wave is None else wave.layout
        return rendering.Snapshot(
            layout=layout,
            hit=placed + 1 if wave is None else wave.hit,
            time=float(time),
            uniform_speed=self.baselines.speed_at(
                int(batch.scene[env]), placed + 1 if wave is None else wave.hit
            ),
            wave=wave,
            hand=batch.kinds[batch.scene[env], 0, kinds],
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


def _rows(values: Singles) -> NDArray[Any]:
    """Return an array (E,) of objects, the rows (O,) of an array (E, O)."""
    return np.fromiter(values, object)


def _check_start(layout: Layout, scene: Scene, rtol: float, env: int) -> None:
    """Raise a ValueError for a layout from which no episode of an environment can start."""
    violations = scene.violations(layout, complete=False)
    if not violations and layout.count >= scene.count:
        violations = [
            f"it has {layout.count} dominoes: leave at least one of the scene's {scene.count} to "
            "place"
        ]
    if not violations and scene.length is not None:
        pairs, left = scene.count - layout.count, scene.length - layout.length
        least = pairs * (scene.spacing[0] + scene.thickness[0])
        most = pairs * (scene.spacing[1] + scene.thickness[1])
        if not least - LENGTH_TOLERANCE <= left <= most + LENGTH_TOLERANCE:
            violations = [
                f"it leaves {left:.6g} m of the length for {pairs} dominoes, which cover "
                f"{least:.6g} to {most:.6g} m: change its length"
            ]
    if not violations and layout.count > 1:
        wave = simulate(layout, scene.physics, rtol=rtol)
        if wave.hit < layout.count or not np.isfinite(wave.release_velocity[-1]):
            violations = [f"its wave stops: {wave.explanation}; leave out the last dominoes"]
    if violations:
        raise ValueError(f"the layout to start from in environment {env}: {'; '.join(violations)}")
