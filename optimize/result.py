"""SearchResult: what a search has found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from domino_env.core.results import draw
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline, gain
from domino_env.view.notebook import MadeForScene

Trace = tuple[tuple[int, int, float, float], ...]


@dataclass(frozen=True, eq=False)
class SearchResult(MadeForScene):
    """The best layout of a search, simulated closely, beside the best uniform pitch.

    Attributes
    ----------
    scene
        What was searched.
    method
        The name of the method.
    seed
        Of all randomness.
    layout
        The best found.
    wave
        Its wave, at a relative error of 1e-10.
    score
        What the scene gives for it.
    uniform
        The best uniform layout, its wave and score: the baseline.
    trace
        (evaluations, simulated falls, seconds, best score) at every improvement, and at the end;
        its scores are the search's own, at a relative error of 1e-6.
    slopes
        At each of these the steepest slope left within the box, in score over the whole range of a
        variable; None where the method asked for no gradient there.
    evaluations
        Layouts simulated in all.
    falls
        Single falls simulated in all.
    seconds
        Time spent in all.
    interrupted
        Whether it was ended by hand.
    ended
        Why it ended, in words: what its method found enough, or the limit that it reached.
    """

    scene: Scene
    method: str
    seed: int
    layout: Layout
    wave: Wave
    score: float
    uniform: UniformBaseline
    trace: Trace
    slopes: tuple[float | None, ...]
    evaluations: int
    falls: int
    seconds: float
    interrupted: bool
    ended: str = ""

    @property
    def gain(self) -> float | None:
        """Score over the uniform one, minus 1; None where one of the rows dies."""
        return gain(self.score, self.uniform.score)

    def __repr__(self) -> str:
        found = self.scene.against_uniform(self.score, self.wave)
        how = f"{self.evaluations} rows in {self.seconds:.2g} s"
        return f"SearchResult({self.scene.name} by {self.method}, seed {self.seed}: {found}; {how})"

    def plot(self) -> Any:
        """Draw both rows, what differs along them and the search; returns a Matplotlib figure."""
        return draw("search", self)
