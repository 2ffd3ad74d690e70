"""Results in a session: a line each, a drawing in a notebook, a figure when asked."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import domino_env as de
from optimize import search

LAYOUT = de.Layout(np.linspace(0.004, 0.03, 11), np.linspace(0.004, 0.012, 12))
WAVE = de.simulate(LAYOUT, de.Physics(), gradient=True)
DEAD = de.simulate(de.Layout.uniform(30, pitch=0.03), de.Physics(friction=0.5, push=1.0))
ROWS = np.full((500, 39), 0.012)


@pytest.fixture(scope="module")
def shown() -> dict[str, object]:
    scene = de.load_scene("sprint")
    return {
        "layout": LAYOUT,
        "one domino": de.Layout.uniform(1, pitch=0.02),
        "wave": WAVE,
        "dead": DEAD,
        "batch": de.simulate_batch(ROWS, 0.0075, de.Physics()),
        "gradient": WAVE.gradient(),
        "diagnosis": de.diagnose(LAYOUT, de.Physics()),
        "mark": scene.uniform(),
        "result": search(scene, "random", budget=20),
    }


def test_every_result_is_a_line(shown) -> None:
    for name, one in shown.items():
        line = repr(one)
        assert line.startswith(f"{type(one).__name__}("), name
        assert "\n" not in line, name
        assert len(line) < 260, name


def test_what_the_lines_say(shown) -> None:
    assert repr(LAYOUT) == (
        f"Layout(12 dominoes over {LAYOUT.length:.6g} m: gaps 4 to 30 mm, 4 to 12 mm thick, "
        "48 mm high)"
    )
    assert f"{WAVE.mean_speed:.6g} m/s" in repr(WAVE)
    assert repr(DEAD) == "Wave(stalled: 1 of 30 dominoes were struck, 0 toppled)"
    assert "500 waves: 500 propagated" in repr(shown["batch"])
    assert f"{-shown['result'].gain:.2%} below uniform" in repr(shown["result"])
    assert (str(DEAD.outcome), f"{DEAD.outcome}", DEAD.outcome) == ("STALLED", "STALLED", 1)


@pytest.mark.parametrize(("name", "dominoes"), [("layout", 12), ("dead", 30), ("result", 80)])
def test_notebooks_draw_every_domino(shown, name: str, dominoes: int) -> None:
    html = shown[name]._repr_html_()
    assert html.count("<polygon") == dominoes
    assert html.count('opacity="0.3"') == (29 if name == "dead" else 0)
    assert "&gt;" not in html
    assert repr(shown[name]) in html


def test_a_long_row_is_drawn_by_its_ends() -> None:
    html = de.Layout.uniform(100_000, pitch=0.02)._repr_html_()
    assert 50 < html.count("<polygon") < 300


@pytest.mark.parametrize("name", ["layout", "one domino", "wave", "dead", "result"])
def test_figures_are_drawn_when_asked(shown, name: str) -> None:
    figure = shown[name].plot()
    assert isinstance(figure, Figure)
    assert figure._repr_png_().startswith(b"\x89PNG")
