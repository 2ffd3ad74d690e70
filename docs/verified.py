"""Write the tables of verified.md: ``python docs/verified.py``.

Verifies twenty-four random layouts on fixed pivots and writes them into the page, beside the
verifications of the best known layouts that ``domino best-known --verify --update`` has stored.
``--stored`` leaves the table of the random layouts as it is.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import fill_tables, markdown_table
from domino_env.core.threads import allowed_threads
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, simulate
from domino_env.rigid.known import known_table, percent, read_verified
from domino_env.rigid.verification import Verification, verify
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene

SEED, LAYOUTS = 18, 6
SCENES = ("sprint", "ideal", "gentle", "sprint-thickness")
RTOL = 1e-4
PAGE = Path(__file__).with_suffix(".md")


def random_layouts(scene: Scene, rng: np.random.Generator) -> Iterator[Layout]:
    """Yield random layouts within a scene's bounds whose waves complete."""
    while True:
        thickness = rng.uniform(*scene.thickness, scene.count)
        thickness[0] = scene.first_thickness
        spacing = rng.uniform(*scene.spacing, scene.count - 1)
        layout = Layout(spacing, thickness, scene.height, scene.width, scene.density)
        if simulate(layout, scene.physics).outcome == Outcome.PROPAGATED:
            yield layout


def random_verifications() -> dict[str, Verification]:
    """Verify random layouts of `SCENES`, `LAYOUTS` of each, on fixed pivots and all cores."""
    with ThreadPoolExecutor(allowed_threads()) as pool:
        jobs = {}
        for scene in map(load_scene, SCENES):
            layouts = random_layouts(scene, np.random.default_rng(SEED))
            for k in range(LAYOUTS):
                job = pool.submit(verify, next(layouts), scene.physics, floors=(), rtol=RTOL)
                jobs[f"`{scene.name}`, random {k + 1}"] = job
        return {name: job.result() for name, job in jobs.items()}


def random_table(verifications: dict[str, Verification]) -> list[str]:
    """Return a table of differences from the model and their reasons."""
    names = ("layout", "last hit over model", "largest of any hit", "uncertainty", "verdict")
    lines = []
    for name, verification in verifications.items():
        word, _, rest = verification.verdict.partition(":")
        reason = rest.partition("Why: ")[2].rstrip(".")
        lines.append((
            name, percent(verification.difference), percent(verification.largest_difference),
            percent(verification.fixed.error_estimate, sign=""),
            f"{word.lower()}: {reason}" if reason else word.lower(),
        ))  # fmt: skip
    return markdown_table(names, lines)


def main() -> None:
    """Simulate the layouts and write the tables into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stored", action="store_true", help="write the stored verifications only")
    tables = {"known": known_table(read_verified())}
    if not parser.parse_args().stored:
        tables["random"] = random_table(random_verifications())
    write_text(PAGE, fill_tables(PAGE.read_text("utf-8"), tables))


if __name__ == "__main__":
    main()
