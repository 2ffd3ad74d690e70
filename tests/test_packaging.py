"""Imports, public names, the installed wheel and requirements."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import agents
import domino_env
import optimize

ROOT = Path(__file__).parent.parent
PACKAGES = ("domino_env", "optimize", "agents")
# these tests may themselves run under make, whose options must not reach another make
_SURROUNDINGS = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL")}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def output_of(*words: object, cwd: Path = ROOT, **environment: str) -> str:
    """Return the output of a program that must succeed."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    command = [str(word) for word in words]
    process = subprocess.run(command, cwd=cwd, env=_SURROUNDINGS | environment, **streams)
    assert process.returncode == 0, process.stdout
    return process.stdout


def loaded_by(script: str) -> set[str]:
    """Return the top-level modules (and scipy.optimize) that a script imports."""
    tail = "\nimport sys; print(*sorted(sys.modules))"
    modules = output_of(sys.executable, "-W", "error", "-c", script + tail).split()
    return {m.partition(".")[0] for m in modules} | ({"scipy.optimize"} & set(modules))


def test_importing_the_package_loads_only_gymnasium():
    more = loaded_by("import domino_env") - loaded_by("import gymnasium")
    assert more == {"domino_env", "lazy_loader"}


HELP = """
import contextlib, io, _domino_command as command, sys; sys.argv = ['domino', '--help']
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()): command.main()
assert {"domino_env", "optimize", "agents"} <= sys.modules.keys()
"""


@pytest.mark.parametrize(("script", "heavy"), [
    (HELP, "numpy numba scipy gymnasium torch cvxpy cma matplotlib pygame tqdm"),
    ("import domino_env as de; de.Layout([0.02], 0.0075); de.Physics()", "numba scipy"),
    ("import domino_env as de; s = de.load_scene('sprint'); s.score(s.layout(0.018))",
     "torch cvxpy cma matplotlib pygame scipy.optimize"),
    ("import gymnasium.vector; env = gymnasium.make('domino_env:DominoChain-v2', scene='gentle');"
     "env.reset(); env.step(env.action_space.sample())", "PIL matplotlib pygame"),
    ("import optimize; optimize.search, optimize.METHODS",
     "cma scipy.optimize tqdm matplotlib cvxpy"),
], ids=["help", "layouts", "simulating", "environments", "methods"])  # fmt: skip
def test_modules_that_are_not_needed_are_not_loaded(script, heavy):
    assert not loaded_by(script) & set(heavy.split())


def test_the_command_leaves_the_environments_to_workers_and_to_methods_of_others(tmp_path):
    (tmp_path / "theirs.py").write_text("def run(evaluator, rng): ...")
    script = (
        HELP
        + """
import os, subprocess
child = [sys.executable, "-c", "import domino_env, gymnasium; gymnasium.spec('DominoChain-v2')"]
subprocess.run(child, check=True)
from optimize.methods.registry import load
load("theirs:run")
import gymnasium
gymnasium.spec("DominoChain-v2")
"""
    )
    subprocess.run([sys.executable, "-c", script], check=True, cwd=tmp_path)


# public names -----------------------------------------------------------------------------------


@pytest.mark.parametrize("package", [domino_env, optimize, agents])
def test_every_public_name_loads(package):
    for name in package.__all__:
        value = getattr(package, name)
        assert getattr(value, "__name__", name) == name


# installation -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of the wheel, built in a copy of the working tree: a build leaves files behind."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    litter = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in (*PACKAGES, "tests"):
        shutil.copytree(ROOT / name, source / name, ignore=litter)
    for name in ("pyproject.toml", "README.md", "LICENSE", "_domino_command.py"):
        shutil.copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--no-deps"]
    output_of(*pip, "--no-build-isolation", "--no-index", "--wheel-dir", folder, source)
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_holds_the_packages_with_their_data(wheel):
    archive = zipfile.ZipFile(wheel)
    kept = {name for name in archive.namelist() if ".dist-info/" not in name}
    sources = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert kept == sources | {"_domino_command.py"}
    assert wheel.name.split("-")[1] == domino_env.__version__


def test_an_installed_wheel_works_away_from_the_sources(wheel, tmp_path):
    site, work = tmp_path / "site", tmp_path / "work"
    work.mkdir()
    zipfile.ZipFile(wheel).extractall(site)
    script = (
        "import domino_env as de; print(de.__file__); import optimize, agents;"
        "optimize.search, agents.design; print(*(de.load_scene(n).name for n in de.scene_names()));"
        "from domino_env.cli.main import main; main(['--help'])"
    )
    output = output_of(sys.executable, "-c", script, cwd=work, PYTHONPATH=str(site))
    place, names, *explained = output.splitlines()
    assert place.startswith(str(site))
    assert names.split() == list(domino_env.scene_names())
    assert "simulate" in "".join(explained)


def test_every_requirement_is_pinned_to_the_version_under_test():
    from importlib.metadata import version

    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    pins = dict(line.split("==") for line in lines if line and not line.startswith("#"))
    pins = {canonicalize_name(name): number for name, number in pins.items()}
    extras = {**PROJECT["project"]["optional-dependencies"]}
    for name in ("zoo", "video"):  # one of their requirements excludes that of others
        del extras[name]
    core = [Requirement(text) for text in PROJECT["project"]["dependencies"]]
    groups = {**PROJECT["dependency-groups"]}
    for name in ("compat", "wasm"):  # installed by `make compat` and `make wasm`
        extras[name] = groups.pop(name)
    entries = [entry for group in groups.values() for entry in group]
    tools = [Requirement(entry) for entry in entries if isinstance(entry, str)]
    more = [Requirement(text) for texts in extras.values() for text in texts]
    for requirement in (*core, *tools, *more):
        assert requirement.specifier.contains(pins[canonicalize_name(requirement.name)])
    for requirement in (*core, *tools):
        assert version(requirement.name) == pins[canonicalize_name(requirement.name)]
    hooks = (ROOT / ".pre-commit-config.yaml").read_text("utf-8")
    versions = dict(re.findall(r"pinned: ([\w-]+)\n *rev: v?([\d.]+)", hooks))
    assert {*versions.items()} <= {*pins.items()}
    assert versions.keys() == {"ruff", "import-linter", "codespell"}


def test_everything_is_compiled_through_one_decorator():
    """That decorator also compiles where no folder is writable."""
    sources = [path for name in PACKAGES for path in (ROOT / name).rglob("*.py")]
    plain = re.compile(r"\bn?jit\(|@\S*\bn?jit\b(?!\.)|import n?jit\b|\bcache=True")
    places = {str(path.relative_to(ROOT)) for path in sources if plain.search(path.read_text())}
    assert all(place.startswith("domino_env/kernels/jit/") for place in places), places
