"""Public names: the same whatever was imported first, and those that the reference documents."""

from __future__ import annotations

import importlib
import random
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import agents
import domino_env
import optimize

ROOT = Path(__file__).parent.parent
PACKAGES = [domino_env, optimize, agents]
ORDERS = 2  # in which all modules are imported, after the one in which they are found
EXTRAS = {  # what may not be installed, by the names under which it is imported
    "pygame", *(
        re.split(r"\W", requirement.replace("-", "_"))[0]
        for extra in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
            "optional-dependencies"
        ].values()
        for requirement in extra
    ),
}  # fmt: skip
# Ours are fresh in every order; what others wrote, which takes long, is loaded once.
PROGRAM = """
import importlib, sys, types
ours, extras, *orders = (words.split(",") for words in sys.argv[1:])
for order in orders:
    for name in [name for name in sys.modules if name.split(".")[0] in ours]:
        del sys.modules[name]
    for name in order:
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name.split(".")[0] not in extras:
                raise
    package = sys.modules[order[0]]
    for name in package.__all__:
        assert not isinstance(getattr(package, name), types.ModuleType), name
"""


def modules(package: object) -> list[str]:
    folder = Path(package.__file__).parent
    paths = [path.relative_to(folder.parent).with_suffix("") for path in folder.rglob("*.py")]
    names = [".".join(path.parts).removesuffix(".__init__") for path in paths]
    return sorted(name for name in names if not name.endswith("__main__"))


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_has_the_name_of_a_public_function_beside_it(package) -> None:
    assert not {name.split(".")[1] for name in modules(package)[1:]} & set(package.__all__)


def test_public_names_are_themselves_in_every_order_of_imports() -> None:
    orders, rng = [], random.Random(0)
    for package in PACKAGES:
        names = modules(package)
        shuffled = [rng.sample(names, len(names)) for _ in range(ORDERS)]
        orders += [[package.__name__, *order] for order in (names, *shuffled)]
    ours = [package.__name__ for package in PACKAGES]
    words = [",".join(names) for names in (ours, EXTRAS, *orders)]
    subprocess.run([sys.executable, "-c", PROGRAM, *words], check=True)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_loads(package) -> None:
    for name in package.__all__:
        value = getattr(package, name)
        assert getattr(value, "__name__", name) == name
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match=f"No {package.__name__} attribute simulat"):
        package.simulat  # noqa: B018 - reading it is the test


def test_the_reference_shows_public_names() -> None:
    shown = re.findall(r"^::: (\w+)\.(\S+)$", (ROOT / "docs" / "reference.md").read_text(), re.M)
    assert len(shown) > 20
    for package, name in shown:
        assert name in importlib.import_module(package).__all__
