"""The picture of a search: to scale, complete, for every kind of result, without pyplot."""

import re
from dataclasses import replace

import numpy as np
import pytest

from optimize import search


def dominoes(axes):
    """Return left, bottom, width and height of the drawn rectangles [mm], shape (N, 4)."""
    (collection,) = axes.collections
    return np.array([path.get_extents().bounds for path in collection.get_paths()])


@pytest.fixture(scope="module")
def result(scenes):
    return search(scenes["both"], "cma", budget=200)


def test_both_layouts_stand_to_scale_and_on_the_same_scale(result):
    figure = result.figure()
    figure.draw_without_rendering()
    drawings = figure.axes[:2]
    for axes, layout in zip(drawings, (result.uniform.layout, result.layout), strict=True):
        boxes = dominoes(axes)
        assert boxes[:, 0] + boxes[:, 2] == pytest.approx(1e3 * layout.positions)
        assert boxes[:, 2:] == pytest.approx(1e3 * np.stack([layout.thickness, layout.height], 1))
        extent = axes.get_window_extent()
        across, up = extent.width / np.ptp(axes.get_xlim()), extent.height / np.ptp(axes.get_ylim())
        assert across == pytest.approx(up)
    assert drawings[0].get_xlim() == drawings[1].get_xlim() == figure.axes[2].get_xlim()


def test_the_panels_show_spacing_thickness_speed_and_search(result):
    spacing, thickness, speed, trace = result.figure().axes[2:]
    pairs = [(result.uniform.layout, result.uniform.wave), (result.layout, result.wave)]
    for i, (layout, wave) in enumerate(pairs):
        lines = [axes.get_lines()[i - 2] for axes in (spacing, thickness, speed)]
        assert lines[0].get_ydata() == pytest.approx(1e3 * layout.spacing)
        assert lines[1].get_ydata() == pytest.approx(1e3 * layout.thickness[1:])
        assert lines[2].get_ydata() == pytest.approx(wave.local_speed)
        middles = 500.0 * (layout.positions[1:] + layout.positions[:-1])
        assert lines[2].get_xdata() == pytest.approx(middles)
    uniform, steps = trace.get_lines()
    assert set(uniform.get_ydata()) == {result.uniform.score}
    assert steps.get_ydata().tolist() == [score for _, _, _, score in result.trace]


@pytest.mark.parametrize(("budget", "scale"), [(3, "linear"), (50, "log")])
def test_a_search_with_a_schedule_shows_errors(budget, scale):
    result = search("tempo", budget=budget)
    axes = result.figure().axes[-1]
    uniform, steps = axes.get_lines()
    late = result.scene.tempo.error(result.wave.arrival_times[None])[0]
    assert steps.get_ydata()[-1] == pytest.approx(max(1e3 * late, 1e-6), rel=1e-3)
    assert axes.get_yscale() == scale
    assert axes.get_xlim()[0] == 0.0
    low, high = axes.get_ylim()
    assert low < steps.get_ydata()[-1] <= uniform.get_ydata()[0] < high


@pytest.mark.parametrize(("name", "headline"), [
    ("one-gap", "one-gap: .*uniform"), ("length", "length: .*uniform"), ("dead", "dead: no speed"),
])  # fmt: skip
def test_every_result_can_be_drawn(scenes, name, headline):
    scene = replace(scenes[name], title="a title longer than the picture " * 8)
    figure = search(scene, "random", budget=30).figure()
    figure.canvas.draw()
    assert max(text.get_window_extent().x1 for text in figure.texts) < figure.bbox.width
    assert re.fullmatch(headline, figure.texts[0].get_text())
    if name == "dead":
        assert len(figure.axes) == 4  # no scores, which are no speeds
        assert figure.axes[3].texts[0].get_text() == "no wave reached the second domino"
