"""The known limit of the model, in a picture: a row whose contacts open for real."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.colours import BLUE, INK, RED
from domino_env.core.plot_style import LEGEND, new_figure, style, write_png
from domino_env.physics.forces import diagnose
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate
from domino_env.rigid.judges import in_words
from domino_env.rigid.opening import Opening, link_gap, openings
from domino_env.standing.simulation import simulate_standing

Floats = NDArray[np.float64]

FRAMES = 2000
FLOOR = 0.5
HITS = 9  # after the contact has closed, that are shown


def worst_opening(layout: Layout, physics: Physics) -> Opening:
    """Find the contact that the model holds closed with the largest pull, of those that open.

    Raises
    ------
    ValueError
        Where none opens.
    """
    found = openings(layout, physics)
    if not found:
        raise ValueError("no contact of this row opens that the model keeps closed")
    least = diagnose(layout, physics).least_contact_force
    return min(found, key=lambda one: float(least[one.link]))


def write_opening(layout: Layout, physics: Physics, opening: Opening, path: Path) -> None:
    """Draw the gap of a link over time, hinged and standing, and the forces that the model has."""
    i = opening.link
    arrivals = simulate(layout, physics).arrival_times
    times = np.linspace(arrivals[i + 1], arrivals[min(i + 1 + HITS, layout.count - 1)], FRAMES)
    figure = new_figure(8.0, 5.6)
    above, below = figure.subplots(2, 1)
    style(above, f"gap between dominoes {i} and {i + 1} [mm], over time [s]")
    for floor, colour in ((None, BLUE), (FLOOR, RED)):
        seen = simulate_standing(layout, physics, floor_friction=floor, times=times)
        gaps = 1e3 * link_gap(layout, i, seen.poses)
        above.plot(times, gaps, color=colour, label=in_words(floor))
    above.axhline(0.0, color=INK, linewidth=0.8)
    above.set_ylim(bottom=-0.05 * above.get_ylim()[1])
    above.legend(**LEGEND)
    style(below, "least force of each contact in the model [N]; below 0 it pulls")
    least = diagnose(layout, physics).least_contact_force
    colours = [RED if force < 0.0 else BLUE for force in least]
    below.bar(np.arange(len(least)), least, color=colours)
    below.axhline(0.0, color=INK, linewidth=0.8)
    below.set_xlabel("contact, by the domino behind")
    write_png(figure, path)
