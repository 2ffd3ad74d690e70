"""Scene: a design problem, read from one TOML file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env.chain.layout import Layout
from domino_env.chain.physics import Physics
from domino_env.chain.wave import Outcome, Wave, WaveBatch, simulate, simulate_batch
from domino_env.scenes import limits as worth
from domino_env.scenes.limits import Limits, Waves
from domino_env.scenes.objectives.robust import Placement
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.rules import off_list, outside, too_steep
from domino_env.scenes.stock import Stock

Floats = NDArray[np.float64]
Bounds = tuple[float, float]

SCORE_RTOL = 1e-10  # what is reported; searches may look less closely
LENGTH_TOLERANCE = 1e-9  # [m]
LARGEST_BATCH = 4_000_000  # dominoes at once, some 200 MB


@dataclass(frozen=True, eq=False)
class UniformMark:
    """The best uniform row of a scene: the mark to beat.

    Attributes
    ----------
    layout
        The row.
    wave
        Its wave.
    score
        Its score.
    """

    layout: Layout
    wave: Wave
    score: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A design problem: what stands, what may be chosen, what counts.

    Parameters
    ----------
    name
        How it is called.
    title
        What it is about.
    objective
        What counts, one of `domino_env.scenes.limits.OBJECTIVES`.
    physics
        Friction, gravity, push.
    count
        Number of dominoes N.
    height
        Of every domino, or of the first where heights are free [m].
    width
        Of every domino [m].
    density
        Of every domino [kg/m³].
    first_thickness
        Of domino 0, which is the scene's [m].
    spacing
        Least and largest free gap [m]; equal where the scene fixes it. Where `in_heights`, in
        heights of the shorter of the two dominoes at the gap.
    thickness
        Least and largest thickness of dominoes 1 … N-1 [m]; equal where the scene fixes it. Where
        `in_heights`, in heights of the domino itself.
    length
        First pivot to last [m], met to 1e-9 m; None where it is free.
    spacing_values
        The only gaps allowed, rising [m]; None for any.
    thickness_values
        The only thicknesses allowed, rising [m]; None for any.
    largest_change
        From one gap to the next [m]; None for any.
    stock
        The box that all dominoes are taken from, the first among them; None for no box.
    growth
        Least and largest height over that of the domino before, both 1 or more; None where all are
        equally high.
    in_heights
        Whether `spacing` and `thickness` count in heights.
    limits
        Smallest stall margin, largest flush loss; None for none.
    tempo
        The schedule of the objective "tempo".
    placement
        The errors of the objective "robust".
    """

    name: str
    title: str
    objective: str
    physics: Physics
    count: int
    height: float
    width: float
    density: float
    first_thickness: float
    spacing: Bounds
    thickness: Bounds
    length: float | None = None
    spacing_values: tuple[float, ...] | None = None
    thickness_values: tuple[float, ...] | None = None
    largest_change: float | None = None
    stock: Stock | None = None
    growth: Bounds | None = None
    in_heights: bool = False
    limits: Limits | None = None
    tempo: Tempo | None = None
    placement: Placement | None = None

    @property
    def free_spacing(self) -> bool:
        """Whether the designer chooses the gaps."""
        return bool(self.spacing[0] < self.spacing[1])

    @property
    def free_thickness(self) -> bool:
        """Whether the designer chooses the thickness of all dominoes but the first."""
        return bool(self.thickness[0] < self.thickness[1])

    @property
    def free_height(self) -> bool:
        """Whether the designer chooses the height of all dominoes but the first."""
        return self.growth is not None and bool(self.growth[0] < self.growth[1])

    @property
    def plain(self) -> bool:
        """Whether bounds and a length are all the rules, so that gaps may be chosen one by one."""
        asked = (self.spacing_values, self.thickness_values, self.largest_change, self.stock)
        return all(rule is None for rule in (*asked, self.growth, self.limits))

    @property
    def unit(self) -> str:
        """The unit of a success's score, as in "m/s"; empty for none."""
        return worth.UNITS[self.objective]

    @property
    def waves_a_score(self) -> int:
        """How many rows are simulated for one score."""
        if self.placement is None:
            return 1
        return self.placement.draws + (self.limits is not None)

    def layout(
        self,
        spacing: ArrayLike,
        thickness: ArrayLike | None = None,
        height: ArrayLike | None = None,
    ) -> Layout:
        """Lay the row with these free gaps, thicknesses and heights.

        The scene's rules are not applied: see `violations`.

        Parameters
        ----------
        spacing
            (N-1,) free gaps [m]; a single number serves all.
        thickness
            (N-1,) of dominoes 1 … N-1 [m], or a single number; None where the scene fixes it.
        height
            (N-1,) of dominoes 1 … N-1 [m], or a single number; None where all are equally high.
        """
        pairs = (self.count - 1,)
        gaps = np.broadcast_to(np.asarray(spacing, dtype=np.float64), pairs)
        if height is None and self.growth is not None:
            raise ValueError(f"scene '{self.name}' lets the row grow: give the heights too")
        rest = self.height if height is None else np.asarray(height, dtype=np.float64)
        tall = np.concatenate(([self.height], np.broadcast_to(rest, pairs)))
        if thickness is None:
            if self.free_thickness:
                raise ValueError(f"scene '{self.name}' leaves the thickness free: give it too")
            thickness = self.thickness[0] * (tall[1:] if self.in_heights else 1.0)
        thick = np.broadcast_to(np.asarray(thickness, dtype=np.float64), pairs)
        full = np.concatenate(([self.first_thickness], thick))
        return Layout(gaps, full, tall, self.width, self.density)

    def violations(self, layout: Layout) -> list[str]:
        """List what the layout breaks of the scene's rules, a sentence each; empty if nothing.

        Limits on the wave are not among them: they enter the score.
        """
        if layout.count != self.count:
            return [f"{layout.count} dominoes stand where the scene asks for {self.count}"]
        found = []
        if not np.isclose(layout.thickness[0], self.first_thickness, rtol=1e-9, atol=0.0):
            found.append(
                f"thickness[0] = {layout.thickness[0]} m: the first domino is the scene's, "
                f"{self.first_thickness} m thick"
            )
        told = layout.height if self.growth is None else layout.height[:1]
        for name, values, wanted in (
            ("height", told, self.height),
            ("density", layout.density, self.density),
        ):
            if not np.allclose(values, wanted, rtol=1e-9, atol=0.0):
                i = int(np.argmax(np.abs(values - wanted)))
                found.append(f"{name}[{i}] = {values[i]}: the scene's dominoes have {wanted}")
        if self.growth is not None:
            found += outside("growth", layout.height[1:] / layout.height[:-1], self.growth, 1, "")
        gaps, thick, unit = layout.spacing, layout.thickness[1:], "m"
        if self.in_heights:
            gaps = gaps / np.minimum(layout.height[:-1], layout.height[1:])
            thick, unit = thick / layout.height[1:], "heights"
        found += outside("spacing", gaps, self.spacing, 0, unit)
        if self.spacing_values is not None:
            found += off_list("spacing", gaps, self.spacing_values, 0)
        if self.largest_change is not None:
            found += too_steep(gaps, self.largest_change)
        if self.stock is not None:
            found += self.stock.broken_by(layout.thickness)
        else:
            found += outside("thickness", thick, self.thickness, 1, unit)
            if self.thickness_values is not None:
                found += off_list("thickness", thick, self.thickness_values, 1)
        if self.length is not None and abs(layout.length - self.length) > LENGTH_TOLERANCE:
            found.append(
                f"the row is {layout.length:.9f} m long, not {self.length} m: "
                f"{layout.length - self.length:+.3g} m"
            )
        return found

    def simulate(self, layout: Layout, rtol: float = SCORE_RTOL) -> Wave:
        """Topple a layout under the scene's physics."""
        return simulate(layout, self.physics, rtol=rtol)

    def score(self, layout: Layout) -> float:
        """Score a layout, as every method is judged; higher is better.

        Returns
        -------
        float
            More than 0 for a success: with "mean_speed", the mean speed [m/s]. A wave that dies
            scores between -1 and 0, higher the further it came, so that a search can climb. See
            `domino_env.scenes.limits`.

        Raises
        ------
        ValueError
            For a layout that breaks the scene's rules.
        """
        broken = self.violations(layout)
        if broken:
            raise ValueError(f"scene '{self.name}': {'; '.join(broken)}")
        return self.score_wave(self.simulate(layout))

    def score_wave(self, wave: Wave) -> float:
        """Score a wave that has been simulated; "robust" topples its draws besides."""
        if self.placement is not None:
            row = wave.layout
            spacing, thickness = row.spacing[None], row.thickness[None]
            return float(self._robust(spacing, thickness, row.height[None], wave.rtol)[0][0])
        waves = Waves.of_one(wave)
        return float(self._worth(waves, wave.layout.height[-1])[0])

    def score_batch(
        self,
        spacing: Floats,
        thickness: Floats | None,
        rtol: float = 1e-6,
        height: Floats | None = None,
    ) -> Floats:
        """Score B layouts at once; the scene's rules are not checked again.

        Parameters
        ----------
        spacing
            (B, N-1) free gaps [m].
        thickness
            (B, N-1) of dominoes 1 … N-1 [m]; None where it is fixed.
        rtol
            Relative error allowed in the arrival times.
        height
            (B, N-1) of dominoes 1 … N-1 [m]; None where all are equally high.

        Returns
        -------
        NDArray
            (B,) scores.
        """
        tall = self._heights(len(spacing), height)
        full = self._thicknesses(len(spacing), thickness, tall)
        if self.placement is not None:
            return self._robust(spacing, full, tall, rtol)[0]
        batch = self._topple(
            spacing, full, tall, rtol, record=self.objective == "tempo" or self.limits is not None
        )
        return self._worth(Waves.of_batch(batch, rtol), tall[:, -1])

    def score_batch_gradient(
        self,
        spacing: Floats,
        thickness: Floats | None,
        rtol: float = 1e-8,
        height: Floats | None = None,
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Score B layouts at once, with the exact gradients of the scores.

        Parameters
        ----------
        spacing
            As of `score_batch`.
        thickness
            As of `score_batch`.
        rtol
            Relative error allowed in the arrival times.
        height
            As of `score_batch`.

        Returns
        -------
        tuple
            Scores (B,), and their derivatives (B, N-1) by gaps, by thicknesses and by heights of
            dominoes 1 … N-1, each with the others fixed [score/m]; zero for a row without success.
        """
        tall = self._heights(len(spacing), height)
        full = self._thicknesses(len(spacing), thickness, tall)
        if self.objective == "tempo":
            found, *slopes = self._tempo_gradient(spacing, full, tall, rtol)
        elif self.objective in ("toppled", "magnify"):
            found = self.score_batch(spacing, thickness, rtol, height)
            slopes = [np.zeros_like(full[:, 1:]) for _ in range(3)]
            if self.objective == "magnify":
                slopes[2][:, -1] = 1.0
        else:
            found, *slopes = self._speed_gradient(spacing, full, tall, rtol)
        alive = (found > 0.0)[:, None]
        return found, alive * slopes[0], alive * slopes[1], alive * slopes[2]

    def falls(self, scores: Floats) -> int:
        """Count the single falls simulated for these scores; with "robust", at most so many."""
        if self.placement is not None:
            return self.waves_a_score * self.count * len(scores)
        return worth.falls(scores, self.count, self.objective, self.limits)

    def in_words(self, score: float, wave: Wave) -> str:
        """Say a score in the words and units of the objective."""
        if score <= 0.0:
            broken = self.limits is not None and wave.outcome == Outcome.PROPAGATED
            none = {"m/s": "no speed", "m": "no height"}.get(self.unit, "no success")
            return "breaks a limit of the scene" if broken else none
        if self.objective == "tempo":
            assert self.tempo is not None
            return f"RMS error {1e3 * self.tempo.error(wave.arrival_times[None])[0]:.6g} ms"
        if self.objective == "toppled":
            return f"{wave.toppled} of {self.count} toppled"
        if self.objective == "magnify":
            return f"last domino {score:.6f} m high"
        if self.placement is not None:
            part = 1.0 - self.placement.quantile
            return f"{score:.6f} m/s reached by {part:.4g} of the rows as placed"
        return f"{score:.6f} m/s"

    def uniform(self) -> UniformMark:
        """Find the best uniform row within the scene's rules; found once, kept."""
        return self._uniform

    @cached_property
    def _uniform(self) -> UniformMark:
        from domino_env.scenes.baseline import best_uniform

        layout = best_uniform(self)
        wave = self.simulate(layout)
        return UniformMark(layout, wave, self.score_wave(wave))

    def to_toml(self) -> str:
        """Write the scene as the text of a file that `load_scene` reads."""
        from domino_env.scenes.files import to_toml

        return to_toml(self)

    # how the score is computed; all arrays of all N dominoes ------------------------------------

    def _heights(self, rows: int, height: Floats | None) -> Floats:
        """Heights of all dominoes, (B, N), or (1, N) where all rows have the same [m]."""
        if height is None:
            if self.growth is not None:
                raise ValueError(f"scene '{self.name}' lets the row grow: give the heights too")
            return np.full((1, self.count), self.height)
        tall = np.empty((rows, self.count))
        tall[:, 0], tall[:, 1:] = self.height, height
        return tall

    def _thicknesses(self, rows: int, thickness: Floats | None, tall: Floats) -> Floats:
        """Thicknesses of all dominoes, (B, N) [m]."""
        full = np.empty((rows, self.count))
        full[:, 0] = self.first_thickness
        if thickness is None:
            thickness = self.thickness[0] * (tall[:, 1:] if self.in_heights else np.ones(1))
        full[:, 1:] = thickness
        return full

    def _topple(
        self, spacing: Floats, thickness: Floats, tall: Floats, rtol: float, *,
        record: bool = False, gradient: bool = False,
    ) -> WaveBatch:  # fmt: skip
        return simulate_batch(
            spacing, thickness, self.physics, height=tall, density=self.density, rtol=rtol,
            record=record, gradient=gradient,
        )  # fmt: skip

    def _worth(self, waves: Waves, last_height: Floats | float) -> Floats:
        return worth.scores(self.objective, waves, self.tempo, last_height, self.limits)

    def _robust(
        self, spacing: Floats, thickness: Floats, tall: Floats, rtol: float
    ) -> tuple[Floats, NDArray[np.int64]]:
        """Scores of B rows under placement errors, and which draw decided each."""
        assert self.placement is not None
        draws = self.placement.draws
        found, decisive = np.empty(len(spacing)), np.empty(len(spacing), dtype=np.int64)
        piece = max(1, LARGEST_BATCH // (draws * self.count))
        for i in range(0, len(spacing), piece):
            part = slice(i, i + piece)
            gaps, thick = self.placement.rows(spacing[part]), thickness[part]
            height = tall if len(tall) == 1 else np.repeat(tall[part], draws, axis=0)
            batch = self._topple(gaps, np.repeat(thick, draws, axis=0), height, rtol)
            speeds = np.where(batch.outcome == Outcome.PROPAGATED, batch.mean_speed, 0.0)
            speeds = speeds.reshape(-1, draws)
            decisive[part] = self.placement.decisive(speeds)
            speed = speeds[np.arange(len(speeds)), decisive[part]]
            # where too many draws die for a speed, how far they came on average
            reach = batch.reach.reshape(-1, draws).mean(axis=1)
            found[part] = np.where(speed > 0.0, speed, reach - 1.0)
        if self.limits is not None:  # of the row as it is drawn
            waves = Waves.of_batch(self._topple(spacing, thickness, tall, rtol, record=True), rtol)
            found = worth.limited(found, waves, self.limits)
        return found, decisive

    def _speed_gradient(
        self, spacing: Floats, thickness: Floats, tall: Floats, rtol: float
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Of mean speeds: v = length / t, and the length grows with every gap and thickness."""
        found, gaps, moved = None, spacing, np.ones(1)
        if self.placement is not None:
            found, decisive = self._robust(spacing, thickness, tall, rtol)
            placed = self.placement.rows(spacing).reshape(len(spacing), -1, self.count - 1)
            gaps = placed[np.arange(len(spacing)), decisive]
            errors = self.placement.errors(self.count - 1)[decisive]
            moved = (np.abs(gaps - spacing - errors) < 1e-15).astype(np.float64)  # not at the least
        batch = self._topple(gaps, thickness, tall, rtol, gradient=True)
        if found is None:
            found = self._worth(Waves.of_batch(batch, rtol), 0.0)
            if self.limits is not None:  # a batch with gradients keeps no margins of the falls
                waves = self._topple(spacing, thickness, tall, rtol, record=True)
                found = self._worth(Waves.of_batch(waves, rtol), 0.0)
        assert batch.gradient is not None
        time = np.where(batch.outcome == Outcome.PROPAGATED, batch.total_time, 1.0)[:, None]
        speed = batch.mean_speed[:, None]
        return (
            found,
            moved * (1.0 - speed * batch.gradient.spacing) / time,
            (1.0 - speed * batch.gradient.thickness[:, 1:]) / time,
            -speed * batch.gradient.height[:, 1:] / time,
        )

    def _tempo_gradient(
        self, spacing: Floats, thickness: Floats, tall: Floats, rtol: float
    ) -> tuple[Floats, Floats, Floats, Floats]:
        assert self.tempo is not None
        found = np.empty(len(spacing))
        slopes = np.zeros((3, len(spacing), self.count - 1))
        for b in range(len(spacing)):
            row = Layout(spacing[b], thickness[b], tall[b % len(tall)], self.width, self.density)
            wave = simulate(row, self.physics, rtol=rtol, gradient=True)
            found[b] = self.score_wave(wave)
            if wave.outcome == Outcome.PROPAGATED:
                pulled = wave.pullback(self.tempo.slope(wave.arrival_times[None])[0])
                slopes[:, b] = pulled.spacing, pulled.thickness[1:], pulled.height[1:]
        return found, slopes[0], slopes[1], slopes[2]
