"""The page of published claims: its numbers are those of its program, and of other computations."""

import numpy as np
import oracle
import pytest

import domino_env as de
from domino_env.core.tables import fill_tables


@pytest.fixture(scope="module")
def claims(script):
    return script("docs/claims.py")


@pytest.fixture(scope="module")
def lines(claims):
    return claims.read_lines()


def test_the_page_has_the_numbers_of_its_program(claims, lines):
    """`python docs/claims.py` and `python docs/pages.py` update it."""
    page = claims.PATH.with_suffix(".md").read_text("utf-8")
    assert fill_tables(page, claims.tables(lines)) == page
    stored = claims.PATH.read_text("utf-8").splitlines()
    written = [f"{line['quantity']},,,,{line['value']},," for line in claims.quoted(lines)]
    assert stored[1 : len(written) + 1] == written
    assert len(stored) == 1 + len(written) + len(lines)


def test_free_standing_chains_are_as_the_page_states(claims, lines):
    chosen = [line for line in lines if line["quantity"] in claims.CHAINS]
    assert all((line["gap"] == "3") == (line["toppled"] != "30") for line in chosen)
    speed = np.reshape([float(line["value"]) for line in chosen[:120]], (6, 10, 2))
    slower = np.diff(speed[:, 1:], axis=0) < 0.0  # with more friction
    assert np.argwhere(~slower).tolist() == [[0, 8, 0]]  # a gap of 38 mm, the floor of 0.3
    again = {name: str(value) for name, value in claims.simulate_floor(0.05, 20, 0.3).items()}
    assert again in chosen


def test_fits_are_those_of_numpy(claims):
    x, y = np.log(claims.MEASURED).T
    (slope,), (error,), residual = claims.fit(x[None], y)
    line, covariance = np.polyfit(x, y, 1, cov=True)
    assert (slope, error) == pytest.approx((line[0], np.sqrt(covariance[0, 0])))
    assert residual == pytest.approx(np.sqrt(np.mean((y - np.polyval(line, x)) ** 2)))


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_a_largest_factor_is_that_of_the_oracle(claims, friction):
    best, gap = claims.best_factor(friction)
    for factor, outcome in ((0.99, "PROPAGATED"), (1.01, "STALLED")):
        layout = claims.growing(factor * best, gap, count=8)
        sizes = {"height": layout.height, "rtol": 1e-8}
        wave = oracle.topple(
            layout.spacing, layout.thickness, friction, gravity=1.0, push=3.0, **sizes
        )
        assert wave.outcome == outcome
    pushes = [(count, push) for count in (14, 80) for push in (10.0, 1000.0)]
    for count, push in pushes:
        physics = claims.units(friction, push)
        factor = claims.largest_factor(gap, physics, claims.STANDARD, count)
        assert factor == pytest.approx(best, abs=2e-5)


def test_stones_of_the_height_have_the_speed_of_the_record(claims):
    speed, gap = claims.fastest(0.25)
    height = claims.needed_height(speed)
    assert speed == pytest.approx(
        max(claims.steady_speed(np.linspace(0.01, 0.9, 90), 0.25)), rel=1e-4
    )
    layout = de.Layout.uniform(
        150, spacing=gap * height, thickness=claims.STANDARD * height, height=height
    )
    wave = de.simulate(layout, de.Physics(push=10.0))
    assert wave.local_speed[-1] == pytest.approx(30.0 / 4.21, rel=1e-6)


def test_figures_are_drawn(claims, lines):
    assert len(claims.draw_scaling().axes) == 2
    assert len(claims.draw_floors(lines).axes[0].texts) == 60
    assert len(claims.draw_record().axes[0].lines) == 13
