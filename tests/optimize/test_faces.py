"""The public names of the package, whatever was imported first."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import optimize

FOLDER = Path(optimize.__file__).parent
ORDERS = 4  # in which all modules are imported

PROGRAM = """
import importlib, sys, types
import optimize
for name in sys.argv[1:]:
    importlib.import_module(name)
for name in optimize.__all__:
    assert not isinstance(getattr(optimize, name), types.ModuleType), name
"""


def modules() -> list[str]:
    paths = [path.relative_to(FOLDER.parent).with_suffix("") for path in FOLDER.rglob("*.py")]
    names = [".".join(path.parts) for path in paths]
    # three need programs that are not always there
    wanted = {"cluster": "distributed", "bench": "distributed", "parzen": "optuna"}
    wanted["ngopt"] = "nevergrad"
    return sorted(name.removesuffix(".__init__") for name in names
                  if name.rpartition(".")[2] not in wanted)  # fmt: skip


def test_no_module_has_the_name_of_a_public_function() -> None:
    last = {name.rpartition(".")[2] for name in modules()}
    assert not last & set(optimize.__all__)


def test_public_names_are_themselves_in_every_order_of_imports() -> None:
    names, rng = modules(), random.Random(0)
    running = []
    for _ in range(ORDERS):
        rng.shuffle(names)
        running.append(subprocess.Popen([sys.executable, "-c", PROGRAM, *names]))
    assert [one.wait() for one in running] == [0] * ORDERS
