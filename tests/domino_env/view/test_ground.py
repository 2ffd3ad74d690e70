"""Drawings of layouts on uneven ground."""

import numpy as np
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.physics.motion import outlines, stack_leans
from domino_env.view.drawing import BACKGROUND, Scale, draw_strip
from domino_env.view.ground import ground_line, positions_along, relief

LAYOUT = uneven_layout(3, 12)


def wheel(radius: float = 0.35, step: float = 0.06, count: int = 5) -> de.Layout:
    """Return a layout on the top of a wheel."""
    half = np.arcsin(0.5 * 0.0075 / radius)
    tilt = step * (np.arange(count) - 0.5 * (count - 1))
    front = radius * np.stack([np.sin(tilt + half), np.cos(tilt + half)], -1)
    rear = radius * np.stack([np.sin(tilt - half), np.cos(tilt - half)], -1)
    ahead = np.stack([np.cos(tilt), -np.sin(tilt)], -1)
    gaps = ((rear[1:] - front[:-1]) * ahead[1:]).sum(-1)
    return de.Layout(gaps, 0.0075, rise=np.diff(front[:, 1]), tilt=tilt)


def test_the_line_goes_through_all_bases_and_has_no_kinks():
    layout = uneven_layout(4, 30, unequal=True)
    line = ground_line(layout, 0.02, 0.03)
    feet = outlines(layout, layout.tilt)[:, [3, 0]].reshape(-1, 2)
    distance = np.linalg.norm(line[:, None] - feet, axis=-1).min(axis=0)
    np.testing.assert_allclose(distance, 0.0, atol=1e-15)
    assert (np.diff(line[:, 0]) > 0.0).all()
    slope = np.arctan2(*np.diff(ground_line(wheel(), 0.02, 0.02), axis=0).T[::-1])
    assert np.abs(np.diff(slope)).max() < 0.015  # where the bases turn by 0.06


def test_positions_are_measured_along_the_ground():
    layout, radius, step = wheel(), 0.35, 0.06
    half = np.arcsin(0.5 * 0.0075 / radius)
    arcs = radius * (step - 2.0 * half) + 0.0075
    np.testing.assert_allclose(np.diff(positions_along(layout)), arcs, rtol=1e-4)
    slope = de.Layout.uniform(9, pitch=0.02, slope=0.1)
    np.testing.assert_allclose(positions_along(slope), 0.02 * np.arange(9), atol=1e-15)


def test_figures_show_the_ground_from_edge_to_edge():
    axes = de.Layout.uniform(5, pitch=0.02, slope=0.1).plot().axes[0]
    x, z = axes.get_lines()[0].get_data()
    assert (x[0], x[-1]) == axes.get_xlim()
    assert axes.get_ylim()[0] < z.min() < z.max() < axes.get_ylim()[1]


@pytest.mark.parametrize("layout", [LAYOUT, wheel()], ids=["uneven", "wheel"])
def test_every_picture_stands_on_its_ground(layout):
    """Nothing is drawn below the line, and the line is there."""
    tall = float(layout.height.max())
    scale = Scale.fitting(layout.length, tall, 600, 150, relief(layout))
    (leans,) = stack_leans(layout, np.array([layout.count - 1]), layout.tilt[-1:])
    image = draw_strip(layout, leans, 0, scale, "")
    drawn = (np.asarray(image) != BACKGROUND).any(axis=2)
    lowest = drawn.shape[0] - 1 - np.argmax(drawn[::-1], axis=0)
    line = ground_line(layout)
    x = 20.0 + (line[:, 0] + 1.2 * layout.thickness[0]) * scale.pixels
    first = 20.0 + 1.2 * layout.thickness[0] * scale.pixels
    inside = np.arange(int(first) + 8, int(x[-1]))  # beyond the triangle under it
    z = np.interp(inside, x, line[:, 1]) * scale.pixels
    error = lowest[inside] + z - np.median(lowest[inside] + z)
    assert np.abs(error).mean() < 1.0
    assert np.abs(error).max() < 3.5


def test_dominoes_of_a_figure_stand_on_the_ground_line():
    axes = LAYOUT.plot().axes[0]
    line = axes.get_lines()[0].get_xydata()
    dominoes = [path.vertices for path in axes.collections[0].get_paths()]
    assert len(dominoes) == LAYOUT.count
    for corners in dominoes:
        for x, y in corners[[0, 3]]:
            assert np.interp(x, *line.T) == pytest.approx(y, abs=0.01)


def test_the_line_follows_the_ground_ahead_of_a_layout():
    ground = de.load_scene("hills").ground
    layout = ground.layout([0.012] * 9, [0.0075] * 10)
    x, z = ground_line(layout, ahead=0.5, ground=ground).T
    ahead = x > layout.pivots[-1, 0]
    assert ahead.sum() > 100
    assert np.ptp(z[ahead]) > 0.01
    assert z[ahead] == pytest.approx(ground.height(x[ahead]) - ground.height(0.0), abs=1e-12)
