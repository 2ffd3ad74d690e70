"""How kernels are compiled: what is cached, when it is no longer good, and what Python may call."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from resource import RLIMIT_FSIZE, setrlimit

import numpy as np
import pytest

import domino_env
from domino_env import kernels
from domino_env.kernels import chain, quadrature

PROBE = """
from domino_env.kernels.jit import entry_point, noinline
from domino_env.kernels.quadrature import lane_position
from domino_env.kernels.quadrature import ORDERS

@noinline
def beneath(k, j):
    return lane_position(k, j)

@entry_point
def into(k, j):
    return lane_position(k, j)

@entry_point
def across(k, j):
    return beneath(k, j)
"""
ASK = """
import json
from domino_env.kernels.probe import ORDERS, across, into
last = int(ORDERS[0]) + 1
found = {
    "values": [into(0, 1), into(0, last), across(0, 1), across(0, last)],
    "hits": [sum(entry.stats.cache_hits.values()) for entry in (into, across)],
}
print(json.dumps(found))
"""


@pytest.fixture
def copy(tmp_path):
    """A copy of the package, with two more entry points, and what they answer in a new process."""
    package = tmp_path / "domino_env"
    shutil.copytree(
        Path(domino_env.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    (package / "kernels" / "probe.py").write_text(PROBE)

    def ask(*, full_disk=False, **environment):
        done = subprocess.run(
            [sys.executable, "-c", ASK],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path), **environment},
            capture_output=True,
            text=True,
            check=True,
            # no file may grow then: Numba, too, is told as by a disk that is full
            preexec_fn=(lambda: setrlimit(RLIMIT_FSIZE, (0, 0))) if full_disk else None,
        )
        return json.loads(done.stdout), done.stderr

    ask.package = package
    return ask


def edit(file, old, new):
    """Change a line, and nothing that a file's size or its date could tell."""
    text = file.read_text("utf-8")
    assert len(old) == len(new)
    assert text.count(old) == 1
    times = file.stat().st_atime_ns, file.stat().st_mtime_ns
    file.write_text(text.replace(old, new), "utf-8")
    os.utime(file, ns=times)


@pytest.mark.parametrize("folder", ["beside the file", "NUMBA_CACHE_DIR"])
def test_an_edit_of_a_neighbour_compiles_anew(copy, tmp_path, folder):
    chosen = {} if folder == "beside the file" else {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first, _ = copy(**chosen)
    again, _ = copy(**chosen)
    node = first["values"][0]
    assert first == {"values": [node, 1.0, node, 1.0], "hits": [0, 0]}
    assert again == {"values": [node, 1.0, node, 1.0], "hits": [1, 1]}

    edit(copy.package / "kernels" / "quadrature.py", "        return 1.0\n", "        return 3.0\n")
    after, _ = copy(**chosen)
    assert after == {"values": [node, 3.0, node, 3.0], "hits": [0, 0]}

    edit(copy.package / "kernels" / "quadrature.py", "= (x + 1.0) / 2.0,", "= (x + 1.0) / 4.0,")
    after, _ = copy(**chosen)
    assert after["values"] == pytest.approx([node / 2, 3.0, node / 2, 3.0])


def test_where_no_folder_can_be_written_it_compiles_in_memory_and_says_so(copy, tmp_path):
    (copy.package / "kernels" / "__pycache__").write_text("a file where the folder should be")
    nowhere = {"NUMBA_CACHE_DIR": os.devnull, "XDG_CACHE_HOME": os.devnull, "HOME": os.devnull}
    for _ in range(2):
        found, said = copy(**nowhere)
        assert found["values"][1] == 1.0
        assert found["hits"] == [0, 0]
        assert said.count("set NUMBA_CACHE_DIR") == 1


def test_a_full_disk_costs_the_cache_and_not_the_answer(copy):
    found, said = copy(full_disk=True)
    assert found["values"][1] == 1.0
    assert f"compiled code cannot be kept in {copy.package / 'kernels' / '__pycache__'} (" in said
    assert said.count("set NUMBA_CACHE_DIR") == 1


@pytest.mark.parametrize("function", [quadrature.lane_position, chain.chain])
def test_only_entry_points_are_called_from_python(function):
    with pytest.raises(TypeError, match="called by compiled code only"):
        function(*[0] * function.py_func.__code__.co_argcount)


WALK = """
import json, sys
import numba, numpy as np
if sys.argv[1] == "plain":
    numba.version_info = (999, 0)
from domino_env import kernels
from domino_env.kernels import contact, jit
from domino_env.kernels.adjoint import contact as backwards
from domino_env.kernels.contact import contact_at, shape_of, sin_versine

@jit.entry_point
def walk(row, mu, found):
    ring = contact.new_ring(row, 8)
    for i in range(len(row.thickness)):
        contact.place_domino(ring, 7, i, row, i)
    s, v = sin_versine(0.1)
    for i in range(len(row.spacing)):
        contact.place_contact(ring, 7, i, row, i, i + 1)
        shape = shape_of(ring[i])
        s, v, omega, psi, ratio = contact_at(ring[i], s, v, mu)
        back = backwards.tip_back(s, v, shape, mu, 0.1, 0.2, 0.3, 0.4, 0.5)
        found[i, :7] = s, v, omega, psi, ratio, back[0], back[2].gap
    jit.keep_alive(ring)

found = np.zeros((2, 5, 7))
row = np.linspace(0.01, 0.03, 5), np.full(6, 0.0075), np.full(6, 0.048), np.full(6, 1040.0)
walk(kernels.Arrays(*row), 0.3, found[0])
walk(kernels.Arrays(*row, np.linspace(0.0, 0.002, 5), np.linspace(-0.03, 0.03, 6)), 0.3, found[1])
print(json.dumps([found.tolist(), jit._FAST is not None]))
"""


def test_with_a_newer_numba_the_plain_way_gives_the_same():
    results = {}
    for way in ("fast", "plain"):
        done = subprocess.run(
            [sys.executable, "-c", WALK, way], capture_output=True, text=True, check=True
        )
        results[way], fast = json.loads(done.stdout)
        assert fast == (way == "fast")
        assert ("is compiled the plain way" in done.stderr) == (way == "plain")
    np.testing.assert_allclose(results["plain"], results["fast"], rtol=1e-12)


def test_the_face_offers_what_python_may_call():
    functions = [getattr(kernels, name) for name in kernels.__all__ if name.islower()]
    closed = {f.__name__ for f in functions if "refuse" in repr(getattr(f, "_compile_for_args", 0))}
    assert not closed
    assert len(functions) > 10


def test_a_long_row_is_watched_and_diagnosed():
    """Its working arrays are large enough that what is freed too early is gone."""
    row = domino_env.Layout.uniform(3000, pitch=0.016)
    physics = domino_env.Physics(push=8.0)
    assert domino_env.diagnose(row, physics, rtol=1e-4).outcome is domino_env.Outcome.PROPAGATED
    assert domino_env.smallest_push(row, physics, rtol=1e-4) < 8.0
