"""A run's folder: everything a search found, readable without the program, written whole."""

from __future__ import annotations

import json
import platform
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from domino_env.files import write_text
from domino_env.scene import Scene
from optimize.budget import Budget
from optimize.result import SearchResult, Trace

PAUSE = 2.0  # [s] between two savings of the best so far
FILES = ("scene.toml", "layout.csv", "layout.json", "trace.csv", "summary.json", "result.png")


class RunFolder:
    """The folder of one run.

    Opening it makes it, or takes over that of an earlier run; a folder that holds other things is
    refused, as is one that cannot be written.  While the search runs, `watch` keeps the best layout
    and the trace on disk, so that a run that is killed loses a few seconds of them.
    """

    def __init__(self, path: Path, scene: Scene) -> None:
        self.path = path
        self.scene = scene
        self._saved = 0.0
        self._score = float("-inf")
        if path.exists() and not path.is_dir():
            raise ValueError(f"{path} is a file: name a folder for the run")
        if path.is_dir():
            others = [f.name for f in path.iterdir() if f.name not in FILES and f.name[0] != "."]
            if others:
                raise ValueError(
                    f"{path} holds {others[0]} and is no run's folder: choose another with --out"
                )
        try:
            for name in FILES:
                (path / name).unlink(missing_ok=True)
            write_text(path / "scene.toml", scene.to_toml())
        except OSError as error:
            raise ValueError(f"{path} cannot be written: {error.strerror}") from None

    def watch(self, budget: Budget) -> None:
        """Keep the best so far, if it is new and the last saving some seconds old."""
        if budget.best is None or budget.best_score == self._score:
            return
        if time.monotonic() - self._saved < PAUSE:
            return
        layout = budget.problem.layout(budget.best)
        layout.to_csv(self.path / "layout.csv")
        layout.to_json(self.path / "layout.json")
        write_text(self.path / "trace.csv", _trace_text(tuple(budget.trace)))
        self._saved, self._score = time.monotonic(), budget.best_score

    def finish(self, result: SearchResult) -> None:
        """Write the result, its summary and its picture."""
        from optimize.picture import draw

        result.layout.to_csv(self.path / "layout.csv")
        result.layout.to_json(self.path / "layout.json")
        write_text(self.path / "trace.csv", _trace_text(result.trace))
        draw(result, self.path / "result.png")
        write_text(self.path / "summary.json", json.dumps(summary(result), indent=1) + "\n")


def summary(result: SearchResult) -> dict[str, Any]:
    """What summary.json holds; SI units."""
    wave = result.wave
    gain = result.gain
    return {
        "scene": result.scene.name,
        "method": result.method,
        "seed": result.seed,
        "score": result.score,
        "mean_speed": wave.mean_speed,
        "uniform_mean_speed": result.uniform.wave.mean_speed,
        "uniform_spacing": float(result.uniform.layout.spacing[0]),
        "uniform_thickness": float(result.uniform.layout.thickness[-1]),
        "gain": gain if gain == gain else None,
        "outcome": wave.outcome.name,
        "explanation": wave.explanation,
        "evaluations": result.evaluations,
        "simulated_falls": result.falls,
        "seconds": result.seconds,
        "interrupted": result.interrupted,
        "error_estimate": wave.error_estimate,
        "flushes": wave.flushes,
        "largest_flush_loss": wave.largest_flush_loss,
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("domino-chains", "numpy", "scipy", "numba", "cma")},
        },
    }


def _trace_text(trace: Trace) -> str:
    lines = ["evaluations,simulated_falls,seconds,best_score"]
    lines += [f"{n},{falls},{t:.6f},{score!r}" for n, falls, t, score in trace]
    return "\n".join(lines) + "\n"
