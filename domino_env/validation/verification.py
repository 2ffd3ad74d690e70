"""The tables and the picture of the page docs/verification.md.

`python -m domino_env.validation.verification` topples twenty-four random rows, hinged, and writes
them into the page, beside what `domino best-known --verify --update` has kept of the best and
uniform rows; and draws the row whose contacts open furthest.  `--engine` asks the rigid-body
engine too: an hour.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table
from domino_env.core.threads import allowed_threads
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, simulate
from domino_env.rigid.built_in import Standing
from domino_env.rigid.comparison import Verification, verify
from domino_env.rigid.judges import Judge
from domino_env.rigid.known import read_verified
from domino_env.rigid.tables import engine_table, floors_table, hinged_table, share, why
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.validation.opening import worst_opening, write_opening

SEED, ROWS = 18, 6
SCENES = ("sprint", "ideal", "gentle", "sprint-thickness")
RTOL = 1e-4
PAGE = Path("docs/verification.md")
PICTURE = "opening.png"
TABLE = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


@dataclass(frozen=True, eq=False)
class RandomRow:
    """A row drawn at random.

    Attributes
    ----------
    name
        Its scene and number.
    scene
        Whose bounds it keeps.
    layout
        The row.
    checked
        What the built-in simulator saw of it, hinged.
    engine
        The same of the rigid-body engine; None where it was not asked.
    """

    name: str
    scene: Scene
    layout: Layout
    checked: Verification
    engine: Verification | None


def random_layouts(scene: Scene, rng: np.random.Generator) -> Iterator[Layout]:
    """Draw gaps and thicknesses evenly within a scene's bounds, until a wave runs through."""
    while True:
        thickness = rng.uniform(*scene.thickness, scene.count)
        thickness[0] = scene.first_thickness
        spacing = rng.uniform(*scene.spacing, scene.count - 1)
        layout = Layout(spacing, thickness, scene.height, scene.width, scene.density)
        if simulate(layout, scene.physics).outcome == Outcome.PROPAGATED:
            yield layout


def random_rows(
    names: Sequence[str] = SCENES,
    rows: int = ROWS,
    seed: int = SEED,
    rtol: float = RTOL,
    engine: Judge | None = None,
) -> list[RandomRow]:
    """Draw rows of some scenes and topple them, hinged, side by side on all cores.

    Parameters
    ----------
    names
        Of the scenes.
    rows
        A scene.
    seed
        Of the draws, the same for every scene.
    rtol
        Relative error asked of the built-in simulator.
    engine
        Asked besides; None for nobody.
    """

    def look(name: str, scene: Scene, layout: Layout) -> RandomRow:
        checked = verify(layout, scene.physics, floors=(), judge=Standing(rtol))
        second = verify(layout, scene.physics, floors=(), judge=engine) if engine else None
        return RandomRow(name, scene, layout, checked, second)

    with ThreadPoolExecutor(allowed_threads()) as pool:
        jobs = []
        for scene in map(load_scene, names):
            drawn = random_layouts(scene, np.random.default_rng(seed))
            jobs += [
                pool.submit(look, f"`{scene.name}`, random {k + 1}", scene, next(drawn))
                for k in range(rows)
            ]
        return [job.result() for job in jobs]


def random_table(rows: Sequence[RandomRow]) -> list[str]:
    """Tabulate how far the random rows are from the model, and why."""
    names = ["row", "last hit", "largest of any hit", "in doubt", "verdict"]
    asked = any(one.engine for one in rows)
    cells = []
    for one in rows:
        told = one.checked
        line = [
            one.name, share(told.difference), f"{told.largest_difference:.3%}",
            share(told.spread, sign=""), why(told.verdict),
        ]  # fmt: skip
        if asked and one.engine:
            second = one.engine
            line.insert(-1, f"{second.largest_difference:.3%} ± {second.spread:.3%}")
        cells.append(line)
    if asked:
        names.insert(-1, "engine, largest")
    return markdown_table(names, cells)


def opening_shown(rows: Sequence[RandomRow], path: Path) -> list[str]:
    """Draw a contact that opens, of the row that is furthest from the model; and say which."""
    one = max(rows, key=lambda row: row.checked.largest_difference)
    opening = worst_opening(one.layout, one.scene.physics)
    write_opening(one.layout, one.scene.physics, opening, path)
    return [
        f"![The gap of a contact that opens, and the forces of the model]({path.name})",
        "",
        f"{one.name}: the contact {opening}.",
    ]


def fill(page: str, tables: dict[str, list[str]]) -> str:
    """Write tables into a page, each between its mark and the next ``<!-- end -->``.

    Raises
    ------
    ValueError
        For a table that the page has no mark for.
    """
    marks = {found[2] for found in TABLE.finditer(page)}
    if missing := set(tables) - marks:
        raise ValueError(f"the page has no mark <!-- {min(missing)} --> with an <!-- end -->")

    def written(found: re.Match[str]) -> str:
        lines = tables.get(found[2])
        return found[0] if lines is None else f"{found[1]}\n" + "\n".join(lines) + f"\n\n{found[3]}"

    return TABLE.sub(written, page)


def kept_tables() -> dict[str, list[str]]:
    """The tables of what is kept of the rows that ship, by their marks."""
    found = read_verified()
    return {
        "floors": floors_table(found),
        "hinged": hinged_table(found),
        "engine": engine_table(found) or ["(not asked since the rows were renewed)"],
    }


def main() -> None:
    """Measure, tabulate, draw; write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", type=Path, default=PAGE, help=f"the page to write into ({PAGE})")
    parser.add_argument("--engine", action="store_true", help="ask the rigid-body engine too")
    parser.add_argument("--kept", action="store_true", help="only what is kept; no random rows")
    parser.add_argument("--random", action="store_true", help="only the random rows")
    arguments = parser.parse_args()
    tables = {} if arguments.random else kept_tables()
    if not arguments.kept:
        engine = None
        if arguments.engine:
            from domino_env.rigid.converging import Engine

            engine = Engine()
        rows = random_rows(engine=engine)
        tables["random"] = random_table(rows)
        tables["opening"] = opening_shown(rows, arguments.page.with_name(PICTURE))
    page = arguments.page.read_text("utf-8")
    write_text(arguments.page, fill(page, tables))


if __name__ == "__main__":
    main()
