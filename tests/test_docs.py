"""The documentation: its code, scenes and commands run; the files that it links exist."""

import fnmatch
import io
import re
import shlex
import shutil
import sqlite3
import tomllib
import warnings
from contextlib import closing, nullcontext, redirect_stdout
from importlib.metadata import metadata
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest
from threadpoolctl import threadpool_limits

import agents
import domino_env as de
import optimize
from agents.algorithms import default_hyperparameters
from domino_env.cli.main import PURPOSES, build_parser, main
from domino_env.core import checks
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import scene_from_document
from domino_env.view.sound import clicks, write_wav

ROOT = Path(__file__).resolve().parents[1]
PAGES = {p.name: p.read_text("utf-8") for p in [ROOT / "README.md", *ROOT.glob("docs/*.md")]}
README, OPTIMISERS = PAGES["README.md"], PAGES["your-own-optimiser.md"]
SECTIONS = [s for s in OPTIMISERS.split("\n## ") if "```python" in s]
SNIPPETS = re.compile(r"```python\n(.*?)```", re.DOTALL)
FENCED = re.compile(r"^```([a-z]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def commands(page):
    """Return the lines of a page's code that begin with `domino`, without their comments."""
    code = "".join(text for language, text in FENCED.findall(PAGES[page]) if language in ("", "sh"))
    lines = re.findall(r"^domino .*", code, re.MULTILINE)
    return [line.partition(" #")[0].strip() for line in lines]


# Changes of commands so that each takes about a second; the last value of an option counts.
CHANGED = {
    r" --(workers \d+|dask local)": "",  # tests/optimize/test_executors.py
    "=0:0.5:11": "=0:0.5:2",
    "verify runs/sprint/layout.csv": "verify short.csv",
    "benchmark varied": "benchmark sprint",  # tests/agents/test_benchmark.py
}
ADDED = {
    "domino optimize": "--budget 20",
    "domino sweep": "--budget 1",
    "domino compare .* --budget": "--budget 20 --seeds 1",
    "domino compare .*agent:": "--seconds 0.05 --seeds 1 --methods auto,agent:sprint",
    "domino compare sprint --seconds": "--seconds 0.05 --seeds 1 --methods auto,cma,slsqp",
    "domino compare": "--seconds 0.05 --seeds 1",
    "domino benchmark [a-z]": "--algorithms ramp --seeds 1 --out runs/made",
    "domino benchmark": "sprint --algorithms ramp --seeds 1 --out runs/made",
    "domino evaluate .*--scenes": "--scenes 2",
    "domino verify": "--no-engine --floor 0.5",
    "domino accuracy": "--quick --seconds 0.01",
    "domino render .*--gif": "--rate 2",
}
"""First pattern that fits the beginning of a command, and the options that it gets."""
PARSED = {
    "benchmark --check": "a table of the reader, see tests/agents/test_benchmark.py",
    "accuracy --stability": "minutes",
    "--update": "changes files of the package",
    "--dask tcp:": "a scheduler of the reader",
    "domino measure": "recordings of the reader, see tests/domino_env/validation",
    "calibrated.toml": "a file of domino measure",
    "source.toml": "a file of domino measure",
    "model.zip": "a model of the reader, see tests/agents/test_policy.py",
    "domino studio": "opens a browser, see tests/optimize/studio/test_page.py",
    "domino train draw": "minutes, see tests/agents/test_draw.py",
    "domino train tempo-noise": "minutes, see tests/agents/test_draw.py",
    "domino dataset": "half an hour, see tests/agents/test_dataset.py",
}
"""Parts of commands that are parsed only, and the reasons."""


def few_steps(algorithm, target):
    """Return hyperparameters of a training that takes a second."""
    return default_hyperparameters(algorithm, target).replace(num_envs=2, steps=160)


@pytest.fixture(scope="module")
def prepared_folder(tmp_path_factory):
    """A folder with the files and the earlier runs that the commands name."""
    folder = tmp_path_factory.mktemp("prepared_folder")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr("agents.training.default_hyperparameters", few_steps)
        patch.setattr("domino_env.core.plot_style.png", lambda _: b"")
        assert run("domino optimize sprint --budget 20") == 0
        assert run("domino train sprint --algorithm apg") == 0
        assert run("domino sweep sprint --set physics.friction=0,0.1 --budget 1") == 0
    for name in ("my-row.toml", "my.toml"):
        scenes = ROOT / "domino_env" / "scenes" / "shipped"
        shutil.copy(scenes / "sprint-thickness.toml", folder / name)
    shutil.copy(folder / "runs" / "sprint" / "layout.csv", folder / "LAYOUT.csv")
    de.Layout.uniform(8, pitch=0.024).to_csv(folder / "short.csv")
    wave = de.simulate(de.Layout.uniform(60, pitch=0.024), de.Physics(push=8.0))
    write_wav(clicks(wave), folder / "recording.wav")
    (method,) = (code for code in SNIPPETS.findall(OPTIMISERS) if "def run(evaluator" in code)
    (folder / "my_methods.py").write_text(method)
    return folder


def run(line):
    """Return the exit status of a command, whose output may go to a file."""
    command, _, file = line.partition(" > ")
    output = io.StringIO()
    with redirect_stdout(output) if file else nullcontext():
        status = main(shlex.split(command)[1:])
    if file:
        Path(file.strip()).write_text(output.getvalue(), "utf-8")
    return status


# Python -----------------------------------------------------------------------------------------


PACKAGES = {"stable_baselines3": "stable_baselines3", "minari": "minari"}


def run_examples(text, names):
    for code in SNIPPETS.findall(text):
        for words, package in PACKAGES.items():
            if words in code:
                pytest.importorskip(package)
        short = code.replace("learn(100_000)", "learn(1)").replace("n_steps=128", "n_steps=8")
        exec(short, names)


@pytest.mark.parametrize("page", sorted(set(PAGES) - {"your-own-optimiser.md"}))
def test_examples_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "")  # an example sets it
    names = {}
    run_examples(PAGES[page], names)
    if page == "README.md":
        assert f"# gain {names['info']['gain']:+.2%}; the best known layout: +3.18%" in README


@pytest.mark.parametrize("section", SECTIONS, ids=lambda text: text.partition("\n")[0])
def test_every_optimiser_example_beats_equal_gaps(section):
    warnings.simplefilter("ignore")  # warnings of third-party packages
    for package in re.findall(r"^(?:from|import) (\w+)", section, re.M):
        pytest.importorskip(package, reason=f"needs {package}")
    names = {}
    run_examples(SECTIONS[0], names)
    with threadpool_limits(1, user_api="blas"):
        run_examples(section, names)
    if "best" in names:
        assert names["problem"].evaluate(names["best"]).score > 1.005 * names["baseline"].score


# commands ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)])
def test_the_commands_of_a_page_run(page, prepared_folder, tmp_path, monkeypatch):
    folder = shutil.copytree(prepared_folder, tmp_path / "prepared_folder")
    monkeypatch.chdir(folder)
    monkeypatch.setattr("agents.training.default_hyperparameters", few_steps)
    monkeypatch.setattr("domino_env.core.plot_style.png", lambda _: b"")  # rendered elsewhere
    for line in commands(page):
        if any(part in line for part in PARSED) or ("parquet" in line and not find_spec("pyarrow")):
            continue
        if first := re.match(r"domino (optimize|train) (\S+)(?!.*--resume)", line):
            run_name = first[2] + "-*" * (first[1] == "train")
            for earlier in (folder / "runs").glob(run_name):  # the reader has none
                shutil.rmtree(earlier)
        added = (options for start, options in ADDED.items() if re.match(start, line))
        shorter = f"{line} {next(added, '')}"
        for pattern, replacement in CHANGED.items():
            shorter = re.sub(pattern, replacement, shorter)
        assert run(shorter) == 0, line


def test_commands_in_sentences_exist():
    known = {name for names in PURPOSES.values() for name in names.split()} | {"--help"}
    paths = [*ROOT.glob(".github/**/*.yml"), ROOT / "CONTRIBUTING.md"]
    for folder in ("docs", "examples", "domino_env", "optimize", "agents"):
        paths += [
            p
            for kind in ("md", "ipynb", "py", "js", "html")
            for p in (ROOT / folder).rglob(f"*.{kind}")
        ]
    for path in paths:
        found = {*re.findall(r"`domino ([a-z-]+)", path.read_text("utf-8"))}
        assert found <= known, (path, found - known)


def test_the_query_of_a_store_runs(prepared_folder, monkeypatch):
    monkeypatch.chdir(prepared_folder)
    (command,) = re.findall(r"^sqlite3 .*?GROUP BY \w+\"$", PAGES["studies.md"], re.M | re.S)
    _, store, query = shlex.split(command)
    with closing(sqlite3.connect(store)) as connection:
        assert [friction for friction, _ in connection.execute(query)] == [0.0, 0.1]


@pytest.mark.parametrize("page", [page for page in PAGES if "```toml" in PAGES[page]])
def test_the_scenes_of_a_page_can_be_read(page):
    for language, text in FENCED.findall(PAGES[page]):
        if language == "toml":
            document = tomllib.loads(text)
            if has_ranges(document):
                de.SceneDistribution(document, page)
            else:
                others = de.load_scene("sprint").document()
                if "stock" in document:
                    del others["thickness"]
                scene_from_document(others | document, page, page)


@pytest.mark.parametrize("page", PAGES)
def test_commands_and_options_in_the_text_exist(page, capsys):
    for line in commands(page):
        build_parser().parse_args(shlex.split(line.partition(" > ")[0])[1:])
    for module in re.findall(r"python -m ([a-z_.]+)", PAGES[page]):
        assert find_spec(module) is not None
    for command in re.findall(r"`domino ([a-z-]+[^`]*)`", FENCED.sub("", PAGES[page])):
        name, *words = command.split()
        with pytest.raises(SystemExit, match="0"):
            build_parser().parse_args([name, "--help"])
        explained = capsys.readouterr().out
        assert all(word in explained for word in words if word.startswith("--"))


def test_targets_and_extras_exist():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    assert set(re.findall(r"(?:^|`)make ([a-z]+)", README, re.MULTILINE)) <= targets
    table = re.findall(r"^\| (`[a-z`, ]+) \|", PAGES["index.md"], re.MULTILINE)
    extras = set(metadata("domino-chains").get_all("Provides-Extra"))
    assert set(re.findall("`([a-z]+)`", " ".join(table))) == extras
    used = re.findall(r"pip install[^\n]* -e \"?\.\[([a-z,]+)\]", "".join(PAGES.values()))
    assert set(",".join(used).split(",")) <= extras
    for text in PAGES.values():
        assert set(re.findall(r"\(extra:? `?([a-z]+)", text)) <= extras


def test_the_address_of_the_code_is_one_constant(pages, monkeypatch):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project.get("urls", {}).get("Repository", "") == checks.CODE_ADDRESS
    config = SimpleNamespace(repo_url="")
    for module in (checks, pages):
        monkeypatch.setattr(module, "CODE_ADDRESS", "https://example.org/code")
    pages.on_config(config)
    lines = (config.repo_url, checks.install_command("rl"), *pages.code_lines())
    assert all("https://example.org/code" in line for line in lines)
    assert "  url = {https://example.org/code}," in pages.citation()


# generated pages --------------------------------------------------------------------------------


def test_generated_tables_and_quoted_numbers_are_up_to_date(pages):
    """`python docs/pages.py` writes them."""
    for path, text in pages.filled_pages().items():
        assert path.read_text("utf-8") == text, f"{path}: run python docs/pages.py"
    with pytest.raises(KeyError, match="nothing"):
        pages.with_numbers("1.0<!--nothing-->", {})
    assert pages.with_numbers("**9.9<!--gain.x--> %**", {"gain.x": "3.2"}).startswith("**3.2")


def test_the_reference_is_complete(pages):
    for package in (de, optimize, agents):
        assert set(pages.public_names(package.__name__)) == set(package.__all__)
        listed = pages.reference_pages(package.__name__)
        assert sorted(name for _, names in listed for name in names) == sorted(package.__all__)
        assert len({title.casefold() for title, _ in listed}) == len(listed)  # files of Windows


GENERATED = {"measured-sources.md", "methods.md", "reference.md", "benchmark.md", "tables.md"}
CONTRIBUTORS = {"architecture.md", "recipes.md", "development.md"}
FILLED = re.compile(r"<!-- \w+ -->\n.*?<!-- end -->", re.DOTALL)  # by `docs/pages.py`
LIMITS = {"users": 17_000, "contributors": 3_100, "generated": 9_000}  # words, code included


def count_words(text):
    """Return the number of words with a letter or a digit."""
    return sum(any(map(str.isalnum, word)) for word in text.split())


def test_pages_are_short():
    words = dict.fromkeys(LIMITS, 0)
    for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        text, reader = path.read_text("utf-8"), "users"
        written = "" if path.name in GENERATED else FILLED.sub("", text)
        if path.name in CONTRIBUTORS:
            reader = "contributors"
        words[reader] += count_words(written)
        words["generated"] += count_words(text) - count_words(written)
    assert all(words[kind] <= limit for kind, limit in LIMITS.items()), words
    assert count_words((ROOT / "CHANGELOG.md").read_text("utf-8")) <= 2_500
    assert PAGES["README.md"].count("\n") <= 100


@pytest.mark.parametrize("path", sorted((ROOT / "docs").rglob("*.md")), ids=lambda path: path.stem)
def test_a_page_names_its_reader_and_the_next_page(path):
    text = path.read_text("utf-8")
    assert re.match(r"(?:---\n.*\n---\n)?# .*\n\nFor ", text), "say for whom it is"
    end = text.rstrip().rpartition("\n\n")[2]
    assert re.search(r"Continue with[^.]*\]\(", end), "say where to go next"
    if path.name not in GENERATED:
        assert FILLED.sub("", text).count("\n") <= 150


@pytest.mark.parametrize("page", PAGES)
def test_a_code_host_shows_no_raw_markup(page):
    assert not re.search(r"^(:::|!!!|\?\?\?) ", FENCED.sub("", PAGES[page]), re.MULTILINE)


def test_links_lead_to_files_of_the_repository():
    pages = {ROOT / ("" if page == "README.md" else "docs") / page: PAGES[page] for page in PAGES}
    index = ROOT / "docs" / "scenes" / "index.md"
    others = {path: path.read_text("utf-8") for path in (index, ROOT / "CONTRIBUTING.md")}
    for path, text in (pages | others).items():
        for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", FENCED.sub("", text)):
            assert (path.parent / target).exists(), f"{path.name}: {target}"


MADE = {"result.png", "runs/NAME", "ppo-sprint.zip"}  # files that commands of these pages write


def test_contributors_are_shown_files_and_names_that_exist():
    folders = ("domino_env", "optimize", "agents", "tests", "docs", "examples", "benchmarks", ".ci")
    paths = [*ROOT.glob("*"), *(path for name in folders for path in (ROOT / name).rglob("*"))]
    names = [f"/{path.relative_to(ROOT).as_posix()}" for path in paths]
    code = [
        path for path in paths if path.suffix in (".py", ".js", ".toml") or path.stem == "Makefile"
    ]
    words = set(re.findall(r"\w+", " ".join(path.read_text("utf-8") for path in code)))
    pages = {name: PAGES[name] for name in CONTRIBUTORS}
    pages["CONTRIBUTING.md"] = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    file = re.compile(r".*/.*|.*\.(py|pyi|md|js|c|html|toml|json|csv|wasm|png|gif|zip|ipynb)")
    for page, text in pages.items():
        for word in set(" ".join(re.findall("`([^`]+)`", FENCED.sub("", text))).split()) - MADE:
            if file.fullmatch(word):
                assert fnmatch.filter(names, f"*/{word.rstrip('/')}"), f"{page}: no file {word}"
            else:
                missing = set(re.findall(r"[A-Za-z_]\w+", word)) - words
                assert not missing, f"{page}: {word}, which the code has not"
