"""The documentation: its examples run, its commands exist, its pictures are there."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_examples_run(page: Path) -> None:
    names: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
        exec(compile(code, str(page), "exec"), names)


def test_commands_exist() -> None:
    document = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    known = set(document["project"]["entry-points"]["domino.commands"])
    told = {
        name
        for page in PAGES
        for name in re.findall(r"(?:^|`)domino ([a-z-]+)", page.read_text("utf-8"), re.MULTILINE)
    }
    assert told
    assert told <= known


def test_pictures_are_there_or_drawn() -> None:
    from domino_env.look.seed_figures import FIGURES

    for page in PAGES:
        for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page.read_text("utf-8")):
            path = Path(target)
            assert (page.parent / path).exists() or path.stem in FIGURES, f"{page.name}: {target}"
