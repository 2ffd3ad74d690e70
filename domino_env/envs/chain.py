"""Environments in which one action places one domino: DominoChain-v2, single and vector."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, cast

import numpy as np
from gymnasium.vector import AutoresetMode

from domino_env.core.checks import numbers, require
from domino_env.core.files import as_text
from domino_env.core.threads import share_evenly
from domino_env.core.types import Bools, Floats, Singles
from domino_env.envs.episodes import object_array
from domino_env.envs.sources import Generators, SceneLike, SceneSource
from domino_env.envs.spaces import action_entries, check_actions
from domino_env.envs.vector import RTOL, WINDOW, DominoEnv, DominoVectorEnv, Infos
from domino_env.kernels.step import environment as kernels
from domino_env.physics.layout import Layout
from domino_env.physics.wave import simulate
from domino_env.scenes.design_problem import LENGTH_TOLERANCE
from domino_env.scenes.scene import Scene

MIN_PER_THREAD = 128  # environments; their steps take at least ten times as long as waking a thread


class DominoChain(DominoEnv):
    """A chain of dominoes, placed one by one while the wave runs through it.

    ## Description
    A scene fixes the number of dominoes in the chain and what may be chosen: the gaps between
    them, their thicknesses, their growth in height, or several of these. The scene also gives the
    first domino, which is pushed at time 0. Each step places the next domino and simulates the fall
    of the leading domino until it hits this domino. Dominoes placed later do not change earlier
    motion, so the environment is an exact Markov decision process. The layout is simulated to the
    given tolerance, and a step takes microseconds.

    ## Action space
    `Box(-1, 1, (A,), float32)`, with the entries of this table that the scene leaves free, in this
    order; other actions are clipped.

    | entry       | meaning                                                | unit          |
    |-------------|--------------------------------------------------------|---------------|
    | gap         | free gap in front of the leading domino                | m, or heights |
    | thickness   | thickness of the domino that is placed, without a stock| m, or heights |
    | preferences | one for each kind of pieces in a stock, thin to thick  | 1             |
    | growth      | its height over that of the previous domino            | 1             |

    An entry of 0 is the value of the uniform baseline, -1 the smallest value and 1 the largest. In
    between, the logarithm of the ratio of the value x to that of the baseline u is a cubic of the
    entry e. From 0 to 1, and from 0 to -1, it is

        ln(x / u) = e (1 + max(l - 1, 0) e²), but at most l = ln(largest / u),
        ln(u / x) = -e (1 + max(l - 1, 0) e²), but at most l = ln(u / smallest).

    Near 0, a change of δ multiplies the value by about exp(δ). Without placement noise, actions of
    0 build the uniform baseline.

    If the scene has `in_heights`, a gap is in heights of the shorter of the two dominoes at it, a
    thickness in heights of the domino itself.

    The scene's rules narrow the bounds, so every layout that can be built satisfies them.

    - A total length: with a length R left and m dominoes to place after this one, the pitch (gap
      plus thickness) lies between R - m (largest gap + largest thickness) and R - m (smallest gap +
      smallest thickness). The thickness is bounded so that a gap exists for such a pitch, and the
      gap is bounded for the chosen thickness; the last pitch is the remaining length.
      `bounds_ahead()` returns these bounds.
    - A largest change: the gap differs from the previous gap by at most this value.
    - Lists, steps: the nearest allowed value is taken.
    - A stock: of the pieces that are left in the stock, or in the hand if the scene has one, the
      kind with the largest preference is taken; of equal ones that of the uniform baseline, else
      the thinnest, or from a hand the piece that was drawn first.

    If narrowed bounds exclude the value of the baseline, an entry of 0 is the nearest bound. Scenes
    with a length and also lists, a stock or a largest change are rejected.

    ## Observation space
    `Box(low, high, (O,), float32)`, finite. h is the height of the first domino, g gravity, N the
    number of dominoes, k the number placed after the first, W the window, K the number of different
    thicknesses in the stock, F that of the features. `observation_layout` maps each part to its
    slice: `observation[env.unwrapped.observation_layout["gaps"]]`.

    | part        | size | meaning                                                  | range     |
    |-------------|------|----------------------------------------------------------|-----------|
    | front       | 1    | angular velocity of the leading domino, times √(h/g)     | 0, 50     |
    | lead        | 1    | lead over a wave at the reference speed, over 10 h       | -100, 100 |
    | speed       | 1    | mean speed over the reference speed, minus 1; 0 at first | -1, 20    |
    | lateness    | 1    | sign(x) ln(1 + abs(x)) of the delay x of the last hit    | -10, 10   |
    |             |      | from the schedule, in tolerances                         |           |
    | intervals   | W    | next intervals of the schedule: -1 shortest, 1 longest   | -1, 1     |
    | length_left | 1    | remaining length over the length                         | 0, 1      |
    | pitch_left  | 1    | remaining mean pitch: -1 the smallest, 1 the largest     | -1, 1     |
    | gaps        | W    | log of the ratios of the last gaps to the first gap of   | -5, 5     |
    |             |      | the baseline, latest first                               |           |
    | thicknesses | W    | last thicknesses, likewise, without the first domino's   | -5, 5     |
    | growths     | W    | last growths, likewise                                   | -5, 5     |
    | height      | 1    | log of the last height over h, over its maximum          | 0, 1      |
    | hand        | K    | pieces of each thickness in the hand, thin to thick,     | 0, 1      |
    |             |      | over the size of the hand                                |           |
    | stock       | K    | fraction of each thickness left in the box, thin to      | 0, 1      |
    |             |      | thick                                                    |           |
    | placed      | 1    | k / (N - 1)                                              | 0, 1      |
    | near_start  | 4    | exp(-k / c) for c = 1, 2, 4, 8                           | 0, 1      |
    | near_end    | 4    | exp(-(N - 1 - k) / c) for the same c                     | 0, 1      |
    | features    | F    | numbers of the sampled scene: -1 smallest, 1 largest     | -3, 3     |
    | slopes      | W    | downhill slopes at the next W places, over the smallest  | -1, 1     |
    |             |      | slope that tips the thinnest domino                      |           |
    | rises       | W    | heights of these places over the last pivot, over h      | -50, 50   |

    An observation has only the parts that can vary: lateness and intervals if hits have a schedule
    ("tempo"), length_left and pitch_left if the scene has a length, gaps and thicknesses if they
    are free, growths and height if heights grow, stock if the scene has one, hand if its pieces are
    drawn in random order, features if scenes are sampled, slopes and rises on uneven ground.
    Features are in the order of `distribution.features` and exceed ±1 only in a given scene outside
    the ranges. `front` is 0 after the wave has stopped. Entries of gaps, thicknesses and growths
    are 0 where no domino is placed yet. The next places lie ahead of the last pivot along x; their
    distance is the middle of the bounds of the gap plus that of the thickness.

    ## Rewards
    The reward of a step is the change of the expected gain Φ [%]. With k dominoes placed, Φ_k is
    the gain if the rest of the chain were that of the uniform baseline:

        Φ_k = 100 ((x_k + X_end - X_k) / (t_k + T_end - T_k) / v - 1),    Φ_0 = 0

    x_k and t_k are the distance of domino k from the first and its arrival time, X_k and T_k those
    in the uniform baseline, v = X_end / T_end. The reward of the last step is 100 gain - Φ_(k-1),
    so the undiscounted return is 100 times the gain. On a uniform baseline that completes, the
    return is 0 and, without a schedule, every reward is 0 within the tolerance.

    - If the scene has a length ℓ, the rest is ℓ - x_k long and takes the time
      (T_end - T_k) (ℓ - x_k) / (ℓ - X_k).
    - If the wave of the uniform baseline stops, T_k = X_k / √(g h).
    - If all pieces of a stock are placed, the rest of the chain has the pieces that remain, and the
      gaps of the baseline.
    - If hits have a schedule ("tempo"), Φ_k = 10 log10(S_k) - 10 log10(S_u) k / (N - 1), where S_k
      is the score if all later hits are as late as the last one, and at least 1e-4, and S_u that
      of the uniform baseline. The unit is the decibel.
    - If pieces are drawn in random order, T_k and v are means over the orders of seeds 0 to 63.
      Rewards and return of the baseline in one order therefore differ from 0.
    - With the other objectives ("toppled", "magnify"), Φ = 0: all rewards but the last are 0.

    The gain compares the score with that of the uniform baseline:

    | score       | gain                                                                   |
    |-------------|------------------------------------------------------------------------|
    | more than 0 | S / S_u - 1 for the score S of the layout and S_u of the baseline      |
    |             | with a schedule: log10(max(S, 1e-4) / S_u) / 10                        |
    | 0 or less   | S - 1: the wave stops or violates a limit of the scene                 |
    |             | with a schedule: S + log10(1e-4 / S_u) / 10                            |

    A wave that stops has a score between -1 and 0 that increases with the distance it reaches (see
    `Scene.score`), except with "toppled", where it may score more. Its return is below that of
    every layout that completes; without a schedule it is between -200 and -100. The return orders
    layouts as `scene.score` does, above 1e-4 with a schedule, and does not depend on the size of
    the dominoes. If the score of the uniform baseline is 0 or less, S_u is 1 in this table, for
    speeds √(g h) and for heights h, and the gain is relative to that of the baseline.

    On a floor (`floor_friction`), the rewards before the last step are those of the analytic wave.
    On the last step a complete layout is simulated free-standing, and the last reward makes the
    return 100 times its gain over the uniform baseline on this floor. `score` and `gain` in the
    info are those of the free-standing layout, `outcome` and `wave` those of the analytic wave. If
    the analytic wave stops, the episode ends. With forty dominoes (`table`) an episode takes some
    130 ms of one core instead of 0.4 ms; layouts that end on the same step of a batch are
    distributed over all threads.

    ## Starting state
    Only the first domino is placed. `reset(options={"layout": layout})` starts from a layout of
    fewer dominoes than the scene has, at the hit of its last domino; the rewards that follow are
    those of a whole episode after the same dominoes.

    A fixed scene is random only in two cases. With placement noise (`placement`), every
    reset samples normal errors with `np_random`. One of them is added to each gap that an action
    chooses; the result is at least 0.2 mm. The next observation has the resulting gap, and the
    score is that of the resulting layout. If the scene scores draws of the noise, S_u is the mean
    score of the baseline over them; else the baseline has no such errors.

    If the pieces of a stock are drawn (`[stock] hand`, as in "draw"), every reset permutes the
    pieces in the box with `np_random`, without the dominoes of a given layout. The hand holds the
    first of them; each step places one piece of the hand and draws the next. The uniform baseline
    places the pieces in the order in which they are drawn, with the best equal gap; its score is
    the mean over the orders of seeds 0 to 63.

    If `scene` is a scene distribution, such as "varied", every reset samples a scene with
    `np_random`, and `reset(options={"scene": scene})` chooses one. The chain then has `scene.count`
    dominoes, and this page describes the sampled scene.

    ## Episode end
    Terminated when the last domino is placed, or when the wave stops. Never truncated. If the scene
    has a run-out, the last step lets the wave run through its fixed dominoes, to the end of the
    row: scores, X_end and T_end are those of the whole row, and so is `wave` in the info, while
    `layout` has the placed dominoes only.

    ## Info
    Empty except on the last step: `score` (of the layout as placed), `gain` (over the uniform
    baseline, 0.01 is one per cent), `outcome` (an `Outcome`), `layout` (as placed) and `wave` (its
    wave at the environment's tolerance; its `reach` is relative to all N dominoes). Layout and wave
    are computed when they are read. If scenes are sampled, `scene` is in the last info and in that
    of the reset.

    ## Version history
    - v2: an action of 0 is the uniform baseline, with a logarithmic scale to the bounds; in v1
      actions were linear between the bounds. With a schedule the gain is a logarithm; in v1 it was
      a ratio, which is nearly constant far from the schedule, and `lateness` was clipped at three
      tolerances. A stock has an entry for each kind of pieces; in v1 the nearest thickness to one
      entry was taken. Rewards take the pieces into account that remain.
    - v1: rewards are changes of the expected gain. In v0 they were the distance gained on a wave at
      the reference speed, in heights. The return of a wave that stops is 100 (score - 1). In v0 it
      was 100 (score / score of the uniform baseline - 1), which depended on the dominoes' size.
    - v0: first version.

    Parameters
    ----------
    scene
        A name, the path of a TOML file, a `Scene`, or a `SceneDistribution`, from which every reset
        samples a scene.
    render_mode
        None, "rgb_array", "human" or "ansi".
    rtol
        Relative error allowed in the arrival times, 1e-3 to 1e-13. The score on the last step is
        `scene.score(scene.simulate(layout, rtol))`, for the uniform baseline that of the baseline;
        `scene.score(layout)` uses 1e-10.
    reference_speed
        Speed to which `lead` and `speed` of the observation refer [m/s]; None for that of the
        uniform baseline, or √(g h) if its wave stops. May be set at any time:
        `env.unwrapped.reference_speed = 0.83`.
    window
        W, number of gaps, thicknesses, growths, intervals and places that are observed; a number of
        N or more is reduced to N - 1.
    num_scenes
        Number of scenes of a distribution from which each reset samples; None for all of its pool
        of 4096 from `first_scene` on. A policy can be tested on the other scenes.
    first_scene
        Index of the first of these scenes in the pool.
    hide
        Names from `distribution.features` that are left out of the observation. Other parts may
        still depend on them.

    Raises
    ------
    ValueError
        For a scene that leaves nothing free or has rules that need the whole layout, and for
        arguments out of range.

    Examples
    --------
    >>> import gymnasium, domino_env
    >>> env = gymnasium.make("DominoChain-v2", scene="sprint")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """

    _vector: DominoChainVector

    def __init__(
        self,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        reference_speed: float | None = None,
        window: int = WINDOW,
        num_scenes: int | None = None,
        first_scene: int = 0,
        hide: Sequence[str] = (),
    ) -> None:
        vector = DominoChainVector(
            1, scene, None, rtol, reference_speed, window,
            num_scenes=num_scenes, first_scene=first_scene, hide=hide,
        )  # fmt: skip
        super().__init__(vector, render_mode)

    @property
    def reference_speed(self) -> float:
        """Speed to which `lead` and `speed` of observations refer [m/s]; it may be set."""
        return float(np.ravel(self._vector.reference_speed)[0])

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        self._vector.reference_speed = speed

    def bounds_ahead(self) -> dict[str, tuple[float, float]]:
        """Return the bounds of the next gap and of the next thickness.

        Returns
        -------
        dict
            (low, high) of "spacing" and "thickness" [m, or heights if the scene has `in_heights`].
            In a scene with a length the bounds of the gap depend on the thickness that the same
            action chooses; these are for the middle of the range of thickness.
        """
        return self._vector.bounds_ahead(0)


class DominoChainVector(DominoVectorEnv):
    """Vector environment of `DominoChain`, bitwise equal to single environments.

    Actions (B, A), observations (B, O) and rewards (B,) float64 are as in Gymnasium's vector
    environments; infos hold an array of length B for each key of the single environment's info, and
    under "_key" the mask of entries that are set. `numba.set_num_threads` limits the threads.

    The options of a reset are "reset_mask", a (B,) mask of the environments to reset, and "layout",
    the first dominoes: one `Layout` for all environments, or a list with a `Layout` or None for
    each. If scenes are sampled, "scene" chooses them: one for all environments, or a list with a
    `Scene` or None for each.

    Parameters
    ----------
    num_envs
        B, the number of environments.
    scene
        See `DominoChain`.
    render_mode
        None, "rgb_array" or "ansi".
    rtol
        See `DominoChain`.
    reference_speed
        See `DominoChain`; may be set at any time.
    window
        See `DominoChain`.
    autoreset_mode
        Step on which an environment resets after the last step of an episode:

        - NEXT_STEP: the following step, which ignores the action and has reward 0.
        - SAME_STEP: the last step itself; the last observation and info are in infos["final_obs"]
          and infos["final_info"].
        - DISABLED: none; call `reset(options={"reset_mask": …})` before the next step.
    num_scenes, first_scene, hide
        See `DominoChain`.

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

    options: ClassVar[tuple[str, ...]] = ("layout",)

    def __init__(
        self,
        num_envs: int = 1,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        reference_speed: float | None = None,
        window: int = WINDOW,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        num_scenes: int | None = None,
        first_scene: int = 0,
        hide: Sequence[str] = (),
    ) -> None:
        source = SceneSource(scene, num_envs, rtol, window, num_scenes, first_scene, hide)
        super().__init__(num_envs, source, render_mode, autoreset_mode)
        self._nothing: list[Any] = [None] * self.num_envs
        if reference_speed is not None:
            self.reference_speed = reference_speed
        self._set_spaces(action_entries(self.source.first), self.observation_layout.space)

    @property
    def reference_speed(self) -> float | Floats:
        """Speed to which `lead` and `speed` of observations refer [m/s].

        Its shape is (B,) if scenes are sampled. A number may be set, for all environments.
        """
        speeds: Floats = self.source.rules["reference_speed"]
        return float(speeds[0]) if self.distribution is None else speeds[self._batch.scene]

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        baseline = self.source.speed[self._batch.scene[0]]
        hint = f"the mean speed of the uniform baseline is {baseline:.6g} m/s"
        require("reference_speed", speed, unit="m/s", above=0.0, hint=hint)
        self.source.reference_speed = float(speed)
        self.source.rules["reference_speed"] = speed

    def begin(
        self, mask: Bools, observations: Singles, generators: Generators, **options: Any
    ) -> Infos:
        """Begin episodes in some environments; see `DominoVectorEnv.begin`."""
        envs, indices, source = np.flatnonzero(mask), self._batch.scene.copy(), self.source
        layouts = self._value_per_env("layout", options.get("layout"), Layout)
        if self.distribution is not None:
            scenes = self._value_per_env("scene", options.get("scene"), Scene)
            indices[envs] = [
                source.add(b, scenes[b], indices[b]) if scenes[b] else source.sample(generators(b))
                for b in envs.tolist()
            ]
        starts = {b: layouts[b] for b in envs.tolist() if layouts[b] is not None}
        for b, start in starts.items():
            _check_start(start, cast("Scene", source.scenes[indices[b]]), source.rtol, b)
        self._batch.scene[:] = indices  # from here on nothing is rejected
        source.begin_layouts(self._batch, envs)
        self._randomise(envs, generators, starts)
        batch, placed = self._batch, np.zeros(self.num_envs, np.int64)
        for b, start in starts.items():
            placed[b] = start.count - 1
            batch.spacing[b, : placed[b]] = start.spacing
            batch.thickness[b, : start.count] = start.thickness
            if self._scene(b).growth is not None:
                batch.height[b, : start.count] = start.height
        kernels.reset_batch(0, self.num_envs, batch, mask, placed, observations)
        self._waves[mask] = None
        if self.distribution is None:
            return {}
        return {"scene": object_array(self._scene(b) for b in envs.tolist())}

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

    def advance(self, actions: Floats) -> tuple[Singles, Floats, Bools, Infos]:
        """Place a domino in every running environment; see `DominoVectorEnv.advance`."""
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

    def bounds_ahead(self, env: int) -> dict[str, tuple[float, float]]:
        """Return the bounds of the next gap and of the next thickness in one environment.

        Parameters
        ----------
        env
            Index of the environment.

        Returns
        -------
        dict
            Bounds, see `DominoChain.bounds_ahead`.

        Raises
        ------
        ValueError
            For an index that no environment has.
        """
        require("env", env, 0, self.num_envs - 1, whole=True)
        low, high, thinnest, thickest = kernels.next_bounds(self._batch, env)
        return {"spacing": (low, high), "thickness": (thinnest, thickest)}

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
        actions = np.zeros(self.action_space.shape or ())
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
            that side of 0 are those at 0. The choice of the nearest value of a list counts as the
            identity, and preferences have derivative 0.
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
        longest = int(self.source.rules["count"][self._batch.scene].max())
        return self.num_envs, longest - 1, *(self.single_action_space.shape or ())


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
