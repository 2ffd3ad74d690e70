"""Tables and picture of the page docs/verification.md.

``python -m domino_env.validation.verification`` verifies twenty-four random layouts on fixed pivots
and writes them into the page, beside what ``domino best-known --verify --update`` has kept of the
best known layouts, and draws a contact that opens. ``--kept`` leaves the random ones as they are.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import fill, markdown_table
from domino_env.core.threads import allowed_threads
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, simulate
from domino_env.rigid.known import known_table, percent, read_verified
from domino_env.rigid.verification import Verification, verify
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene

SEED, LAYOUTS = 18, 6
SCENES = ("sprint", "ideal", "gentle", "sprint-thickness")
RTOL = 1e-4
FRAMES, HITS = 2000, 9  # of the picture: moments, and hits after the contact has closed
FLOOR = 0.5  # of the picture
PAGE = Path("docs/verification.md")
PICTURE = "opening.png"


def random_layouts(scene: Scene, rng: np.random.Generator) -> Iterator[Layout]:
    """Draw gaps and thicknesses evenly within a scene's bounds, until a wave completes."""
    while True:
        thickness = rng.uniform(*scene.thickness, scene.count)
        thickness[0] = scene.first_thickness
        spacing = rng.uniform(*scene.spacing, scene.count - 1)
        layout = Layout(spacing, thickness, scene.height, scene.width, scene.density)
        if simulate(layout, scene.physics).outcome == Outcome.PROPAGATED:
            yield layout


def random_verifications(
    names: Sequence[str] = SCENES, layouts: int = LAYOUTS, rtol: float = RTOL
) -> dict[str, Verification]:
    """Verify random layouts of some scenes, so many of each, on fixed pivots and all cores."""
    with ThreadPoolExecutor(allowed_threads()) as pool:
        jobs = {}
        for scene in map(load_scene, names):
            drawn = random_layouts(scene, np.random.default_rng(SEED))
            for k in range(layouts):
                job = pool.submit(verify, next(drawn), scene.physics, floors=(), rtol=rtol)
                jobs[f"`{scene.name}`, random {k + 1}"] = job
        return {name: job.result() for name, job in jobs.items()}


def random_table(found: dict[str, Verification]) -> list[str]:
    """Tabulate how far random layouts are from the model, and why."""
    names = ("layout", "last hit over model", "largest of any hit", "uncertainty", "verdict")
    rows = []
    for name, one in found.items():
        word, _, rest = one.verdict.partition(":")
        reason = rest.partition("Why: ")[2].rstrip(".")
        rows.append((
            name, percent(one.difference), percent(one.largest_difference),
            percent(one.fixed.error_estimate, sign=""),
            f"{word.lower()}: {reason}" if reason else word.lower(),
        ))  # fmt: skip
    return markdown_table(names, rows)


def write_opening(checked: Verification, path: Path) -> list[str]:
    """Draw the widest contact that opens over time, and the forces that the model has there."""
    from domino_env.core.colours import BLUE, INK, RED
    from domino_env.core.plot_style import LEGEND, new_figure, style, write_png
    from domino_env.physics.forces import diagnose
    from domino_env.rigid.simulation import in_words, simulate_standing

    wave = checked.wave
    layout, physics, arrivals = wave.layout, wave.physics, wave.arrival_times
    least = diagnose(layout, physics).least_contact_force
    i = min(checked.openings, key=lambda i: float(least[i]))  # that the model pulls at most
    times = np.linspace(arrivals[i + 1], arrivals[min(i + 1 + HITS, layout.count - 1)], FRAMES)
    figure = new_figure(8.0, 5.6)
    above, below = figure.subplots(2, 1)
    style(above, f"gap between dominoes {i} and {i + 1} [mm], over time [s]")
    for floor, colour in ((None, BLUE), (FLOOR, RED)):
        poses = simulate_standing(layout, physics, floor, times=times).poses
        above.plot(times, 1e3 * gap_between(layout, i, poses), color=colour, label=in_words(floor))
    above.axhline(0.0, color=INK, linewidth=0.8)
    above.legend(**LEGEND)
    style(below, "least force of each contact in the model [N]; below 0 it pulls")
    below.bar(np.arange(len(least)), least, color=np.where(least < 0.0, RED, BLUE).tolist())
    below.axhline(0.0, color=INK, linewidth=0.8)
    below.set_xlabel("contact, by the domino behind")
    write_png(figure, path)
    return [
        f"![The gap of a contact that opens, and the forces of the model]({path.name})", "",
        f"The contact between dominoes {i} and {i + 1}, which opens by "
        f"{1e3 * checked.openings[i]:.2g} mm.",
    ]  # fmt: skip


def gap_between(layout: Layout, i: int, poses: Floats) -> Floats:
    """Return the gap (F,) [m] between dominoes i and i+1 at poses (F, N, 3) of `RigidWave`.

    The smaller of two distances, each where its foot is on the face: of the tip of i from the rear
    face of i+1, and of the rear bottom edge of i+1 from the front face of i.
    """
    (x, y, a), (u, v, b) = (np.moveaxis(poses[:, k], -1, 0) for k in (i, i + 1))
    tall, thick = layout.height[i : i + 2], layout.thickness[i + 1]
    across, up = u - x - thick * np.cos(b), v - y + thick * np.sin(b)  # edge from pivot i
    tip_x, tip_y = across - tall[0] * np.sin(a), tall[0] * np.cos(a) - up  # tip to edge, and back
    gaps = np.full(len(poses), np.inf)
    for along, apart, most in (
        (tip_y * np.cos(b) - tip_x * np.sin(b), tip_x * np.cos(b) + tip_y * np.sin(b), tall[1]),
        (across * np.sin(a) + up * np.cos(a), across * np.cos(a) - up * np.sin(a), tall[0]),
    ):
        gaps = np.where((along >= 0.0) & (along <= most), np.minimum(gaps, apart), gaps)
    return np.where(np.isfinite(gaps), np.maximum(gaps, 0.0), 0.0)


def main() -> None:
    """Simulate, tabulate, draw; write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kept", action="store_true", help="only what is kept; nothing random")
    tables = {"known": known_table(read_verified())}
    if not parser.parse_args().kept:
        found = random_verifications()
        tables["random"] = random_table(found)
        name = max(found, key=lambda name: found[name].largest_difference)
        lines = write_opening(found[name], PAGE.with_name(PICTURE))
        tables["opening"] = [*lines[:-1], f"{name}. {lines[-1]}"]
    write_text(PAGE, fill(PAGE.read_text("utf-8"), tables))


if __name__ == "__main__":
    main()
