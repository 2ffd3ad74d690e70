"""The documentation: its Python and its commands run as typed, its pictures are there."""

from __future__ import annotations

import re
import shlex
import shutil
import warnings
from dataclasses import replace
from importlib.metadata import metadata
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import pytest
from threadpoolctl import threadpool_limits

import domino_env as de
from agents.algorithms import Hyperparameters, default_hyperparameters
from domino_env.cli.main import main, parser
from domino_env.view.sound import clicks, write_wav
from optimize.experiments.best_known import best_known
from optimize.methods.registry import METHODS

ROOT = Path(__file__).resolve().parents[1]
PAGES = {p.name: p.read_text("utf-8") for p in [ROOT / "README.md", *ROOT.glob("docs/*.md")]}
README, OPTIMISERS = PAGES["README.md"], PAGES["your-own-optimiser.md"]
# of packages that need not be there; what writes data: tests/agents/test_dataset.py
ELSEWHERE = ("your-own-optimiser.md", "dataset.md")
SECTIONS = [s for s in OPTIMISERS.split("\n## ") if "```python" in s]
FENCED = re.compile(r"^```([a-z]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def commands(text: str) -> list[str]:
    """Lines that begin with `domino`, without their comments."""
    lines = re.findall(r"^domino .*", text, re.MULTILINE)
    return [line.partition(" #")[0].strip() for line in lines]


TYPED = ("README.md", "index.md", "simulating.md", "searching.md", "building.md", "physics.md")
TYPED += ("accuracy.md",)
LINES = list(
    dict.fromkeys(
        line
        for page in TYPED
        for language, text in FENCED.findall(PAGES[page])
        if not language
        for line in commands(text)
    )
)
CHEAPER = {
    "domino optimize sprint --resume": "--budget 100",
    "domino optimize course": "--budget 100",
    "domino optimize jitter": "--budget 20",
    "domino optimize my-row.toml": "--budget 50",
    "domino optimize my-row.toml --method scp --budget 5000 --seed 1 --out runs/mine":
        "--budget 50",
    "domino compare sprint --seconds 1": "--seconds 0.05 --methods auto,random",
    "domino compare sprint course --methods auto,cma,l-bfgs,slsqp,scp --seeds 3 --seconds 4":
        "--seeds 1 --seconds 0.05",
    "domino sweep sprint --set physics.friction=0:0.5:11 --workers 4":
        "--workers 1 --budget 1",
    "domino train sprint --algorithm apg": "--out runs/anew",
    "domino render runs/sprint/layout.csv --scene sprint --slow 4 --gif runs/race.gif": "--rate 2",
    "domino verify runs/sprint/layout.csv": "--no-engine --floor 0.5",
    "domino accuracy": "--quick --seconds 0.01 --scene sprint",
}  # fmt: skip
"""What is added to a line so that it takes a second: the last word on an option holds."""
TOO_LONG = {"domino accuracy --stability"}  # minutes


def few_steps(algorithm: str, episode: int, *, sampled: bool = False) -> Hyperparameters:
    """Hyperparameters that learn for a second."""
    chosen = default_hyperparameters(algorithm, episode, sampled=sampled)
    return replace(chosen, num_envs=2, steps=4 * episode)


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that has what the commands speak of: files of the reader's, and earlier runs."""
    folder = tmp_path_factory.mktemp("desk")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr("agents.training.default_hyperparameters", few_steps)
        assert run("domino optimize sprint --budget 50") == 0
        assert run("domino train sprint --algorithm apg") == 0
    shutil.copy(ROOT / "domino_env" / "scenes" / "shipped" / "gentle.toml", folder / "my-row.toml")
    shutil.copy(folder / "runs" / "sprint" / "layout.csv", folder / "LAYOUT.csv")
    row = de.simulate(de.Layout.uniform(60, pitch=0.024), de.Physics(push=8.0))
    write_wav(clicks(row), folder / "recording.wav")
    return folder


def run(line: str) -> int:
    """A command's exit status."""
    return main(shlex.split(line)[1:])


# Python -----------------------------------------------------------------------------------------


def run_examples(text: str, names: dict[str, Any]) -> None:
    for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(code, text.partition("\n")[0], "exec"), names)


@pytest.mark.parametrize("page", sorted(set(PAGES) - set(ELSEWHERE)))
def test_examples_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    run_examples(PAGES[page], names)
    if page == "README.md":
        result = names["result"]
        assert f"# {result.score:.4f} m/s, {result.gain:.1%} over the best equal gaps" in README


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
        assert names["problem"].evaluate(names["best"]).score > 1.005 * names["baseline"].score


# commands ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", LINES)
def test_commands_run_as_typed(line: str, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk)
    monkeypatch.setattr("agents.training.default_hyperparameters", few_steps)
    if line not in TOO_LONG:
        assert run(f"{line} {CHEAPER.get(line, '')}") == 0


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_every_page_exist_with_their_options(
    page: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for line in commands("".join(text for _, text in FENCED.findall(PAGES[page]))):
        parser().parse_args(shlex.split(line)[1:])
    for module in re.findall(r"python -m ([a-z_.]+)", PAGES[page]):
        assert find_spec(module) is not None
    for said in re.findall(r"`domino ([a-z-]+[^`]*)`", FENCED.sub("", PAGES[page])):
        name, *words = said.split()
        with pytest.raises(SystemExit, match="0"):
            parser().parse_args([name, "--help"])
        explained = capsys.readouterr().out
        assert all(word in explained for word in words if word.startswith("--"))


def test_targets_and_extras_exist() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    assert set(re.findall(r"(?:^|`)make ([a-z]+)", README, re.MULTILINE)) <= targets
    table = re.findall(r"^\| (`[a-z`, ]+) \|", PAGES["index.md"], re.MULTILINE)
    extras = set(metadata("domino-chains").get_all("Provides-Extra"))
    assert set(re.findall("`([a-z]+)`", " ".join(table))) == extras
    for text in PAGES.values():
        assert set(re.findall(r"\(extra:? `?([a-z]+)", text)) <= extras


# pages that are made ----------------------------------------------------------------------------


def test_the_table_of_the_readme_is_that_of_the_records(pages: ModuleType) -> None:
    """Otherwise `python docs/pages.py` writes it anew."""
    assert pages.readme_with_table(README) == README


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
    headings = "".join(line for line in text.splitlines() if line.startswith("## "))
    assert all(f"`{name}`" in headings for name in METHODS)


def test_pictures_are_there_or_drawn() -> None:
    from domino_env.validation.chapman import FIGURES

    for page, text in PAGES.items():
        folder = ROOT if page == "README.md" else ROOT / "docs"
        for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
            assert (folder / target).exists() or Path(target).stem in FIGURES, f"{page}: {target}"
