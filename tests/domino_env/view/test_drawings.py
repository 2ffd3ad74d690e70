"""Results in a session: one line each, a drawing in a notebook, a figure by `plot`."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import domino_env as de
from optimize import search

LAYOUT = de.Layout(np.linspace(0.004, 0.03, 11), np.linspace(0.004, 0.012, 12))
WAVE = de.simulate(LAYOUT, de.Physics(), gradient=True)
DEAD = de.simulate(de.Layout.uniform(30, pitch=0.03), de.Physics(friction=0.5, push=1.0))
GAPS = np.full((500, 39), 0.012)


@pytest.fixture(scope="module")
def results() -> dict[str, object]:
    scene = de.load_scene("sprint")
    return {
        "layout": LAYOUT,
        "one domino": de.Layout.uniform(1, pitch=0.02),
        "wave": WAVE,
        "dead": DEAD,
        "batch": de.simulate_batch(GAPS, 0.0075, de.Physics()),
        "gradient": WAVE.gradient(),
        "diagnosis": de.diagnose(LAYOUT, de.Physics()),
        "uniform": scene.uniform(),
        "result": search(scene, "random", budget=20),
    }


def test_every_result_has_one_line_with_its_main_numbers(results):
    for name, result in results.items():
        assert repr(result).startswith(f"{type(result).__name__}("), name
        assert "\n" not in repr(result), name
        assert len(repr(result)) < 260, name
    assert repr(LAYOUT) == (
        f"Layout(12 dominoes over {LAYOUT.length:.6g} m: gaps 4 to 30 mm, 4 to 12 mm thick, "
        "48 mm high)"
    )
    assert repr(de.Layout([0.0123456], 0.0075)).startswith("Layout(2 dominoes over 0.0198 m:")
    assert f"{WAVE.mean_speed:.6g} m/s" in repr(WAVE)
    assert repr(DEAD) == "Wave(stalled: 1 of 30 dominoes were hit, 0 toppled)"
    assert "500 waves: 500 propagated" in repr(results["batch"])
    assert f"{-results['result'].gain:.2%} below uniform" in repr(results["result"])
    assert (str(DEAD.outcome), f"{DEAD.outcome}", DEAD.outcome) == ("STALLED", "STALLED", 1)


@pytest.mark.parametrize("name", ["layout", "dead", "result"])
def test_notebooks_show_the_figure(results, name):
    assert results[name]._repr_png_() == results[name].plot()._repr_png_()


@pytest.mark.parametrize("count", [40, 100_000])
def test_a_long_layout_is_drawn_with_its_first_dominoes_and_all_gaps(count):
    dominoes, gaps = de.Layout.uniform(count, pitch=0.02).plot().axes
    assert sum(len(drawn.get_paths()) for drawn in dominoes.collections) == min(count, 107)
    assert len(gaps.get_lines()[0].get_xdata()) == count - 1


@pytest.mark.parametrize(("name", "curves", "label"), [
    ("layout", 1, "gap [mm]"),
    ("one domino", 1, "gap [mm]"),
    ("wave", 1, "local speed [m/s]"),
    ("dead", 1, "local speed [m/s]"),
    ("result", 2, "gap [mm]"),
])  # fmt: skip
def test_plot_draws_into_given_axes(results, name, curves, label):
    figure = Figure()
    axes, other = figure.subplots(2)
    assert results[name].plot(ax=axes) is figure
    assert axes.get_ylabel().removesuffix(" (log.)") == label
    assert len([line for line in axes.get_lines() if line.get_linestyle() == "-"]) == curves
    assert not other.has_data()
    with pytest.raises(TypeError, match="ax = 3: give Matplotlib axes"):
        results[name].plot(ax=3)


def test_the_baseline_of_a_random_order_is_said_to_be_a_mean():
    result = search("draw", "uniform", budget=1)
    texts = [text.get_text() for text in result.plot().texts]
    assert any("mean 0.7799 m/s; here one order of the pieces" in text for text in texts)


@pytest.mark.parametrize("name", ["layout", "wave", "result"])
def test_pyplot_shows_what_a_script_plots_and_nothing_else(results, name):
    import matplotlib.pyplot as plt

    plt.close("all")
    plt.switch_backend("agg")
    figure = results[name].plot()
    assert plt.figure(figure.number) is figure
    assert figure._repr_png_().startswith(b"\x89PNG")
    plt.close(figure)
    if name == "result":
        results[name].figure()  # as for a run folder
    assert plt.get_fignums() == []
