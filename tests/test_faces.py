"""Public names: the same whatever was imported first, and those that the reference documents."""

from __future__ import annotations

import importlib
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

import agents
import domino_env
import optimize

ROOT = Path(__file__).parent.parent
PACKAGES = [domino_env, optimize, agents]
ORDERS = 2  # in which all modules are imported, after the one in which they are found
# these need programs that are not always there, or stay in a loop
NEEDY = {"cluster", "bench", "parzen", "ngopt", "engine", "render", "__main__"}
PROGRAM = """
import importlib, sys, types
package = importlib.import_module(sys.argv[1])
for name in sys.argv[2:]:
    importlib.import_module(name)
for name in package.__all__:
    assert not isinstance(getattr(package, name), types.ModuleType), name
"""


def modules(package: object) -> list[str]:
    folder = Path(package.__file__).parent
    paths = [path.relative_to(folder.parent).with_suffix("") for path in folder.rglob("*.py")]
    names = [".".join(path.parts).removesuffix(".__init__") for path in paths]
    return sorted(name for name in names if name.rpartition(".")[2] not in NEEDY)


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_has_the_name_of_a_public_function_beside_it(package) -> None:
    assert not {name.split(".")[1] for name in modules(package)[1:]} & set(package.__all__)


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_are_themselves_in_every_order_of_imports(package) -> None:
    names, rng = modules(package), random.Random(0)
    orders = [names, *(rng.sample(names, len(names)) for _ in range(ORDERS))]
    words = [[sys.executable, "-c", PROGRAM, package.__name__, *order] for order in orders]
    assert [one.wait() for one in map(subprocess.Popen, words)] == [0] * len(orders)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_loads(package) -> None:
    for name in package.__all__:
        value = getattr(package, name)
        assert getattr(value, "__name__", name) == name
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match=f"'{package.__name__}' has no attribute 'simulat'"):
        package.simulat  # noqa: B018 - reading it is the test


def test_the_reference_shows_public_names() -> None:
    shown = re.findall(r"^::: (\w+)\.(\S+)$", (ROOT / "docs" / "reference.md").read_text(), re.M)
    assert len(shown) > 20
    for package, name in shown:
        assert name in importlib.import_module(package).__all__
