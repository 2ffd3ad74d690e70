"""Single environments, as batches of one, and DominoChain-v2: one action places one domino."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from domino_env.core.types import Singles
from domino_env.envs import rendering
from domino_env.envs.arguments import SceneLike, WritableSpec
from domino_env.envs.spaces import check_actions
from domino_env.envs.vector import RTOL, WINDOW, DominoChainVector
from domino_env.physics.wave import Wave
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.scene import Scene


class DominoEnv(WritableSpec, gymnasium.Env[Singles, Singles]):
    """Single environment, which steps a vector environment of one.

    Parameters
    ----------
    vector
        Vector environment with one environment.
    render_mode
        None, "rgb_array" or "human".

    Attributes
    ----------
    observation_layout
        Slice of each part of an observation, by name.

    Raises
    ------
    ValueError
        For another render mode.
    ImportError
        For "human" without pygame.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(rendering.MODES),
        "render_fps": rendering.FRAMES_PER_SECOND,
    }

    def __init__(self, vector: DominoChainVector, render_mode: str | None) -> None:
        self.render_mode = render_mode
        self._renderer = rendering.Renderer(render_mode, rendering.MODES)
        modes = list(rendering.CHECKED_MODES)  # make reads those of the class, the checker these
        self.metadata = self.metadata | {"render_modes": modes}  # type: ignore[misc]
        self._vector = vector
        self.longest_episode = vector.longest_episode
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
    def wave(self) -> Wave:
        """Wave in the dominoes placed so far, also after a time limit has ended the episode."""
        return self._vector.wave(0)

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
            "scene" if scenes are sampled; with `info="numbers"` its keys, without results.

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
        return observations[0], {key: values[0] for key, values in infos.items()}

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
            Info of the class after the last step, else empty, or with `info="numbers"` its keys
            without results.

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
        infos = infos or self._vector.unfinished(1)
        info = {key: values[0] for key, values in infos.items()}
        return observations[0], float(rewards[0]), self._over, False, info

    def snapshot(self) -> rendering.Snapshot:
        """Return the chain at its latest hit."""
        return self._vector.snapshot(0)

    def render(self) -> NDArray[np.uint8] | None:
        """Return the chain at its latest hit as an image; None for a window or no mode."""
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
    - A stock: of the pieces that are left in the stock, or in the hand if the scene has one, the
      kind with the largest preference is taken; of equal ones that of the uniform baseline, else
      the thinnest, or from a hand the piece that was drawn first.

    If narrowed bounds exclude the value of the baseline, an entry of 0 is the nearest bound. Scenes
    with a length and also a stock are rejected.

    ## Observation space
    `Box(low, high, (O,), float32)`, finite. h is the height of the first domino, g gravity, v the
    speed of the uniform baseline, or √(g h) if its wave stops, N the number of dominoes, k the
    number placed after the first, W the window, K the number of different thicknesses in the stock,
    F that of the features. `observation_layout` maps each part to its slice:
    `observation[env.unwrapped.observation_layout["gaps"]]`.

    | part        | size | meaning                                                  | range     |
    |-------------|------|----------------------------------------------------------|-----------|
    | front       | 1    | angular velocity of the leading domino, times √(h/g)     | 0, 50     |
    | lead        | 1    | lead over a wave at the speed v, over 10 h               | -100, 100 |
    | speed       | 1    | mean speed over v, minus 1; 0 at first                   | -1, 20    |
    | lateness    | 1    | sign(x) ln(1 + abs(x)) of the delay x of the last hit    | -10, 10   |
    |             |      | from the schedule, in tolerances                         |           |
    | intervals   | W    | next intervals of the schedule: -1 shortest, 1 longest   | -1, 1     |
    | length_left | 1    | remaining length over the length                         | 0, 1      |
    | pitch_left  | 1    | remaining mean pitch: -1 the smallest, 1 the largest     | -1, 1     |
    | gaps        | W    | log of the ratios of the last gaps to the first gap of   | -5, 5     |
    |             |      | the baseline, latest first                               |           |
    | thicknesses | W    | last thicknesses, likewise, without the first domino's   | -5, 5     |
    | growths     | W    | last growths, likewise                                   | -5, 5     |
    | height      | 1    | log of the last height over h, over its maximum, or 0    | 0, 1      |
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
    in the uniform baseline, v = X_end / T_end. If the score S of the layout is more than 0, the
    reward of the last step is 100 gain - Φ_(k-1), so the undiscounted return is 100 times the gain.
    On a uniform baseline that completes, the return is 0 and, without a schedule, every reward is 0
    within the tolerance.

    If S is 0 or less, as the wave stops or violates a limit of the scene, and that of the uniform
    baseline is more than 0, the return is min(Φ_(k-1), 0) + 10 (S - 1), which is at most -10. A
    layout that succeeds with a gain below -10 % may return less.

    - If the scene has a length ℓ, the rest up to the last designed domino n is ℓ - x_k long and
      takes the time (T_n - T_k) (ℓ - x_k) / (ℓ - X_k).
    - If the wave of the uniform baseline stops, T_k = X_k / √(g h).
    - If all pieces of a stock are placed, the rest of the chain has the pieces that remain, and the
      gaps of the baseline.
    - If hits have a schedule ("tempo"), Φ_k = 10 log10(S_k) - 10 log10(S_u) k / (N - 1), where S_k
      is the score if all later hits are as late as the last one, and at least 1e-4, and S_u that
      of the uniform baseline. The unit is the decibel.
    - If pieces are drawn in random order, T_k and v are means over the orders of seeds 0 to 63.
      Rewards and return of the baseline in one order therefore differ from 0.
    - With an objective that does not reward steps, as "magnify", Φ = 0: all rewards but the last
      are 0. If S is 0 or less, the return is 10 (S - 1) - 100, less than that of every success.

    The gain compares the score with that of the uniform baseline:

    | score       | gain                                                                   |
    |-------------|------------------------------------------------------------------------|
    | more than 0 | S / S_u - 1 for the score S of the layout and S_u of the baseline      |
    |             | with a schedule: log10(max(S, 1e-4) / S_u) / 10                        |
    | 0 or less   | S - 1                                                                  |
    |             | with a schedule: S + log10(1e-4 / S_u) / 10                            |

    A wave that stops has a score between -1 and 0 that increases with the distance it reaches (see
    `Scene.score`). The return orders layouts that succeed as `scene.score` does, above 1e-4 with a
    schedule, and does not depend on the size of the dominoes. If the score of the uniform baseline
    is 0 or less, S_u is 1 in this table, for speeds √(g h) and for heights h, the gain is relative
    to that of the baseline, and the return is 100 times the gain for every S.

    On a floor (`floor_friction`), the rewards before the last step are those of the analytic wave.
    On the last step a complete layout is simulated free-standing, and the last reward makes the
    return that of its score and the uniform baseline on this floor. `score` and `gain` in the
    info are those of the free-standing layout, `outcome` and `wave` those of the analytic wave. If
    the analytic wave stops, the episode ends. With forty dominoes (`table`) an episode near the
    uniform baseline takes some 0.2 s of one core instead of 0.4 ms, and one of random actions 3 s
    on average and up to 12 s (12 episodes); layouts that end on the same step of a batch are
    distributed over all threads.

    ## Starting state
    Only the first domino is placed. `reset(options={"layout": layout})` starts from a layout of
    fewer dominoes than the scene has, at the hit of its last domino; the rewards that follow are
    those of a whole episode after the same dominoes. Options of a reset hold for its episode only.

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
    Terminated when the last domino is placed, or when the wave stops. Never truncated without a
    time limit. If the scene
    has a run-out, the last step lets the wave run through its fixed dominoes, to the end of the
    row: scores, X_end and T_end are those of the whole row, and so is `wave` in the info, while
    `layout` has the placed dominoes only.

    ## Info
    Empty except on the last step: `score` (of the layout as placed), `gain` (over the uniform
    baseline, 0.01 is one per cent), `outcome` (an `Outcome`), `layout` (as placed) and `wave` (its
    wave at the environment's tolerance; its `reach` is relative to all N dominoes). Layout and wave
    are computed when they are read. If scenes are sampled, `scene` is in the last info and in that
    of the reset. `score` and `gain` are NumPy scalars.

    Libraries that convert or record infos need the same keys in every step. With `info="numbers"`
    the info of every reset and step has `score`, `gain` and `outcome` as NumPy scalars (the value
    of the `Outcome` as an integer) and nothing else; before the last step they are 0, 0 and -1.

    A time limit (`gymnasium.make(…, max_episode_steps=10)`) truncates an episode without a result.
    Then `env.unwrapped.wave` is the wave in the dominoes placed so far, and its `layout` these.

    ## Version history
    - v2: an action of 0 is the uniform baseline, with a logarithmic scale to the bounds; in v1
      actions were linear between the bounds. With a schedule the gain is a logarithm; in v1 it was
      a ratio, which is nearly constant far from the schedule, and `lateness` was clipped at three
      tolerances. A stock has an entry for each kind of pieces; in v1 the nearest thickness to one
      entry was taken. Rewards take the pieces into account that remain. A wave that stops returns
      -20 to -10, or less after an expected loss [% or dB]; in v1 -200 to -100.
    - v1: rewards are changes of the expected gain. In v0 they were the distance gained on a wave at
      a given speed, in heights. The return of a wave that stops is 100 (score - 1). In v0 it
      was 100 (score / score of the uniform baseline - 1), which depended on the dominoes' size.
    - v0: first version.

    Parameters
    ----------
    scene
        A name, the path of a TOML file, a `Scene`, or a `SceneDistribution`, from which every reset
        samples a scene; or the document of one of these two, as `Scene.document` returns it. `spec`
        has the document of a scene or distribution, so that it can be written as JSON.
    render_mode
        None, "rgb_array" or "human".
    rtol
        Relative error allowed in the arrival times, 1e-3 to 1e-13. The score on the last step is
        `scene.score(scene.simulate(layout, rtol))`, for the uniform baseline that of the baseline;
        `scene.score(layout)` uses 1e-10.
    window
        W, number of gaps, thicknesses, growths, intervals and places that are observed; a number of
        N or more is reduced to N - 1.
    num_scenes
        Number of scenes of a distribution from which each reset samples; None for all of its pool
        from `first_scene` on. A policy can be tested on the other scenes.
    first_scene
        Index of the first of these scenes in the pool.
    hide
        Names from `distribution.features` that are left out of the observation. Other parts may
        still depend on them.
    info
        "all" for the infos described above, "numbers" for the same three numbers in every step.

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

    def __init__(
        self,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        window: int = WINDOW,
        num_scenes: int | None = None,
        first_scene: int = 0,
        hide: Sequence[str] = (),
        info: str = "all",
    ) -> None:
        vector = DominoChainVector(
            1, scene, None, rtol, window, num_scenes=num_scenes, first_scene=first_scene, hide=hide,
            info=info,
        )  # fmt: skip
        super().__init__(vector, render_mode)
