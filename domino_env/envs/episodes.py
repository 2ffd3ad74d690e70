"""Episodes of `DominoChain`: B rows, built and toppled domino by domino."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.core.threads import share_rows
from domino_env.envs.arrays import draw_errors, new_batch
from domino_env.envs.base import Bools, Episodes, Floats, Observations, Start
from domino_env.envs.endings import Endings
from domino_env.envs.observation import observation_space
from domino_env.envs.problems import Generators, Problems, choices
from domino_env.envs.snapshot import Snapshot
from domino_env.physics.layout import Layout
from domino_env.physics.wave import simulate
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.scene import Scene
from domino_env.scenes.specification import LENGTH_TOLERANCE

Rows = NDArray[np.intp]  # their numbers

ALONE = 128  # rows from which on it pays to wake another thread


class ChainEpisodes(Episodes):
    """The arrays of B rows, allocated once, and the two compiled calls that move them.

    Parameters
    ----------
    scene
        What is built, or what it is drawn from at every reset.
    number
        B.
    rtol
        Relative error allowed in the arrival times.
    reference_speed
        Speed that the rewards of single steps count against [m/s]; None for the mean speed of the
        best uniform row.
    window
        Gaps (and thicknesses) observed behind the front.

    Raises
    ------
    ValueError
        For what `Problems` refuses, and a window or speed out of range.
    """

    def __init__(
        self,
        scene: Scene | SceneDistribution,
        number: int,
        rtol: float,
        reference_speed: float | None,
        window: int,
    ) -> None:
        if not (isinstance(window, int | np.integer) and window >= 0):
            raise ValueError(
                f"window = {window!r}: give the number of dominoes to observe, 0 or more"
            )
        self.number, self.rtol = number, float(rtol)
        self._reference: float | None = None  # speed for all rows, where one is given
        self.problems = Problems(scene, number, self.rtol, int(window))
        self.options = ("layout",) if self.problems.distribution is None else ("layout", "scene")
        self._batch = new_batch(self.problems, number, falls=True)
        self._rules, self._states = self._batch.rules, self._batch.episodes
        # there is a scene before any reset
        self._which = np.full(number, self.problems.draw(np.random.default_rng(0)))
        self._enter(np.arange(number))
        if reference_speed is not None:
            self.reference_speed = reference_speed
        self.actions = Box(-1.0, 1.0, (choices(self.problems.like),), np.float32)
        self.observations = observation_space(self._batch, self.problems)
        self._waves = np.full(number, None, object)  # of rows that are over

    def scene(self, row: int) -> Scene:
        """Return what is built in a row."""
        return cast("Scene", self.problems.scenes[self._which[row]])

    @property
    def reference_speed(self) -> float | Floats:
        """Speed that the rewards of single steps count against [m/s], (B,) if rows have their own.

        May be set at any time, for all rows and all episodes to come.
        """
        speeds: Floats = self._rules["reference_speed"]
        return float(speeds[0]) if len(speeds) == 1 else speeds.copy()

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        if not (np.ndim(speed) == 0 and 0.0 < speed < np.inf):
            raise ValueError(
                f"reference_speed = {speed!r} m/s: give one finite number, more than 0; the best "
                f"uniform row runs at {self.problems.speed[self._which[0]]:.6g} m/s"
            )
        self._reference = float(speed)
        self._rules["reference_speed"] = speed

    # beginning ------------------------------------------------------------------------------------

    def reset(
        self,
        chosen: Bools,
        observations: Observations,
        generators: Generators,
        layout: Start = None,
        scene: Sequence[Scene | None] | Scene | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Begin anew in the chosen rows; see `Episodes.reset`."""
        rows, before = np.flatnonzero(chosen), self._which.copy()
        if self.problems.distribution is not None:
            self._choose(rows, generators, self._one_each(scene, Scene, "scenes to build in"))
        layouts = self._one_each(layout, Layout, "layouts to start from") or []
        starts = [(b, row) for b, row in enumerate(layouts) if chosen[b] and row is not None]
        try:
            for b, row in starts:
                self._require_start(row, self.scene(b))
        except ValueError:
            self._which = before
            raise
        if self.problems.distribution is not None:
            self._enter(rows)
        draw_errors(self._batch, rows, self.scene, generators)
        given = np.zeros(self.number, np.int64)
        for b, row in starts:
            given[b] = row.count - 1
            self._batch.spacing[b, : given[b]] = row.spacing
            self._batch.thickness[b, : row.count] = row.thickness
            if self.scene(b).growth is not None:
                self._batch.height[b, : row.count] = row.height
        kernels.reset_rows(0, self.number, self._batch, chosen, given, observations)
        self._waves[chosen] = None
        if self.problems.distribution is None:
            return {}
        return {"scene": objects(self._scenes(rows))}

    def _choose(self, rows: Rows, generators: Generators, given: list[Scene | None] | None) -> None:
        """Draw scenes for rows, or take those that are given."""
        problems = self.problems
        if given is None:
            self._which[rows] = [problems.draw(generators(b)) for b in rows.tolist()]
            return
        fresh = []
        for b in rows.tolist():
            scene = given[b]
            fresh.append(problems.draw(generators(b)) if scene is None else problems.give(b, scene))
        self._which[rows] = fresh

    def _one_each(self, given: Any, kind: type, what: str) -> list[Any] | None:
        """One for each row, where one for all or one for each is given."""
        if given is None:
            return None
        each = [given] * self.number if isinstance(given, kind | str) else list(given)
        if len(each) != self.number:
            raise ValueError(
                f"{len(each)} {what}: give one for all, or one for each of the {self.number} rows"
            )
        return each

    def _enter(self, rows: Rows) -> None:
        """Let rows be built in their scenes from now on."""
        batch, problems, which = self._batch, self.problems, self._which[rows]
        if problems.distribution is None:
            self._rules[0] = problems.rules[0]
            return
        words(self._rules)[rows] = words(problems.rules)[which]
        if self._reference is not None:
            self._rules["reference_speed"][rows] = self._reference
        batch.features[rows] = problems.features[which]
        batch.thickness[rows, 0] = problems.first_thickness[which]
        if len(batch.height) == self.number:  # else all share one
            batch.height[rows] = problems.height[which, None]

    def _scenes(self, rows: Rows) -> list[Scene]:
        """What is built in some rows."""
        scenes = self.problems.scenes
        return [cast("Scene", scenes[i]) for i in self._which[rows].tolist()]

    def _require_start(self, layout: Layout, scene: Scene) -> None:
        broken = replace(scene, count=layout.count, length=None).violations(layout)
        if not broken and layout.count >= scene.count:
            broken = [
                f"it has {layout.count} dominoes: at least one of the scene's {scene.count} must "
                "be left to place"
            ]
        if not broken and scene.length is not None:
            pairs, left = scene.count - layout.count, scene.length - layout.length
            least = pairs * (scene.spacing[0] + scene.thickness[0])
            most = pairs * (scene.spacing[1] + scene.thickness[1])
            if not least - LENGTH_TOLERANCE <= left <= most + LENGTH_TOLERANCE:
                broken = [
                    f"it leaves {left:.6g} m of the length for {pairs} dominoes, which cover "
                    f"{least:.6g} to {most:.6g} m"
                ]
        if not broken and layout.count > 1:
            wave = simulate(layout, scene.physics, rtol=self.rtol)
            if wave.hit < layout.count or not np.isfinite(wave.release_velocity[-1]):
                broken = [f"its wave dies: {wave.explanation}"]
        if broken:
            raise ValueError(f"the layout to start from: {'; '.join(broken)}")

    # stepping -------------------------------------------------------------------------------------

    def step(self, actions: Floats) -> tuple[Observations, Floats, Bools, dict[str, NDArray[Any]]]:
        """Place a domino in every row that runs; see `Episodes.step`."""
        observations = np.empty((self.number, *self.observations.shape), np.float32)
        rewards = np.empty(self.number)
        ended = np.empty(self.number, np.bool_)
        share_rows(
            kernels.step_rows, self.number, ALONE,
            self._batch, actions, observations, rewards, ended,
        )  # fmt: skip
        infos: dict[str, NDArray[Any]] = {}
        if np.count_nonzero(ended):
            rows = np.flatnonzero(ended)
            rewards[rows], infos = self._end(rows)
        return observations, rewards, ended, infos

    def _end(self, rows: Rows) -> tuple[Floats, dict[str, NDArray[Any]]]:
        """The last rewards and the infos of the rows (E,) whose episodes have just ended.

        Where the score is more than a speed, or a wave's own estimate exceeds the tolerance, the
        row is simulated as a whole: one that is built step by step cannot go back.
        """
        batch, states = self._batch, self._states[rows]
        endings = Endings(
            scenes=self._scenes(rows),
            baseline=self.problems.score[self._which[rows]],
            rtol=self.rtol,
            spacing=batch.spacing[rows],
            thickness=batch.thickness[rows],
            height=batch.height[rows] if len(batch.height) == self.number else batch.height,
            placed=states["placed"].tolist(),
        )
        endings.outcome, endings.reach = states["outcome"], states["reach"]
        endings.score = states["score"]
        if states["unsure"].any():
            endings.judge(np.flatnonzero(states["unsure"]).tolist())
            self._states["outcome"][rows] = endings.outcome
        infos = endings.infos()
        if self.problems.distribution is not None:
            infos["scene"] = objects(endings.scenes)
        self._waves[rows] = infos["wave"]
        return endings.returns - states["paid"], infos

    # looking --------------------------------------------------------------------------------------

    def snapshot(self, row: int) -> Snapshot:
        """Show a row as it stands and falls."""
        episode, state, wave = self._states[row], self._batch.states[row], self._waves[row]
        placed = int(episode.placed)
        dead = wave is not None and episode.outcome != kernels.PROPAGATED
        return Snapshot(
            spacing=self._batch.spacing[row, :placed].copy(),
            thickness=self._batch.thickness[row, : placed + 1].copy(),
            height=self._batch.height[row % len(self._batch.height), : placed + 1].copy(),
            hit=wave.hit if wave is not None else placed + 1,
            time=float(state.time),
            speed=0.0 if dead else float(np.sqrt(state.u)),
            uniform_speed=float(self.problems.speed[self._which[row]]),
            wave=wave,
        )

    def bounds_ahead(self, row: int) -> dict[str, tuple[float, float]]:
        """Return what the next action of a row ranges over, "spacing" and "thickness" [m].

        Where a length is to be met, the gap's bounds depend on the thickness that the same action
        chooses: they are given for its middle.
        """
        episode, rules = self._states[row], self._rules[row % len(self._rules)]
        pairs, way = int(rules.count) - 1 - int(episode.placed), episode.way
        low, high = kernels.thickness_range(rules, pairs, way)
        gaps = kernels.gap_range(rules, pairs, way, 0.5 * (low + high))
        return {"spacing": (float(gaps[0]), float(gaps[1])), "thickness": (float(low), float(high))}

    def actions_towards(self, layout: Layout | Sequence[Layout]) -> Floats:
        """Return actions (B, A) that place the next domino of every row as in its layout.

        Where the rules no longer leave its place, the nearest they do; 0 for rows that are over.
        """
        layouts = self._one_each(layout, Layout, "layouts to build") or []
        actions = np.zeros((self.number, *self.actions.shape))
        for b in np.flatnonzero(self._states["phase"] == kernels.RUNNING):
            actions[b] = self._action_towards(int(b), layouts[b])
        return actions

    def _action_towards(self, b: int, layout: Layout) -> list[float]:
        scene, rules = self.scene(b), self._rules[b % len(self._rules)]
        n, way = int(self._states[b].placed), self._states[b].way
        left, tall = scene.count - 1 - n, layout.height
        gap, thick = layout.spacing[n], layout.thickness[n + 1]
        if scene.in_heights:
            gap, thick = gap / min(tall[n], tall[n + 1]), thick / tall[n + 1]
        action = []
        bounds = kernels.thickness_range(rules, left, way)
        placed = float(np.clip(thick, *bounds))
        if scene.free_spacing:
            low, high = kernels.gap_range(rules, left, way, placed)
            if rules.largest_change > 0.0 and n > 0:
                before, change = self._batch.spacing[b, n - 1], rules.largest_change
                low, high = max(low, before - change), min(high, before + change)
            action.append(_action_for(gap, low, high))
        if scene.free_thickness:
            action.append(_action_for(thick, *bounds))
        if scene.growth is not None and scene.free_height:
            action.append(_action_for(tall[n + 1] / tall[n], *scene.growth))
        return action


def words(records: NDArray[np.record]) -> NDArray[np.uint64]:
    """Show records (S,) as whole numbers (S, W), which are copied three times as fast."""
    return records.view(np.uint64).reshape(len(records), -1)


def objects(values: Iterable[Any]) -> NDArray[Any]:
    """Make an array of objects of whatever kind."""
    listed = list(values)
    found = np.empty(len(listed), object)
    found[:] = listed
    return found


def _action_for(value: float, low: float, high: float) -> float:
    """The action in [-1, 1] that stands for a value; where nothing can be chosen, 0."""
    if not low < high:
        return 0.0
    return float(np.clip(2.0 * (value - low) / (high - low) - 1.0, -1.0, 1.0))
