"""The README as it is typed: its Python, its commands, its scene; and the commands of the pages."""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import replace
from importlib.metadata import metadata
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import domino_env as de
from agents.algorithms import Hyperparameters, hyperparameters
from domino_env.cli.main import main, parser
from domino_env.view.sound import clicks, write_wav

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
PAGES = {p.name: p.read_text("utf-8") for p in [ROOT / "README.md", *ROOT.glob("docs/*.md")]}
FENCED = re.compile(r"^```([a-z]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def blocks(language: str) -> list[str]:
    """What stands in the README between fences of a language."""
    return [text for word, text in FENCED.findall(README) if word == language]


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
    "domino optimize sprint --resume": "--evaluations 100",
    "domino optimize course": "--evaluations 100",
    "domino optimize jitter": "--evaluations 20",
    "domino optimize my-row.toml": "--evaluations 50",
    "domino optimize my-row.toml --method scp --evaluations 5000 --seed 1 --out runs/mine":
        "--evaluations 50",
    "domino compare sprint --seconds 1": "--seconds 0.05 --methods auto,random",
    "domino compare sprint course --methods auto,cma,l-bfgs,slsqp,scp --seeds 3 --seconds 4":
        "--seeds 1 --seconds 0.05",
    "domino sweep sprint --set physics.friction=0:0.5:11 --workers 4":
        "--workers 1 --evaluations 1",
    "domino train sprint --algorithm apg": "--out runs/anew",
    "domino render runs/sprint/layout.csv --scene sprint --slow 4 --gif runs/race.gif": "--rate 2",
    "domino verify runs/sprint/layout.csv": "--no-engine --floor 0.5",
    "domino accuracy": "--quick --budget 0.01 --scene sprint",
}  # fmt: skip
"""What is added to a line so that it takes a second: the last word on an option holds."""
TOO_LONG = {"domino accuracy --stability"}  # minutes


def few_steps(algorithm: str, episode: int, *, drawn: bool = False) -> Hyperparameters:
    """Hyperparameters that learn for a second."""
    plan = hyperparameters(algorithm, episode, drawn=drawn)
    return replace(plan, rows=2, steps=4 * episode)


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that has what the commands speak of: files of the reader's, and earlier runs."""
    folder = tmp_path_factory.mktemp("desk")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr("agents.training.hyperparameters", few_steps)
        assert run("domino optimize sprint --evaluations 50") == 0
        assert run("domino train sprint --algorithm apg") == 0
    shutil.copy(ROOT / "domino_env" / "scenes" / "shipped" / "gentle.toml", folder / "my-row.toml")
    shutil.copy(folder / "runs" / "sprint" / "layout.csv", folder / "LAYOUT.csv")
    row = de.simulate(de.Layout.uniform(60, pitch=0.024), de.Physics(push=8.0))
    write_wav(clicks(row), folder / "recording.wav")
    return folder


def run(line: str) -> int:
    """A command's exit status."""
    return main(shlex.split(line)[1:])


@pytest.mark.parametrize("line", LINES)
def test_its_commands_run_as_typed(line: str, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk)
    monkeypatch.setattr("agents.training.hyperparameters", few_steps)
    if line not in TOO_LONG:
        assert run(f"{line} {CHEAPER.get(line, '')}") == 0


def test_its_python_runs_and_says_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for code in blocks("python"):
        exec(compile(code, "README.md", "exec"), names)
    result = names["result"]
    assert f"# {result.score:.4f} m/s, {result.gain:.1%} over the best equal gaps" in README
    assert names["rows"].num_envs == 1024


def test_its_table_is_that_of_the_records(pages: ModuleType) -> None:
    """Otherwise `python docs/pages.py` writes it anew."""
    assert pages.readme_with_table(README) == README


def test_the_scene_on_the_page_of_searches_is_one(tmp_path: Path) -> None:
    (asked,) = (text for word, text in FENCED.findall(PAGES["searching.md"]) if word == "toml")
    whole = (ROOT / "domino_env" / "scenes" / "shipped" / "sprint.toml").read_text("utf-8")
    head, *tables = re.split(r"^(?=\[)", whole, flags=re.MULTILINE)
    kept = [t for t in tables if t.split("]")[0] not in ("[spacing", "[thickness")]
    head = re.sub(r"^objective.*", "", head, flags=re.MULTILINE)
    (tmp_path / "mine.toml").write_text(head + asked + "\n" + "".join(kept), "utf-8")
    scene = de.load_scene(tmp_path / "mine.toml")
    assert (scene.objective, scene.largest_change) == ("robust", 0.004)


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_every_page_are_understood(page: str) -> None:
    for line in commands("".join(text for _, text in FENCED.findall(PAGES[page]))):
        parser().parse_args(shlex.split(line)[1:])
    for module in re.findall(r"python -m ([a-z_.]+)", PAGES[page]):
        assert find_spec(module) is not None


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_a_sentence_exist_with_their_options(
    page: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for said in re.findall(r"`domino ([a-z-]+[^`]*)`", FENCED.sub("", PAGES[page])):
        name, *words = said.split()
        with pytest.raises(SystemExit, match="0"):
            parser().parse_args([name, "--help"])
        explained = capsys.readouterr().out
        assert all(word in explained for word in words if word.startswith("--"))


def test_targets_and_extras_exist() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    assert set(re.findall(r"(?:^|`)make ([a-z]+)", README, re.MULTILINE)) <= targets
    extras = set(metadata("domino-chains").get_all("Provides-Extra"))
    table = re.findall(r"^\| (`[a-z`, ]+) \|", PAGES["index.md"], re.MULTILINE)
    told = set(re.findall("`([a-z]+)`", " ".join(table)))
    assert told == extras  # the page that installs knows all
    for text in PAGES.values():
        assert set(re.findall(r"\(extra:? `?([a-z]+)", text)) <= extras
        for listed in re.findall(r"-e \.\[([a-z,]+)\]", text):
            assert set(listed.split(",")) <= extras
