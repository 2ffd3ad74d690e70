"""Write the templates of docs/templates for common sizes of dominoes: python docs/templates.py.

For each size, the rows of `course` with the best gaps that a search finds (for the size of the
scene the best known ones), and with the best equal gaps.
"""

from __future__ import annotations

from pathlib import Path

import domino_env as de
from domino_env.view.template import write_template
from optimize import best_known, search

FOLDER = Path(__file__).parent / "templates"
SIZES = ((48.0, 24.0, 7.5), (44.0, 22.0, 7.0), (50.0, 25.0, 10.0))  # [mm] height, width, thickness
SAFETY = 400.0  # [mm] of the row between safety gaps


def main() -> None:
    """Search for the best rows, and write a template of each row."""
    course = de.load_scene("course")
    FOLDER.mkdir(exist_ok=True)
    for size in SIZES:
        height, width, thickness = (1e-3 * value for value in size)
        scene = course.replace(
            height=height, width=width, thickness=(thickness, thickness), first_thickness=thickness
        )
        is_shipped = scene == course
        best = best_known()["course"].layout if is_shipped else search(scene).layout
        words = "×".join(f"{value:g}" for value in size)
        for name, layout in (("best", best), ("equal", scene.uniform().layout)):
            wave = scene.simulate(layout)
            title = (
                f"60 dominoes of {words} mm over 1.2 m, {name} gaps: {wave.arrival_times[-1]:.3f} s"
            )
            file = FOLDER / f"course-{words.replace('×', 'x')}-{name}.pdf"
            write_template(layout, file, title=title, physics=scene.physics, safety=SAFETY)
            print(f"{file}: {title}, {file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
