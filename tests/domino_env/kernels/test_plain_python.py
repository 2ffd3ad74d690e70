"""The kernels as plain Python: the same answers, and how much of it the cases walk through."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

CASES = Path(__file__).with_name("plain_cases.py")
LEAST = 95.0  # per cent of the kernels' lines


def run(*words, cwd, **environment):
    done = subprocess.run(
        [sys.executable, *words],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_plain_and_compiled_agree_and_the_kernels_are_covered(tmp_path):
    compiled = json.loads(run(str(CASES), cwd=tmp_path))
    plain = json.loads(
        run(
            "-m", "coverage", "run", "--include=*/domino_env/kernels/*",
            "--omit=*/kernels/jit/*", str(CASES),
            cwd=tmp_path, NUMBA_DISABLE_JIT="1",
        )
    )  # fmt: skip
    assert set(plain) == set(compiled)
    for name in compiled:
        assert plain[name] == pytest.approx(compiled[name], rel=1e-11), name
    run("-m", "coverage", "json", "-o", "coverage.json", "-q", cwd=tmp_path)
    report = json.loads((tmp_path / "coverage.json").read_text())
    assert report["totals"]["percent_covered"] >= LEAST
