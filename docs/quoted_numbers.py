"""Write the numbers that several pages quote, each from one source.

A page marks such a number by an HTML comment with its name directly behind it: 3.2 and
``<!--gain.sprint-->``. ``python docs/quoted_numbers.py`` writes all marked numbers of README.md and
of the pages; a test fails where a page holds another one. ``--list`` prints names and values.
"""

from __future__ import annotations

import csv
import re
import sys
import tomllib
from pathlib import Path
from statistics import mean

import domino_env as de
from domino_env.rigid.known import Verified, known_verification, read_verified
from domino_env.validation.source import shipped_sources
from optimize.experiments.best_known import best_known

DOCS = Path(__file__).resolve().parent
MARK = re.compile(r"([^\s<>(|*`~]+)<!--([a-z][\w.-]*)-->")
WORDS = (
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen "
    "sixteen seventeen eighteen nineteen twenty"
)


def numbers() -> dict[str, str]:
    """Return all numbers by name, as they are written."""
    found = measured_numbers() | scene_numbers() | verification_numbers() | source_numbers()
    found |= uncertainty_numbers()
    course = de.load_scene("course")
    found["seconds.course.uniform"] = f"{course.uniform().wave.arrival_times[-1]:.3f}"
    best = course.simulate(best_known()["course"].layout)
    found["seconds.course.best"] = f"{best.arrival_times[-1]:.3f}"
    return found


def measured_numbers() -> dict[str, str]:
    """Return the numbers of quoted_numbers.toml, with dotted names."""
    found: dict[str, str] = {}

    def collect(table: dict[str, object], prefix: str) -> None:
        for key, value in table.items():
            name = f"{prefix}{key}"
            if isinstance(value, dict):
                collect(value, f"{name}.")
            else:
                found[name] = str(value)

    collect(tomllib.loads((DOCS / "quoted_numbers.toml").read_text("utf-8")), "")
    return found


def scene_numbers() -> dict[str, str]:
    """Return speeds and gains [%] of the scenes whose scores are speeds."""
    found = {}
    for name, record in best_known().items():
        scene = de.load_scene(name)
        baseline = scene.uniform()
        if scene.unit != "m/s":
            continue
        gain = 100.0 * (record.score / baseline.score - 1.0)
        found |= {
            f"gain.{name}": f"{gain:.1f}",
            f"gain2.{name}": f"{gain:.2f}",
            f"uniform.{name}": f"{baseline.score:.4f}",
            f"best.{name}": f"{record.score:.4f}",
            f"best5.{name}": f"{record.score:.5f}",
            f"gap.{name}": f"{1e3 * baseline.layout.spacing[0]:.1f}",
        }
        kept = known_verification(record.layout, scene.physics)
        for check in kept.floors if kept else ():
            if check.gain is not None and kept and kept.first == kept.count:
                found[f"floor.{check.floor or 'none'}.{name}"] = f"{100.0 * check.gain:.1f}"
                found[f"floor2.{check.floor or 'none'}.{name}"] = f"{100.0 * check.gain:.2f}"
    return found


def uncertainty_numbers() -> dict[str, str]:
    """Return means over the trainings of uncertainty.csv, and its references."""
    found, lines = {}, dict[str, list[dict[str, str]]]()
    with (DOCS / "uncertainty.csv").open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            lines.setdefault(f"{line['scene']}.{line['policy']}", []).append(line)
    for name, runs in lines.items():
        for key, digits in {"score": 4, "gain": 2, "hindsight_score": 2, "rms_ms": 2}.items():
            if runs[0][key]:
                found[f"{name}.{key}"] = f"{mean(float(run[key]) for run in runs):.{digits}f}"
    return found


def verification_numbers() -> dict[str, str]:
    """Return how far the model and the reference simulator agree on fixed pivots."""
    kept = read_verified()

    def agrees(one: Verified) -> bool:
        return one.verdict.startswith("AGREES")

    largest = max(one.checks[0].largest for one in kept.values() if agrees(one))
    verdicts = re.findall(r"^\| `[\w-]+`, random .*\| (\w+)[^|]*\|$", _page("verified.md"), re.M)
    gentle = best_known()["gentle"].layout
    margin = de.simulate(gentle, de.load_scene("gentle").physics).stall_margin.min()
    return {
        "known.agree": in_words(sum(map(agrees, kept.values()))),
        "known.all": in_words(len(kept)),
        "known.largest": f"{100.0 * largest:.3f}",
        "random.all": str(len(verdicts)),
        "random.differ": str(len(verdicts) - verdicts.count("agrees")),
        "margin.gentle": f"{margin:.1e}".replace("e-0", "e-"),
    }


def source_numbers() -> dict[str, str]:
    """Return the results of the comparison with measured chains."""
    page = _page("measured-sources.md")
    explained, total = re.findall(r"\*\*(\d+) of (\d+) sources are explained", page)[0]
    friction, spread = re.findall(r"\(#chapman\) \| 3 \| ([\d.]+) ± ([\d.]+) ", page)[0]
    chapman = shipped_sources()["chapman"]
    physics = de.Physics(friction=0.25, gravity=9.8)  # the friction that he measured
    slower = []
    for chain in chapman.chains:
        wave = de.steady_wave(chain.x, 0.0075, physics=physics)
        slower.append(100.0 * (1.0 - wave.speed / chain.x / chain.value))
    return {
        "sources.explained": in_words(int(explained)),
        "sources.all": in_words(int(total)),
        "chapman.friction": friction,
        "chapman.spread": spread,
        "chapman.least": f"{min(slower):.0f}",
        "chapman.most": f"{max(slower):.0f}",
    }


def in_words(number: int) -> str:
    """Return a small number as a word."""
    return WORDS.split()[number] if number < len(WORDS.split()) else str(number)


def with_numbers(text: str, values: dict[str, str]) -> str:
    """Return a page with the present values of its marked numbers.

    Raises
    ------
    KeyError
        For a name without a value.
    """

    def written(mark: re.Match[str]) -> str:
        value = values[mark[2]]
        capital = mark[1][0].isupper()
        return f"{value[0].upper() + value[1:] if capital else value}<!--{mark[2]}-->"

    return MARK.sub(written, text)


def pages() -> list[Path]:
    """Return README.md and all pages."""
    return [DOCS.parent / "README.md", *sorted(DOCS.glob("*.md"))]


def _page(name: str) -> str:
    return (DOCS / name).read_text("utf-8")


if __name__ == "__main__":
    PRESENT = numbers()
    if "--list" in sys.argv:
        print("\n".join(f"{name} = {value}" for name, value in PRESENT.items()))
    else:
        for page in pages():
            page.write_text(with_numbers(page.read_text("utf-8"), PRESENT), "utf-8")
