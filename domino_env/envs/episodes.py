"""Rows: B rows of one scene, built and toppled domino by domino; the environments stand on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.chain.layout import Layout
from domino_env.chain.wave import LOOSEST, TIGHTEST, Outcome, simulate
from domino_env.envs.endings import Endings
from domino_env.envs.snapshot import Moment
from domino_env.scenes.files.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.scenes.specification import LENGTH_TOLERANCE
from domino_env.support.threads import share_rows

Floats = NDArray[np.float64]
Seen = NDArray[np.float32]
Bools = NDArray[np.bool_]

SCALES = (1.0, 2.0, 4.0, 8.0)  # [dominoes] over which the ends of the row make themselves felt
LARGEST_RING = 1024  # dominoes remembered behind a front; the wave feels some thirty
_OUTCOMES = [Outcome(i) for i in range(len(Outcome))]
ALONE = 128  # rows from which on it pays to wake another thread


@lru_cache(maxsize=64)
def _shared(scene: Scene) -> Scene:
    return scene  # the first of those that are equal


def shared_scene(scene: str | Path | Scene) -> Scene:
    """Load a scene, the same object for all who ask for equal ones: its mark is found once."""
    return _shared(scene if isinstance(scene, Scene) else load_scene(scene))


def require_choice(scene: Scene) -> None:
    """Refuse a scene that leaves nothing free, or whose rules cannot be kept domino by domino.

    Raises
    ------
    ValueError
        Says what to leave out.
    """
    if not (scene.free_spacing or scene.free_thickness or scene.free_height):
        raise ValueError(
            f"scene '{scene.name}' leaves nothing free: there is nothing to choose; give spacing "
            "or thickness a min and a max"
        )
    if scene.length is not None and not replace(scene, limits=None).plain:
        raise ValueError(
            f"scene '{scene.name}' asks for a length and for lists, a stock or a largest change "
            "too: what remains reachable of these is not known domino by domino; leave one out, or "
            "search such rows with `optimize`"
        )


def kinds_to_choose(scene: Scene) -> tuple[Floats, Floats]:
    """Return the thicknesses that dominoes may have [m], if only some, and how many of each."""
    if scene.stock is not None:
        box = scene.stock.without(scene.first_thickness)
        order = np.argsort(box.thickness)
        return np.array(box.thickness)[order], np.array(box.count, dtype=np.float64)[order]
    kinds = np.array(scene.thickness_values or (), dtype=np.float64)
    return kinds, np.full(len(kinds), np.inf)


def checked_rtol(rtol: float) -> float:
    """Return the tolerance, if it is one that the simulator takes."""
    if not TIGHTEST <= rtol <= LOOSEST:
        raise ValueError(f"rtol = {rtol}: choose a tolerance between {TIGHTEST} and {LOOSEST}")
    return float(rtol)


class Rows:
    """The arrays of B rows, allocated once, and the two compiled calls that move them.

    Parameters
    ----------
    scene
        What is built.
    number
        B.
    rtol
        Relative error allowed in the arrival times.
    reference_speed
        Speed that the rewards of single steps count against [m/s]; None for the mean speed of the
        best uniform row.
    window
        Gaps (and thicknesses) seen behind the front.

    Raises
    ------
    ValueError
        For what `require_choice` and `checked_rtol` refuse, and a window or speed out of range.
    """

    def __init__(
        self,
        scene: Scene,
        number: int,
        rtol: float,
        reference_speed: float | None,
        window: int,
    ) -> None:
        require_choice(scene)
        if not (isinstance(window, int | np.integer) and window >= 0):
            raise ValueError(f"window = {window!r}: give the number of dominoes to see, 0 or more")
        self.scene = scene
        self.number = number
        self.rtol = checked_rtol(rtol)
        self.mark = scene.uniform()
        self.window = min(int(window), scene.count - 1)
        self.choices = int(scene.free_spacing) + int(scene.free_thickness)
        self.choices += int(scene.free_height)
        kinds, stock = kinds_to_choose(scene)
        size = 2
        while size < scene.count + 1 and size < LARGEST_RING:
            size *= 2
        self._batch = kernels.Batch(
            rules=self._ruled(),
            progress=progress_features(scene.count),
            gap_values=np.array(scene.spacing_values or (), dtype=np.float64),
            kinds=kinds,
            stock=stock,
            left=np.tile(stock, (number, 1)),
            rings=np.zeros((number, size), kernels.LINK),
            states=np.zeros(number, kernels.STATE),
            episodes=np.zeros(number, kernels.EPISODE),
            spacing=np.full((number, scene.count - 1), scene.spacing[0]),
            thickness=np.full((number, scene.count), scene.first_thickness),
            # where all are equally high, all rows share one array
            height=np.full((number if scene.growth is not None else 1, scene.count), scene.height),
            density=np.full((1, scene.count), scene.density),
        )
        self._rules = self._batch.rules[0]
        self.episodes = self._batch.episodes
        self.phases = self.episodes["phase"]
        self.reference_speed = self._speed_of_uniform() if reference_speed is None else (
            reference_speed
        )  # fmt: skip
        low, high = self._bounds_seen()
        self.seen_low, self.seen_high = low, high

    # what can be set ------------------------------------------------------------------------------

    @property
    def reference_speed(self) -> float:
        """Speed that the rewards of single steps count against [m/s]."""
        return float(self._rules.reference_speed)

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        if not (np.ndim(speed) == 0 and 0.0 < speed < np.inf):
            raise ValueError(
                f"reference_speed = {speed!r} m/s: give one finite number, more than 0; the best "
                f"uniform row runs at {self._speed_of_uniform():.6g} m/s"
            )
        self._rules.reference_speed = speed

    def _speed_of_uniform(self) -> float:
        """Of the best uniform row, or where even that dies, of something that falls freely."""
        speed = self.mark.wave.mean_speed
        return speed if speed > 0.0 else float(
            np.sqrt(self.scene.physics.gravity * self.scene.height)
        )  # fmt: skip

    def _ruled(self) -> NDArray[np.record]:
        """The scene's rules as the kernels take them."""
        scene, array = self.scene, np.zeros(1, kernels.RULES)
        rules = array[0]
        rules.friction, rules.gravity = scene.physics.friction, scene.physics.gravity
        rules.push, rules.rtol = scene.physics.push, self.rtol
        rules.uniform_score = self.mark.score
        rules.length = scene.length or 0.0
        rules.gap_low, rules.gap_high = scene.spacing
        rules.thick_low, rules.thick_high = scene.thickness
        rules.largest_change = scene.largest_change or 0.0
        rules.grows = scene.growth is not None
        rules.growth_low, rules.growth_high = scene.growth or (1.0, 1.0)
        rules.unit, rules.in_heights = scene.height, scene.in_heights
        rules.has_stock = scene.stock is not None
        rules.pays = float(scene.criterion.rewards_speed)
        rules.score_is_speed = scene.criterion.is_mean_speed and scene.limits is None
        rules.window = self.window
        return array

    def _bounds_seen(self) -> tuple[Seen, Seen]:
        """Bounds of each entry of an observation; the order is `kernels.observation`'s."""
        low = [0.0, -kernels.LEAD_LIMIT, -1.0]
        high = [kernels.FRONT_LIMIT, kernels.LEAD_LIMIT, kernels.SPEED_LIMIT]
        if self.scene.length is not None:
            low, high = [*low, 0.0, -1.0], [*high, 1.0, 1.0]
        behind = self.window * self.choices
        ends = self._batch.progress.shape[1] + int(self.scene.free_height)
        ends += len(self._batch.kinds) * (self.scene.stock is not None)
        low += [-1.0] * behind + [0.0] * ends
        high += [1.0] * (behind + ends)
        return np.array(low, np.float32), np.array(high, np.float32)

    # beginning and stepping -----------------------------------------------------------------------

    def reset(
        self, chosen: Bools, seen: Seen, start: Sequence[Layout | None] | Layout | None = None
    ) -> None:
        """Begin anew in the chosen rows (B,) and write what is seen of them.

        Parameters
        ----------
        chosen
            (B,) which rows.
        seen
            (B, O) observations, written for the chosen rows.
        start
            The first dominoes of each row, or of all, already laid; None for the first alone.

        Raises
        ------
        ValueError
            Where `start` breaks the scene's rules or its wave dies; every row is then left as it
            was.
        """
        given = np.zeros(self.number, np.int64)
        if start is not None:
            layouts = [start] * self.number if isinstance(start, Layout) else list(start)
            if len(layouts) != self.number:
                raise ValueError(
                    f"{len(layouts)} layouts to start from: give one for all, or one for each of "
                    f"the {self.number} rows"
                )
            for b, layout in enumerate(layouts):
                if chosen[b] and layout is not None:
                    self._require_start(layout)
            for b, layout in enumerate(layouts):
                if chosen[b] and layout is not None:
                    given[b] = layout.count - 1
                    self._batch.spacing[b, : given[b]] = layout.spacing
                    self._batch.thickness[b, : layout.count] = layout.thickness
                    if self.scene.growth is not None:
                        self._batch.height[b, : layout.count] = layout.height
        kernels.reset_rows(0, self.number, self._batch, chosen, given, seen)

    def _require_start(self, layout: Layout) -> None:
        scene = self.scene
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

    def step(self, actions: Floats) -> tuple[Seen, Floats, Bools]:
        """Place a domino in every row that runs.

        Parameters
        ----------
        actions
            (B, choices) in [-1, 1].

        Returns
        -------
        tuple
            Observations (B, O), rewards (B,) and which episodes ended (B,). Of rows that do not run
            nothing is observed: their entries are not set.
        """
        seen = np.empty((self.number, len(self.seen_low)), np.float32)
        rewards = np.empty(self.number)
        ended = np.empty(self.number, np.bool_)
        share_rows(
            kernels.step_rows, self.number, ALONE, self._batch, actions, seen, rewards, ended
        )
        return seen, rewards, ended

    def actions_towards(self, layout: Layout) -> Floats:
        """Return actions (B, choices) that place the next domino of every row as in a layout.

        Where the rules no longer leave its place, the nearest they do; 0 for rows that are over.
        """
        actions = np.zeros((self.number, self.choices))
        for b in np.flatnonzero(self.phases == kernels.RUNNING):
            actions[b] = self._action_towards(int(b), layout)
        return actions

    def _action_towards(self, b: int, layout: Layout) -> list[float]:
        scene, rules = self.scene, self._rules
        n, way = int(self.episodes[b].placed), self.episodes[b].way
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

    def lay(self, actions: Floats) -> Layout:
        """Lay the whole row that actions (N-1, choices) stand for, none of it simulated."""
        scene, batch = self.scene, self._batch
        row = kernels.Row(
            batch.spacing[0].copy(), batch.thickness[0].copy(), batch.height[0].copy(),
            batch.density[0],
        )  # fmt: skip
        kernels.choose_all(actions, batch, batch.stock.copy(), row)
        return Layout(row.spacing, row.thickness, row.height, scene.width, scene.density)

    # ends -----------------------------------------------------------------------------------------

    def settle(self, rows: NDArray[np.intp], rewards: Floats) -> dict[str, NDArray[Any]]:
        """Collect what there is to tell of episodes that have just ended.

        Where a wave's own estimate exceeds the tolerance it is run again, more closely, as
        `simulate` does: a row that is built step by step cannot go back.

        Parameters
        ----------
        rows
            (E,) which.
        rewards
            (B,) of the last step; those of the episodes that ended are put right in place.

        Returns
        -------
        dict
            score, gain, outcome, layout and wave, (E,) each.
        """
        scene = self.scene
        endings = self._endings(rows)
        for i in np.flatnonzero(self.episodes["unsure"][rows]).tolist():
            episode = self.episodes[rows[i]]
            if episode.placed == scene.count - 1:
                wave = simulate(endings.layout(i), scene.physics, rtol=self.rtol)
                episode.outcome, episode.reach = wave.outcome, wave.reach
            else:
                wave = endings.waves()[i]
            episode.score = scene.score_wave(wave)
            rewards[rows[i]] = self._return(episode.score) - episode.paid
        endings = self._endings(rows)
        episodes = self.episodes[rows]
        scores = episodes["score"]
        outcomes = np.array(_OUTCOMES, object)[episodes["outcome"]]
        return {
            "score": scores,
            "gain": np.array([self._return(s) for s in scores.tolist()]) / 100.0,
            "outcome": outcomes,
            "layout": endings.layouts(),
            "wave": endings.waves(),
        }

    def _endings(self, rows: NDArray[np.intp]) -> Endings:
        episodes = self.episodes[rows]
        return Endings(
            scene=self.scene,
            rtol=self.rtol,
            spacing=self._batch.spacing[rows],
            thickness=self._batch.thickness[rows],
            height=self._batch.height[rows if len(self._batch.height) > 1 else np.zeros_like(rows)],
            placed=episodes["placed"].tolist(),
            reach=episodes["reach"].tolist(),
        )

    def _return(self, score: float) -> float:
        return float(kernels.plain(kernels.episode_return)(score, self.mark.score))

    def moment(self, b: int) -> Moment:
        """Show row b as it stands and falls."""
        episode, state = self.episodes[b], self._batch.states[b]
        placed = int(episode.placed)
        over = episode.phase == kernels.OVER
        wave = self._endings(np.array([b])).waves()[0] if over else None
        dead = over and episode.outcome != kernels.PROPAGATED
        return Moment(
            spacing=self._batch.spacing[b, :placed].copy(),
            thickness=self._batch.thickness[b, : placed + 1].copy(),
            height=self._batch.height[b % len(self._batch.height), : placed + 1].copy(),
            hit=wave.hit if wave is not None else placed + 1,
            time=float(state.time),
            speed=0.0 if dead else float(np.sqrt(state.u)),
            uniform_speed=self.mark.wave.mean_speed,
            wave=wave,
        )

    def bounds_ahead(self, b: int) -> dict[str, tuple[float, float]]:
        """Return what the next action of row b ranges over, "spacing" and "thickness" [m].

        Where a length is to be met, the gap's bounds depend on the thickness that the same action
        chooses: they are given for its middle.
        """
        episode, rules = self.episodes[b], self._rules
        pairs, way = self.scene.count - 1 - int(episode.placed), episode.way
        low, high = kernels.thickness_range(rules, pairs, way)
        gaps = kernels.gap_range(rules, pairs, way, 0.5 * (low + high))
        return {"spacing": (float(gaps[0]), float(gaps[1])), "thickness": (float(low), float(high))}


def _action_for(value: float, low: float, high: float) -> float:
    """The action in [-1, 1] that stands for a value; where nothing can be chosen, 0."""
    if not low < high:
        return 0.0
    return float(np.clip(2.0 * (value - low) / (high - low) - 1.0, -1.0, 1.0))


def progress_features(count: int) -> Seen:
    """Return (N, 1 + 2 S) for 0 … N-1 dominoes placed: part of the row, closeness to both ends."""
    placed = np.arange(count)[:, None]
    scales = np.array(SCALES)
    features = [
        placed / (count - 1),
        np.exp(-placed / scales),
        np.exp((placed - count + 1) / scales),
    ]
    return np.concatenate(features, axis=1).astype(np.float32)
