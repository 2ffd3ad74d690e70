"""DominoChain-v0: a row of dominoes designed one domino at a time, alone or many at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import cast

from gymnasium.vector import AutoresetMode

from domino_env.envs.base import RTOL, WINDOW, Floats, RowEnv, loaded
from domino_env.envs.episodes import ChainEpisodes
from domino_env.envs.vector import RowVectorEnv
from domino_env.physics.layout import Layout
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.scene import Scene


class DominoChain(RowEnv):
    """A row of dominoes, placed one by one while the wave runs through them.

    ## Description
    A scene says how many dominoes stand in a row and what may be chosen: the gaps between them,
    their thickness, or both. The first domino is the scene's and has been pushed. Each step
    places the next domino and lets the front of the wave fall onto it. What is placed later never
    changes what has fallen before, so this is an exact Markov decision process: an episode's row
    is simulated to the tolerance asked for, and a step costs microseconds.

    ## Action space
    `Box(-1, 1, (A,), float32)`: of these entries, in this order, those that the scene leaves free.
    -1 stands for the least, 1 for the largest value; beyond them the value is cut off.

    | entry     | meaning                                     | unit                     |
    |-----------|---------------------------------------------|--------------------------|
    | gap       | free gap in front of the domino that leads  | m, or heights (scene)    |
    | thickness | thickness of the domino that is placed      | m, or heights (scene)    |
    | growth    | its height over that of the one before      | 1                        |

    The bounds narrow to what the scene's rules leave; no row that breaks them can be built.

    - A total length: with R left of it and m dominoes to place after this one, the pitch (gap and
      thickness) lies between R - m (largest gap + largest thickness) and R - m (least gap + least
      thickness). The thickness ranges over what leaves some gap for such a pitch, the gap over
      what fits the thickness chosen; the last pitch is what is left. `bounds_ahead()` tells.
    - A largest change: the gap stays that close to the one before.
    - Lists, steps: the nearest value that is allowed. A stock: the nearest thickness that is left
      in the box.

    A length together with lists, a stock or a largest change is refused.

    ## Observation space
    `Box(low, high, (O,), float32)`, finite. h is the height of the first domino, g gravity, N the
    number of dominoes, k how many are placed after the first. Entries marked * are there only
    where the scene asks for a length, + where rows grow, # where there is a stock, ^ where a scene
    is drawn at every reset: in the order of `distribution.features`, beyond ±1 only for scenes that
    are given from beyond the ranges. Windows only of what the scene leaves free.

    | entries | meaning                                                             | range     |
    |---------|---------------------------------------------------------------------|-----------|
    | 1       | angular velocity of the front [rad/s], times √(h/g); 0 if it died   | 0, 50     |
    | 1       | lead over the reference speed, in 10 h                              | -100, 100 |
    | 1       | mean speed so far over the reference speed, less 1; 0 at the start  | -1, 20    |
    | 1 *     | length left, part of the whole                                      | 0, 1      |
    | 1 *     | mean pitch left: -1 the least, 1 the largest                        | -1, 1     |
    | W       | last W gaps, the latest first: -1 least, 1 largest, 0 not there yet | -1, 1     |
    | W       | last W thicknesses, likewise (the first domino's is not among them) | -1, 1     |
    | W +     | last W growths, likewise                                            | -1, 1     |
    | 1 +     | log of the height over the first's, over its largest possible value | 0, 1      |
    | K #     | part of each kind that is left in the box, thin to thick            | 0, 1      |
    | 1       | k / (N - 1)                                                         | 0, 1      |
    | 4       | exp(-k / c) for c = 1, 2, 4, 8: closeness to the start              | 0, 1      |
    | 4       | exp(-(N - 1 - k) / c) for the same c: closeness to the end          | 0, 1      |
    | F ^     | numbers of the scene that was drawn: -1 least, 1 largest            | -3, 3     |
    | W ~     | slopes of the ground at the next W places, downhill, over the least | -1, 1     |
    |         | that tips the thinnest domino                                       |           |
    | W ~     | its rise there over the last pivot, in heights h                    | -50, 50   |

    Entries marked ~ are there only where the ground is not flat. The next places lie ahead of the
    last pivot, one mean pitch apart along x: the middles of the bounds of gap and thickness.

    ## Rewards
    Each step but the last pays (pitch - reference speed × time of the fall) / h: the lead gained
    over a wave at the reference speed, by default that of the best uniform row, in domino heights.
    The last step pays what makes the undiscounted return 100 (score / score of the best uniform
    row - 1), whatever the reference speed. So the return orders layouts as `scene.score` does.
    A wave that dies scores between -1 and 0, higher the further it came (see `Scene.score`): its
    return is below -100, and below that of every row that topples. (Where even the best uniform
    row scores 0 or less, the return is 100 (score - its score) / |its score|.)  Where the objective
    is no speed ("tempo", "toppled", "magnify"), only the last step pays.

    On a floor (`floor_friction`) steps are paid by the analytic wave all the same, and the last
    one settles: a row that is whole is toppled standing, and the return is 100 (its score / that of
    the uniform row best on this floor - 1), negative where it does not topple. `score` and `gain`
    in the info are of the row as it stands, `outcome` and `wave` of the analytic wave, whose death
    ends an episode here too. It costs a standing row an episode: with forty dominoes (`table`) an
    episode takes some 130 ms of one core in place of 0.4; the rows that end together in the vector
    environment are shared among all threads.

    ## Starting state
    The first domino alone. `reset(options={"layout": layout})` starts from a layout of fewer
    dominoes, which stand and have fallen; what they have gained counts as paid, so that
    the rewards to come are those of a whole episode.

    A fixed scene is not random at all, unless its hand is unsteady (`placement_deviation`): then
    every reset draws normal errors by `np_random`, and the gap that an action stands for comes out
    wrong by the next of them, but never less than 0.2 mm. The observation that follows shows where
    the domino stands (gaps beyond the scene's bounds at their ends), and the row is scored as it
    stands; the best uniform row remains the one that a steady hand would build.

    Otherwise the seed changes nothing. Where `scene` is a distribution of
    scenes, such as "varied", every reset draws one by `np_random`, and
    `reset(options={"scene": scene})` chooses one; then the row is `scene.count` dominoes long, and
    whatever is said here of the scene is of the one that was drawn.

    ## Episode end
    Terminated when the last domino is placed, or when the wave dies. Never truncated.

    ## Info
    Empty but on the last step: `score` (that of `wave`), `gain` (over the best uniform row, 0.01 is
    one per cent), `outcome` (an `Outcome`), `layout` (what was placed) and `wave` (its wave at the
    environment's tolerance; its `reach` counts against all N dominoes). Layout and wave are worked
    out when they are looked at. Where a scene is drawn, `scene` is told then and after the reset.

    ## Version history
    - v0: first version.

    Parameters
    ----------
    scene
        A name, the path of a TOML file, a `Scene`, or a `SceneDistribution`, from which one is
        drawn at every reset.
    render_mode
        None, "rgb_array", "human" or "ansi".
    rtol
        Relative error allowed in the arrival times, 1e-3 to 1e-13. The score on the last step is
        that of `scene.simulate(layout, rtol)`, which `scene.score` computes at 1e-10.
    reference_speed
        Speed that the rewards of single steps count against [m/s]; None for the best uniform
        row's. May be set at any time: `env.unwrapped.reference_speed = 0.83`.
    window
        W, how many gaps and thicknesses are observed; at most N - 1.
    """

    _episodes: ChainEpisodes

    def __init__(
        self,
        scene: str | Path | Scene | SceneDistribution = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        reference_speed: float | None = None,
        window: int = WINDOW,
    ) -> None:
        super().__init__(render_mode)
        self._use(ChainEpisodes(loaded(scene), 1, rtol, reference_speed, window))

    @property
    def reference_speed(self) -> float:
        """Speed that the rewards of single steps count against [m/s]; may be set at any time."""
        return cast("float", self._episodes.reference_speed)

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        self._episodes.reference_speed = speed

    def bounds_ahead(self) -> dict[str, tuple[float, float]]:
        """Return what the next action ranges over: {"spacing": (low, high), "thickness": …} [m].

        Where a length is to be met, the gap's bounds depend on the thickness that the same action
        chooses: they are given for the middle of its range.
        """
        return self._episodes.bounds_ahead(0)


class DominoChainVector(RowVectorEnv):
    """`DominoChain` times num_envs, bit for bit, with all rows moved by one compiled call a step.

    Actions (B, A), observations (B, O), rewards (B,) float64, as Gymnasium's vector environments
    have them; infos hold an array of length B for each key of the single environment's info, and
    under "_key" which entries are set. The number of threads is Numba's (`numba.set_num_threads`).

    The options of a reset are "reset_mask", (B,) which rows begin anew, and "layout", the first
    dominoes of the rows: a Layout that all of them start from, or one (or None) for each. Where
    scenes are drawn, "scene" chooses: one for all rows, or one (or None) for each.

    Parameters
    ----------
    num_envs
        B, the number of rows.
    scene
        As of `DominoChain`.
    render_mode
        None, "rgb_array" or "ansi".
    rtol
        As of `DominoChain`.
    reference_speed
        As of `DominoChain`; may be set at any time.
    window
        As of `DominoChain`.
    autoreset_mode
        When the episode after an ended one begins:

        - NEXT_STEP: with the step after the last, which takes no notice of the action and pays 0.
        - SAME_STEP: with the last step itself; the last observation and info are in
          infos["final_obs"] and infos["final_info"].
        - DISABLED: with `reset(options={"reset_mask": …})`, before the next step.
    """

    _episodes: ChainEpisodes

    def __init__(
        self,
        num_envs: int = 1,
        scene: str | Path | Scene | SceneDistribution = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        reference_speed: float | None = None,
        window: int = WINDOW,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        super().__init__(num_envs, render_mode, autoreset_mode)
        self._use(ChainEpisodes(loaded(scene), self.num_envs, rtol, reference_speed, window))

    @property
    def reference_speed(self) -> float | Floats:
        """Speed that the rewards of single steps count against [m/s]; may be set at any time.

        (B,) where each row has a scene of its own; what is set is that of all rows.
        """
        return self._episodes.reference_speed

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        self._episodes.reference_speed = speed

    def bounds_ahead(self, row: int) -> dict[str, tuple[float, float]]:
        """Return what the next action of a row ranges over; see `DominoChain.bounds_ahead`."""
        return self._episodes.bounds_ahead(row)

    def actions_towards(self, layout: Layout | Sequence[Layout]) -> Floats:
        """Return actions (B, A) that place the next domino of every row as in its layout.

        Where the rules no longer leave its place, the nearest they do; 0 for rows that are over.
        """
        return self._episodes.actions_towards(layout)
