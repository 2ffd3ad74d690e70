"""Write the numbers that several pages quote; each has one source.

A page marks such a number by an HTML comment with its name directly behind it: 3.2 and
``<!--gain.sprint-->``. ``python docs/quoted_numbers.py`` writes all marked numbers of README.md and
of the pages; a test fails if a page has another value.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path
from statistics import mean

import domino_env as de
from domino_env.rigid.known import known_verification, read_verified
from domino_env.validation.source import shipped_sources
from optimize.experiments.best_known import best_known

DOCS = Path(__file__).resolve().parent
MARK = re.compile(r"([^\s<>(|*`~]+)<!--([a-z][\w.-]*)-->")
MEASURED = {
    # [s] simulation of forty free-standing dominoes on one core (domino simulate --floor 0.5)
    "seconds.standing.least": "0.1",
    "seconds.standing.most": "0.2",
    # [s] first simulation on one core, with compilation (empty the cache, then domino simulate)
    "seconds.compile.least": "10",
    "seconds.compile.most": "25",
    # [µs] de.simulate of forty dominoes on one core: equal ones, random layouts (timeit)
    "us.equal": "35",
    "us.most": "80",
    # simulations that take as long as one with its gradient (make bench)
    "gradient.least": "3",
    "gradient.most": "4",
}


def numbers() -> dict[str, str]:
    """Return all numbers by name, as they are written."""
    course = de.load_scene("course")
    layouts = {"uniform": course.uniform().layout, "best": best_known()["course"].layout}
    times = {
        f"seconds.course.{name}": f"{course.simulate(layout).arrival_times[-1]:.3f}"
        for name, layout in layouts.items()
    }
    computed = scene_numbers() | verification_numbers() | source_numbers() | uncertainty_numbers()
    return MEASURED | times | computed | claim_numbers()


def scene_numbers() -> dict[str, str]:
    """Return speeds, gains [%] and lengths [mm] of the scenes whose scores are speeds."""
    (gain,) = re.findall(r"^\| length 997 mm .* \+([\d.]+)% \|", _page("why.md"), re.M)
    values = {"gain2.sprint.length": gain}
    for name, record in best_known().items():
        scene = de.load_scene(name)
        baseline = scene.uniform()
        verified = known_verification(record.layout, scene.physics)
        if scene.unit != "m/s":
            checks = verified.floors if verified else ()
            for check in checks:
                if check.score.startswith("RMS error"):
                    values[f"error.{check.floor}.{name}"] = f"{float(check.score.split()[2]):.1f}"
            continue
        gain = 100.0 * (record.score / baseline.score - 1.0)
        values |= {
            f"gain.{name}": f"{gain:.1f}",
            f"gain2.{name}": f"{gain:.2f}",
            f"uniform.{name}": f"{baseline.score:.4f}",
            f"best.{name}": f"{record.score:.4f}",
            f"best5.{name}": f"{record.score:.5f}",
            f"gap.{name}": f"{1e3 * baseline.layout.spacing[0]:.1f}",
            f"length.{name}.uniform": f"{1e3 * scene.row(baseline.layout).length:.0f}",
            f"length.{name}.best": f"{1e3 * scene.row(record.layout).length:.0f}",
        }
        if verified is None or verified.first < verified.count:
            continue
        for check in verified.floors:
            if check.floor is not None and check.gain is not None:
                values[f"floor.{check.floor}.{name}"] = f"{100.0 * check.gain:.1f}"
                values[f"floor2.{check.floor}.{name}"] = f"{100.0 * check.gain:.2f}"
    return values


def uncertainty_numbers() -> dict[str, str]:
    """Return means of each policy and scene in uncertainty.csv, and `benchmark_numbers`."""
    values, lines = benchmark_numbers(), dict[str, list[dict[str, str]]]()
    with (DOCS / "uncertainty.csv").open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            lines.setdefault(f"{line['scene']}.{line['policy']}", []).append(line)
    for name, runs in lines.items():
        for key, digits in {"score": 4, "gain": 2, "hindsight_score": 2, "rms_ms": 2}.items():
            if runs[0][key]:
                values[f"{name}.{key}"] = f"{mean(float(run[key]) for run in runs):.{digits}f}"
    return values


def claim_numbers() -> dict[str, str]:
    """Return the numbers in the text of claims.md, which docs/claims.py computes."""
    with (DOCS / "claims.csv").open(newline="", encoding="utf-8") as file:
        lines = [line for line in csv.DictReader(file) if not line["gap"]]
    return {f"claims.{line['quantity']}": line["value"] for line in lines}


def verification_numbers() -> dict[str, str]:
    """Return the agreement of the model with the reference simulator on fixed pivots."""
    verified = read_verified().values()
    agreeing = [entry for entry in verified if entry.verdict.startswith("AGREES")]
    largest = max(entry.checks[0].largest for entry in agreeing)
    verdicts = re.findall(r"^\| `[\w-]+`, random .*\| (\w+)[^|]*\|$", _page("verified.md"), re.M)
    return {
        "known.agree": str(len(agreeing)),
        "known.all": str(len(verified)),
        "known.largest": f"{100.0 * largest:.3f}",
        "random.all": str(len(verdicts)),
        "random.differ": str(len(verdicts) - verdicts.count("agrees")),
    }


def source_numbers() -> dict[str, str]:
    """Return results of the comparison with measured chains, differences in speed in percent."""
    page = _page("measured-sources.md")
    explained, total = re.findall(r"\*\*(\d+) of (\d+) sources are explained", page)[0]
    friction, spread = re.findall(r"\(#chapman\) \| 3 \| ([\d.]+) ± ([\d.]+) ", page)[0]
    chapman = shipped_sources()["chapman"]
    physics = de.Physics(friction=0.25, gravity=9.8)  # Chapman's measured friction
    slower = []
    for chain in chapman.chains:
        wave = de.steady_wave(chain.x, 0.0075, physics=physics)
        slower.append(100.0 * (1.0 - wave.speed / chain.x / chain.value))
    return {
        "sources.explained": explained,
        "sources.all": total,
        "chapman.friction": friction,
        "chapman.spread": spread,
        "chapman.least": f"{min(slower):.0f}",
        "chapman.most": f"{max(slower):.0f}",
    }


def benchmark_numbers() -> dict[str, str]:
    """Return numbers of the runs on sprint, of all and within 0.1 % of the best known score."""
    values = {}
    with (DOCS / "benchmark.csv").open(newline="", encoding="utf-8") as file:
        runs = [run for run in csv.DictReader(file) if run["scene"] == "sprint"]
    for name in {run["algorithm"] for run in runs}:
        scores = [float(run["score"]) for run in runs if run["algorithm"] == name]
        near = sum(score >= 0.999 * best_known()["sprint"].score for score in scores)
        values |= {f"{name}.runs": str(len(scores)), f"{name}.near": str(near)}
    return values


def with_numbers(text: str, values: dict[str, str]) -> str:
    """Return the text of a page with the current values of its marked numbers.

    Raises
    ------
    KeyError
        For a name without a value.
    """
    return MARK.sub(lambda mark: f"{values[mark[2]]}<!--{mark[2]}-->", text)


def _page(name: str) -> str:
    return (DOCS / name).read_text("utf-8")


if __name__ == "__main__":
    VALUES = numbers()
    for page in (DOCS.parent / "README.md", *DOCS.glob("*.md")):
        page.write_text(with_numbers(page.read_text("utf-8"), VALUES), "utf-8")
