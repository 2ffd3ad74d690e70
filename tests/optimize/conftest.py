"""Small scenes on which a search takes milliseconds."""

from collections.abc import Callable
from dataclasses import replace

import pytest

import domino_env as de
from optimize.result import SearchResult

KINDS = {
    "spacing": {"count": 7},
    "one-gap": {"count": 2},
    "thickness": {"count": 6, "spacing": (0.018, 0.018), "thickness": (0.004, 0.012)},
    "both": {"count": 6, "thickness": (0.004, 0.012)},
    "length": {"count": 9, "length": 0.18},
    "length-both": {"count": 7, "length": 0.12, "thickness": (0.004, 0.012)},
    "dying": {"count": 9, "thickness": (0.005, 0.014), "physics": de.Physics(0.5, 9.81, 4.0)},
    "dead": {"count": 6, "physics": de.Physics(push=0.5)},
}


def without_times(result: SearchResult) -> list[object]:
    """Return what a search repeats bitwise."""
    trace = [(n, falls, score) for n, falls, _, score in result.trace]
    spent = result.evaluations, result.falls, result.interrupted
    return [result.layout, result.score, spent, trace]


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """No drawing of results, which takes longer than searches in small scenes."""
    monkeypatch.setattr(SearchResult, "figure", lambda _: None)
    monkeypatch.setattr("domino_env.core.plot_style.png", lambda _: b"")


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[tuple[de.Layout, float]]:
    """Every layout that is simulated during a search, with its score."""
    layouts: list[tuple[de.Layout, float]] = []
    original = de.Scene.evaluate

    def evaluate(scene, batch, gradient=False, stop=None):
        result = original(scene, batch, gradient, stop)
        layouts.extend((batch.layout(b), score) for b, score in enumerate(result.score.tolist()))
        return result

    monkeypatch.setattr(de.Scene, "evaluate", evaluate)
    return layouts


@pytest.fixture(scope="session")
def bits() -> Callable[[SearchResult], list[object]]:
    """A function that returns what a search repeats bitwise."""
    return without_times


@pytest.fixture(scope="session")
def scenes() -> dict[str, de.Scene]:
    """Scenes of all kinds, whose uniform baselines are computed once."""
    sprint = de.load_scene("sprint")
    return {
        name: replace(sprint, name=name, title=f"a small scene: {name}", **changes)
        for name, changes in KINDS.items()
    }
