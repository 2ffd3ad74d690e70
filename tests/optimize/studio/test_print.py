"""Printed rows: what stands beside the seams of strips, and numbers out of range."""

import numpy as np
import pytest
from page_modules import FOLDER, run_javascript, sizes

import domino_env as de

PRINT = f'const {{ printPages, stripSvg }} = await import("{FOLDER.as_posix()}/print.js");'


def test_every_gap_and_domino_has_its_number_at_any_seam():
    rng = np.random.default_rng(1)
    layouts = [de.Layout(rng.uniform(0.004, 0.03, rng.integers(20, 80)), 0.0075) for _ in range(40)]
    layouts += [de.Layout([0.0123] * count, 0.0075) for count in range(10, 60)]  # by chance full
    answers = run_javascript(
        PRINT + """answer(data.map((sizes) => ["a4", "roll"].map((paper) => {
          const row = { name: "", layout: layoutOf(sizes), designed: 1e9, start: "push" };
          return printPages([row], { paper }).map((page) => page.svg).join("");
        })));""",
        [sizes(layout) for layout in layouts],
    )  # fmt: skip
    seams = 0
    for layout, pages in zip(layouts, answers, strict=True):
        for svg in pages:
            texts = [part.partition(">") for part in svg.split("<text ")[1:]]
            words = [(head, text.partition("<")[0]) for head, _, text in texts]
            gaps = [text for head, text in words if 'class="gap"' in head]
            assert gaps == [f"{1e3 * gap:.1f}" for gap in layout.spacing]
            numbers = [int(text) for _, text in words if text.isdigit()]
            assert sorted({*numbers}) == list(range(1, layout.count + 1))
            assert len(numbers) == svg.count('class="domino"')
            seams += len(numbers) - layout.count
        if 1e3 * layout.length < 4000.0:
            assert "strip 2" not in pages[1]  # a roll is as long as the row
    assert seams > 10


@pytest.mark.parametrize(("options", "expected"), [
    ("tolerance: NaN", "slots larger by = nan mm: give a finite number, at least 0"),
    ("tolerance: -5", "slots larger by = -5 mm: give a finite number, at least 0"),
    ("piece: NaN", "longest piece = nan mm: give a finite number, more than 0"),
    ("safety: -1", "safety gap every = -1 mm: give a finite number, at least 0"),
])  # fmt: skip
def test_a_number_out_of_range_is_rejected(options, expected):
    row = sizes(de.Layout([0.0145] * 20, 0.0075))
    script = f"answer(message(() => stripSvg(layoutOf(data), {{ {options} }})));"
    assert run_javascript(PRINT + script, row) == f"RangeError: {expected}"
