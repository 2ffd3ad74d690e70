"""Chapman's tables and figures."""

from pathlib import Path

import numpy as np

from domino_env.validation.chapman import angular_velocities, frequencies, markdown


def test_the_tables_agree_with_the_independent_solution():
    velocities = np.array(angular_velocities())
    independent = [[13.63153, 17.24773], [14.82572, 21.74023], [14.79539, 24.80159]]
    np.testing.assert_allclose(velocities[:, 1:3], independent, atol=1e-5)
    np.testing.assert_allclose(velocities[:, 3], [15.355, 18.041, 19.385], atol=1e-3)
    np.testing.assert_allclose(velocities[:, 6:8], velocities[:, 1:3], rtol=1e-6)  # closed forms
    with_friction = np.array(frequencies())[:, 1]
    np.testing.assert_allclose(with_friction, [59.87259, 37.22842, 26.25904], atol=1e-5)


def test_the_page_is_up_to_date_and_marks_one_misprint():
    page = Path(__file__).parents[3] / "docs" / "figures" / "tables.md"
    assert page.read_text("utf-8") == markdown(), "run domino figures --out docs/figures"
    assert markdown().count("(17.80*)") == markdown().count("*)") == 1
