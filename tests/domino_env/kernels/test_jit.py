"""Compilation of kernels: the cache, when it is outdated, and what Python may call."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.kernels import chain, quadrature

ROOT = Path(de.__file__).parents[1]
PROBE = """
from domino_env.kernels.contact import at_or_zero
from domino_env.kernels.jit import entry_point, noinline
from domino_env.kernels.quadrature import NODES

@noinline
def inner(values):
    return NODES[0, 0], at_or_zero(values, 0)

@entry_point
def direct(values):
    return NODES[0, 0], at_or_zero(values, 0)

@entry_point
def nested(values):
    return inner(values)
"""
CALL = """
import json
from domino_env.kernels.jit.interpreted import compiled
from domino_env.kernels.probe import direct, nested
with compiled():
    values = [*direct(None), *nested(None)]
result = {
    "values": values,
    "hits": [sum(entry.stats.cache_hits.values()) for entry in (direct, nested)],
}
print(json.dumps(result))
"""


def no_file_may_grow():
    from resource import RLIMIT_FSIZE, setrlimit

    setrlimit(RLIMIT_FSIZE, (0, 0))


def start(code, *arguments, root=ROOT, folder=None, full_disk=False, **environment):
    """Start Python in a new process, which imports the package of a folder.

    The working folder has a cache of the functions of `code`.
    """
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = os.environ | {"PYTHONPATH": str(root)} | environment
    before = no_file_may_grow if full_disk else None
    program = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(
        program, cwd=folder or root, env=environment, preexec_fn=before, **pipes
    )


@pytest.fixture
def copy(tmp_path):
    """A copy of the package with two more entry points; a call returns their results."""
    package = tmp_path / "domino_env"
    litter = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "domino_env", package, ignore=litter)
    (package / "kernels" / "probe.py").write_text(PROBE)

    def call(**options):
        output, errors = start(CALL, root=tmp_path, **options).communicate()
        return json.loads(output), errors

    call.package = package
    return call


def edit(file, old, new):
    """Change a line without a change of the size or date of the file."""
    text = file.read_text("utf-8")
    assert len(old) == len(new)
    assert text.count(old) == 1
    times = file.stat().st_atime_ns, file.stat().st_mtime_ns
    file.write_text(text.replace(old, new), "utf-8")
    os.utime(file, ns=times)


def test_an_edited_dependency_is_compiled_again(copy, tmp_path):
    first, _ = copy()
    node = first["values"][0]
    assert first == {"values": [node, 0.0, node, 0.0], "hits": [0, 0]}
    assert copy()[0] == {"values": [node, 0.0, node, 0.0], "hits": [1, 1]}

    edit(copy.package / "kernels" / "contact.py", "        return 0.0\n", "        return 3.0\n")
    chosen = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for folder, hits in (({}, 0), (chosen, 0), (chosen, 1)):
        assert copy(**folder)[0] == {"values": [node, 3.0, node, 3.0], "hits": [hits, hits]}

    edit(copy.package / "kernels" / "quadrature.py", "= (x + 1.0) / 2.0,", "= (x + 1.0) / 4.0,")
    after, _ = copy(**chosen)
    assert after["values"] == pytest.approx([node / 2, 3.0, node / 2, 3.0])


@pytest.mark.skipif(os.name == "nt", reason="no limit of the size of files there")
def test_compilation_without_a_writable_folder_gives_a_warning(copy):
    cache = copy.package / "kernels" / "__pycache__"
    full, errors = copy(full_disk=True)
    assert f"compiled code cannot be kept in {cache} (" in errors
    shutil.rmtree(cache, ignore_errors=True)
    cache.write_text("a file where the folder should be")
    nowhere = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"), os.devnull)
    result, warnings = copy(**nowhere)
    for values, printed in ((full["values"], errors), (result["values"], warnings)):
        assert values[1] == 0.0
        assert printed.count("set NUMBA_CACHE_DIR") == 1
    assert result["hits"] == [0, 0]


DOUBLE = """
import numba, sys
if sys.argv[1] == "plain":
    numba.version_info = (999, 0)
from domino_env.kernels.jit import entry_point
from domino_env.kernels.jit.interpreted import compiled

def double(x):
    return 2.0 * x

def call():
    entry = entry_point(double)  # without machine code in memory
    with compiled():
        assert entry(3.0) == 6.0
    return sum(entry.stats.cache_hits.values())
"""
DAMAGE = """
import numpy as np, sys
from pathlib import Path
from cached import call

def damaged_contents(data):
    yield from (data[:length] for length in np.linspace(0, len(data) - 1, 2).astype(int))
    middle = len(data) // 2
    yield data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]
    yield b"N."  # None, pickled

assert (call(), call()) == (0, 1)
index, code = (next(Path(sys.argv[2]).rglob(f"*double*{kind}")) for kind in (".nbi", ".nbc"))
for path in (index, code):
    for content in damaged_contents(path.read_bytes()):
        path.write_bytes(content)
        assert (call(), call()) == (0, 1), (path, len(content))
    path.unlink()
    path.mkdir()  # compiled, and not cached
    assert (call(), call()) == (0, 0)
    path.rmdir()
    assert (call(), call()) == (0, 1)
"""


@pytest.mark.parametrize("way", ["fast", "plain"])
def test_damaged_files_of_the_cache_are_compiled_again(tmp_path, way):
    (tmp_path / "cached.py").write_text(DOUBLE)

    def run(code):
        search_path = f"{ROOT}{os.pathsep}{tmp_path}"
        folder = str(tmp_path)
        return start(code, way, folder, NUMBA_CACHE_DIR=folder, PYTHONPATH=search_path)

    _, errors = run(DAMAGE).communicate()
    assert "Traceback" not in errors, errors
    assert errors.count("compiled code cannot be kept") == 1
    for path in tmp_path.rglob("*.nb[ic]"):
        path.write_bytes(b"")
    both = [run("from cached import call; print(call(), call())") for _ in range(2)]
    for process in both:
        output, errors = process.communicate()
        assert output in ("0 1\n", "1 1\n"), errors


@pytest.mark.parametrize("function", [quadrature.series, chain.chain])
def test_only_entry_points_are_called_from_python(function):
    with pytest.raises(TypeError, match="called by compiled code only"):
        function(*[0] * function.py_func.__code__.co_argcount)


WALK = """
import json, sys
import numba, numpy as np
if sys.argv[1] == "plain":
    numba.version_info = (999, 0)
if sys.argv[1] == "broken":  # what only the fast compilation does
    from numba.core.compiler_machinery import PassManager
    finalize = PassManager.finalize
    def finalize_once(self):
        assert not self.finalized, "passes cannot be changed"
        finalize(self)
    PassManager.finalize = finalize_once
from domino_env.kernels import arrays, contact, jit
from domino_env.kernels.contact import contact_at, sin_versine
from domino_env.kernels.jit.interpreted import compiled

@jit.entry_point
def walk(row, mu, result):
    ring = contact.new_ring(row, 8)
    for i in range(len(row.thickness)):
        contact.place_domino(ring, 7, i, row, i)
    s, v = sin_versine(0.1)
    for i in range(len(row.spacing)):
        contact.place_contact(ring, 7, i, row, i, i + 1)
        s, v, omega, psi, ratio = contact_at(ring[i], s, v, mu)
        result[i] = s, v, omega, psi, ratio
    jit.keep_alive(ring)

result = np.zeros((5, 5))
row = np.linspace(0.01, 0.03, 5), np.full(6, 0.0075), np.full(6, 0.048), np.full(6, 1040.0)
with compiled():
    walk(arrays.Arrays(*row, np.linspace(0.0, 0.002, 5), np.linspace(-0.03, 0.03, 6)), 0.3, result)
print(json.dumps([result.tolist(), jit._FAST is not None and not jit._plain]))
"""


def test_plain_compilation_gives_the_same_results(tmp_path):
    """It takes over where a part of Numba is missing, even if that is noticed while compiling."""
    processes = {}
    for way in ("fast", "plain", "broken"):
        (tmp_path / way).mkdir()
        processes[way] = start(WALK, way, folder=tmp_path / way)
    results = {}
    for way, process in processes.items():
        output, errors = process.communicate()
        results[way], fast = json.loads(output)
        assert fast == (way == "fast")
        assert errors.count("is compiled by its public functions") == (way != "fast")
    np.testing.assert_allclose(results["plain"], results["fast"], rtol=1e-12)
    assert results["broken"] == results["plain"]


FIRST_CALLS = """
import json, sys
import numpy as np
from domino_env.kernels.jit import borrow, entry_point, interpreted

@entry_point
def count_inverse(x, result):
    result[0] += 1.0
    borrow(result)
    result[1] = 1.0 / x

x, more, interpreted.PATIENCE = map(float, sys.argv[1:])
result = np.zeros(2 + int(more))
count_inverse(x, result)
count_inverse(x, result)
print(json.dumps([*result[:2], len(count_inverse.signatures)]))
"""


@pytest.mark.parametrize(
    ("x", "more_numbers", "patience", "compiled"),
    [(4.0, 0, 100.0, 0), (0.0, 0, 100.0, 1), (4.0, 10_000, 100.0, 1), (4.0, 0, 1e-9, 1)],
    ids=["short", "error in Python", "large arrays", "no time"],
)
def test_python_runs_short_calls(tmp_path, x, more_numbers, patience, compiled):
    (tmp_path / "first_calls.py").write_text(FIRST_CALLS)  # beside it its machine code is cached
    given = map(str, (x, more_numbers, patience))
    code = f"import sys; sys.path.append({str(tmp_path)!r}); import first_calls"
    output, _ = start(code, *given).communicate()
    assert json.loads(output) == [2.0, 1.0 / x if x else np.inf, compiled]


def test_a_long_layout_is_diagnosed():
    # reading arrays of this size after they are freed fails
    layout = de.Layout.uniform(3000, pitch=0.016)
    physics = de.Physics(push=8.0)
    assert de.diagnose(layout, physics, rtol=1e-4).outcome is de.Outcome.PROPAGATED
    assert de.smallest_push(layout, physics, rtol=1e-4) < 8.0


SIMULATE = """
import domino_env as de
from domino_env.kernels.chain import solve_batch
from domino_env.kernels.jit.interpreted import compiled
with compiled():
    de.simulate(de.Layout.uniform(5, pitch=0.02))
print(sum(solve_batch.stats.cache_hits.values()))
"""


def test_of_two_processes_one_compiles_and_both_tell_the_user(tmp_path):
    def start_one():
        return start(SIMULATE, NUMBA_CACHE_DIR=str(tmp_path))

    both = [process.communicate() for process in (start_one(), start_one())]
    (compiled, told), (loaded, waited) = sorted(both)
    assert (int(compiled), int(loaded)) == (0, 1)
    assert told.startswith("compiling solve_batch, once: about ")
    assert waited.startswith("compiling solve_batch, once: another process does so")
    assert told.count("\n") == waited.count("\n") == 1
    assert start_one().communicate() == ("1\n", "")
