"""The documentation: its examples run, its pictures are there."""

import re
import warnings
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
from threadpoolctl import threadpool_limits

from optimize.experiments.best_known import best_known
from optimize.methods.registry import METHODS

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").glob("*.md"))
OPTIMISERS = ROOT / "docs" / "your-own-optimiser.md"  # of packages that need not be there
DATASET = ROOT / "docs" / "dataset.md"  # the same, and writes: tests/agents/test_dataset.py
SECTIONS = [s for s in OPTIMISERS.read_text("utf-8").split("\n## ") if "```python" in s]


def run_examples(text: str, names: dict[str, object]) -> None:
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(code, text.partition("\n")[0], "exec"), names)


@pytest.mark.parametrize(
    "page", [p for p in PAGES if p not in (OPTIMISERS, DATASET)], ids=lambda page: page.stem
)
def test_examples_run(page: Path) -> None:
    run_examples(page.read_text("utf-8"), {})


@pytest.mark.parametrize("section", SECTIONS, ids=lambda text: text.partition("\n")[0])
def test_every_optimiser_beats_equal_gaps_as_it_is_written(section: str) -> None:
    warnings.simplefilter("ignore")  # theirs
    for package in re.findall(
        r"^(?:from|import) (?:optimize\.adapters\.)?(\w+)", section, re.MULTILINE
    ):
        pytest.importorskip(package, reason=f"needs {package}")
    names: dict[str, object] = {}
    run_examples(SECTIONS[0], names)
    with threadpool_limits(1, user_api="blas"):
        run_examples(section, names)
    if "best" in names:
        assert names["problem"].evaluate(names["best"]).score > 1.005 * names["mark"].score


def test_a_scene_has_a_page_with_its_row_drawn_and_numbers_from_the_data(pages: ModuleType) -> None:
    record = best_known()["course"]
    text = pages.scene_page("course", record)
    assert f"**{record.score:.6f} m/s**" in text
    for name, dominoes in (("to scale", 60), ("gap in front", 59)):
        (drawn,) = (line for line in text.splitlines()[9:] if name in line and "<svg" in line)
        shapes = [e for e in ElementTree.fromstring(drawn).iter() if e.tag in ("polygon", "rect")]
        assert len(shapes) == dominoes
    assert (ROOT / "domino_env" / "scenes" / "shipped" / "course.toml").read_text(
        "utf-8"
    ).rstrip() in text


def test_every_method_has_a_section(pages: ModuleType) -> None:
    text = pages.methods_page()
    assert all(f"## `{name}`\n\n" in text for name in METHODS)


def test_pictures_are_there_or_drawn() -> None:
    from domino_env.validation.chapman import FIGURES

    for page in PAGES:
        for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page.read_text("utf-8")):
            path = Path(target)
            assert (page.parent / path).exists() or path.stem in FIGURES, f"{page.name}: {target}"
