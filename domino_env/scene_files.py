"""Scenes as TOML files, read with care.

name, title, objective   what it is called, what it is about, what counts
[row]        count, height, width, density, first_thickness, length
[spacing]    min and max, or fixed, or values = […]; with min and max also step; largest_change;
             of = "height": in heights of the shorter of the two dominoes, not in metres
[thickness]  the same but for largest_change; of = "height": in heights of the domino
[stock]      instead of [thickness]: thickness = […], count = […], the first domino among them
[growth]     min and max of a domino's height over that of the one before
[physics]    friction, gravity, push
[limits]     stall_margin, at least; flush_loss, at most
[tempo]      for the objective "tempo": from and to [hits/s], or times = […] [s]; tolerance [s]
[robust]     for the objective "robust": deviation [m], quantile, draws, seed
"""

from __future__ import annotations

import difflib
import math
import tomllib
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from domino_env.layout import DENSITY, HEIGHT, WIDTH
from domino_env.objective import OBJECTIVES, Limits
from domino_env.physics import Physics
from domino_env.placement import LARGEST_DRAWS, Placement
from domino_env.scene_tables import (
    GROWTH,
    LIMITS,
    LONGEST_TITLE,
    MOST_DOMINOES,
    PHYSICS,
    ROBUST,
    ROW,
    SPACING,
    STOCK,
    TEMPO,
    THICKNESS,
    TOP,
    finite,
    line_of,
    name_of,
    numbers,
    positive,
    require_known,
    steps,
    table_of,
    whole,
)
from domino_env.stock import Stock
from domino_env.support.reading import naming, one_line, read_bytes, refuse, shown
from domino_env.tempo import TOLERANCE, Tempo

if TYPE_CHECKING:
    from domino_env.scene import Bounds, Scene

TALLEST = 1e30  # [m] that a domino of a growing row may become: its square is still a number
MOST_PAIRS = 100_000  # of listed gaps and thicknesses: each is tried for the best uniform row
MOST_DRAWN = 4_000_000  # dominoes in all draws: some 200 MB when they topple

# which table an objective needs, and which needs that objective
_NEEDS = {"tempo": "tempo", "robust": "robust"}


def read_scene(name: str | Path) -> Scene:
    """A scene by name or by the path of its file; see `domino_env.scene.load_scene`."""
    from domino_env.scene import scene_names

    path = Path(name)
    known = scene_names()
    if str(name) not in known and (path.suffix == ".toml" or path.is_file()):
        if not path.is_file():
            refuse(path, "there is no such scene file")
        try:
            text = read_bytes(path).decode("utf-8-sig")
        except UnicodeDecodeError:
            refuse(path, "not UTF-8 text; save the file as UTF-8")
        return parse_scene(text, path.stem, str(path))
    if str(name) not in known:
        near = difflib.get_close_matches(str(name)[:LONGEST_TITLE], known, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(
            f"there is no scene '{one_line(str(name), 100)}': {hint}scenes that ship: "
            f"{', '.join(known)}; or give the path of a .toml file"
        )
    text = (resources.files("domino_env") / "scenes" / f"{name}.toml").read_text("utf-8")
    return parse_scene(text, str(name), f"{name}.toml")


def parse_scene(text: str, name: str, file: str) -> Scene:
    """A scene from the text of its file.

    name: what the scene is called unless the text says it; file: what errors call the text.
    """
    with naming(file):
        return _scene_of(_document(text), name, file)


def scene_of_document(document: dict[str, Any], name: str, file: str) -> Scene:
    """A scene from what `tomllib` makes of the text of its file; see `parse_scene`."""
    with naming(file):
        return _scene_of(document, name, file)


def _document(text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("not TOML: nested too deep") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"not TOML: {error}") from None
    except ValueError:
        raise ValueError("not TOML: a whole number has thousands of digits") from None


def _scene_of(document: dict[str, Any], name: str, file: str) -> Scene:
    from domino_env.scene import Scene

    require_known(document, TOP, file, "")
    row = table_of(document, "row", ROW, file)
    forces = table_of(document, "physics", PHYSICS, file)
    objective = document.get("objective", OBJECTIVES[0])
    if objective not in OBJECTIVES:
        raise ValueError(f"{file}: objective = {shown(objective)}: choose {', '.join(OBJECTIVES)}")
    name = name_of(document, file, name)
    title = line_of(document, "title", file, name)
    count = whole(row, "row", "count", file, None, 2, MOST_DOMINOES)
    height = positive(row, "row", "height", file, HEIGHT)
    defaults = Physics()
    values = [finite(forces, "physics", key, file, getattr(defaults, key)) for key in PHYSICS]
    try:
        physics = Physics(*values)
    except ValueError as error:
        raise ValueError(f"{file}: physics.{error}") from None
    spacing, spacing_values = _range(document, "spacing", SPACING, file)
    in_heights = _in_heights(document, file)
    stock = _stock(document, file)
    if stock is None:
        thickness, thickness_values = _range(document, "thickness", THICKNESS, file)
        # as thick as all the others
        same = thickness[0] if thickness[0] == thickness[1] else None
        if same is not None and in_heights:
            same *= height
        first = positive(row, "row", "first_thickness", file, same)
    else:
        first = positive(row, "row", "first_thickness", file, None)
        rest = _after_the_first(stock, first, count, file)
        thickness_values = tuple(sorted(set(rest)))
        thickness = thickness_values[0], thickness_values[-1]
    length = row.get("length")
    change = document["spacing"].get("largest_change")
    scene = Scene(
        name=name,
        title=title,
        objective=objective,
        physics=physics,
        count=count,
        height=height,
        width=positive(row, "row", "width", file, WIDTH),
        density=positive(row, "row", "density", file, DENSITY),
        first_thickness=first,
        spacing=spacing,
        thickness=thickness,
        length=None if length is None else positive(row, "row", "length", file, None),
        spacing_values=spacing_values,
        thickness_values=thickness_values,
        largest_change=None if change is None else _not_negative(document, file),
        stock=stock,
        growth=_growth(document, file),
        in_heights=in_heights,
        limits=_limits(document, file),
        tempo=_tempo(document, count, file),
        placement=_placement(document, file),
    )
    _consistent(scene, document, file)
    _feasible(scene, file)
    return scene


def _not_negative(document: dict[str, Any], file: str) -> float:
    value = finite(document["spacing"], "spacing", "largest_change", file, None)
    if value < 0.0:
        raise ValueError(f"{file}: spacing.largest_change = {value}: must be 0 or more [m]")
    return value


def _range(
    document: dict[str, Any], name: str, allowed: tuple[str, ...], file: str
) -> tuple[Bounds, tuple[float, ...] | None]:
    """Bounds, and the values allowed between them where not all are."""
    table = table_of(document, name, allowed, file)
    for one in ("fixed", "values"):
        others = [key for key in ("min", "max", "step", "fixed", "values") if key in table]
        if one in table and len(others) > 1:
            beside = "min or max" if one == "fixed" else " or ".join(k for k in others if k != one)
            raise ValueError(f"{file}: {name}.{one} stands beside {beside}: give one or the other")
    if "fixed" in table:
        value = positive(table, name, "fixed", file, None)
        return (value, value), None
    if "values" in table:
        values = tuple(sorted(numbers(table, name, "values", file)))
        for a, b in pairwise(values):
            if b - a < 1e-8:
                raise ValueError(f"{file}: {name}.values holds {a} and {b}: they are the same")
        return (values[0], values[-1]), values if len(values) > 1 else None
    for key in ("min", "max"):
        if key not in table:
            raise ValueError(f"{file}: {name}.{key} is missing: give min and max, or fixed [m]")
    low = positive(table, name, "min", file, None)
    high = positive(table, name, "max", file, None)
    if low > high:
        raise ValueError(f"{file}: {name}.min = {low} m is more than {name}.max = {high} m")
    if "step" not in table:
        return (low, high), None
    step = positive(table, name, "step", file, None)
    if not (step >= 1e-8 and (high - low) / step < 1e5):
        raise ValueError(
            f"{file}: {name}.step = {step} m: too fine to count; leave it out for any value"
        )
    values = steps(low, high, step)
    return (values[0], values[-1]), values if len(values) > 1 else None


def _in_heights(document: dict[str, Any], file: str) -> bool:
    asked = {}
    for name in ("spacing", "thickness"):
        table = document.get(name)
        of = table.get("of") if isinstance(table, dict) else None
        if of not in (None, "height"):
            raise ValueError(
                f"{file}: {name}.of = {shown(of)}: write 'height', or leave it out for [m]"
            )
        asked[name] = of is not None
    if asked["spacing"] != asked["thickness"]:
        here, there = ("spacing", "thickness") if asked["spacing"] else ("thickness", "spacing")
        raise ValueError(
            f'{file}: {here}.of = "height" but {there} is in metres: give both in heights'
        )
    return asked["spacing"]


def _stock(document: dict[str, Any], file: str) -> Stock | None:
    if "stock" not in document:
        return None
    table = table_of(document, "stock", STOCK, file)
    if "thickness" in document:
        raise ValueError(f"{file}: [thickness] stands beside [stock]: give one or the other")
    kinds = numbers(table, "stock", "thickness", file)
    counts = table.get("count")
    if not isinstance(counts, list):
        raise ValueError(f"{file}: stock.count = {shown(counts)}: give a list of whole numbers")
    entries = {f"count[{i}]": value for i, value in enumerate(counts)}
    box = [whole(entries, "stock", e, file, None, 0, MOST_DOMINOES) for e in entries]
    try:
        return Stock(kinds, tuple(box))
    except ValueError as error:
        raise ValueError(f"{file}: stock.{error}") from None


def _after_the_first(stock: Stock, first: float, count: int, file: str) -> list[float]:
    """The thicknesses left for the designer."""
    if sum(stock.count) < count:
        raise ValueError(
            f"{file}: stock.count adds up to {sum(stock.count)} dominoes: row.count = {count} "
            "needs as many"
        )
    try:
        return [float(d) for d in stock.without(first).dominoes]
    except ValueError as error:
        raise ValueError(f"{file}: row.first_thickness = {first}: {error}") from None


def _growth(document: dict[str, Any], file: str) -> Bounds | None:
    if "growth" not in document:
        return None
    table = table_of(document, "growth", GROWTH, file)
    low = finite(table, "growth", "min", file, 1.0)
    high = finite(table, "growth", "max", file, None)
    if not 1.0 <= low <= high:
        raise ValueError(
            f"{file}: growth.min = {low}, growth.max = {high}: 1 ≤ min ≤ max, for a tip must "
            "strike below the top of the next domino"
        )
    return low, high


def _limits(document: dict[str, Any], file: str) -> Limits | None:
    if "limits" not in document:
        return None
    table = table_of(document, "limits", LIMITS, file)
    values = [finite(table, "limits", key, file, None) if key in table else None
              for key in LIMITS]  # fmt: skip
    if values == [None, None]:
        raise ValueError(f"{file}: [limits] is empty; it holds {', '.join(LIMITS)}")
    try:
        return Limits(*values)
    except ValueError as error:
        raise ValueError(f"{file}: limits.{error}") from None


def _tempo(document: dict[str, Any], count: int, file: str) -> Tempo | None:
    if "tempo" not in document:
        return None
    table = table_of(document, "tempo", TEMPO, file)
    first, last = (
        finite(table, "tempo", key, file, None) if key in table else None for key in ("from", "to")
    )
    times = numbers(table, "tempo", "times", file) if "times" in table else None
    try:
        tolerance = finite(table, "tempo", "tolerance", file, TOLERANCE)
        tempo = Tempo(first, last, times, tolerance)
        tempo.schedule(count)
    except ValueError as error:
        raise ValueError(f"{file}: tempo.{error}") from None
    return tempo


def _placement(document: dict[str, Any], file: str) -> Placement | None:
    if "robust" not in document:
        return None
    table = table_of(document, "robust", ROBUST, file)
    try:
        return Placement(
            finite(table, "robust", "deviation", file, None),
            finite(table, "robust", "quantile", file, 0.05),
            whole(table, "robust", "draws", file, 256, 1, LARGEST_DRAWS),
            whole(table, "robust", "seed", file, 0, 0, 2**63 - 1),
        )
    except ValueError as error:
        if str(error).startswith(file):
            raise
        raise ValueError(f"{file}: robust.{error}") from None


def _consistent(scene: Scene, document: dict[str, Any], file: str) -> None:
    """What the parts of a scene owe each other."""
    if scene.placement is not None:
        drawn = scene.count * scene.placement.draws
        if drawn > MOST_DRAWN:
            raise ValueError(
                f"{file}: robust.draws = {scene.placement.draws} of {scene.count} dominoes are "
                f"{drawn:,}: draw at most {MOST_DRAWN // scene.count} rows"
            )
    listed = len(scene.spacing_values or "1") * len(scene.thickness_values or "1")
    if listed > MOST_PAIRS:
        raise ValueError(
            f"{file}: spacing and thickness have {listed:,} pairs of listed values, and each is "
            f"tried for the best uniform row: list at most {MOST_PAIRS:,}"
        )
    if scene.growth is not None:
        tallest = math.log(scene.height) + (scene.count - 1) * math.log(scene.growth[1])
        if tallest > math.log(TALLEST):
            raise ValueError(
                f"{file}: growth.max = {scene.growth[1]}: {scene.count} dominoes could grow to "
                f"10^{tallest / math.log(10.0):.0f} m; let them grow less, or ask for fewer"
            )
    for objective, table in _NEEDS.items():
        if (scene.objective == objective) != (table in document):
            what = "is missing" if scene.objective == objective else "stands there"
            raise ValueError(
                f"{file}: the table [{table}] {what} and objective = {scene.objective!r}: "
                f"[{table}] and objective = {objective!r} go together"
            )
    if scene.objective == "time" and scene.length is None:
        raise ValueError(f"{file}: row.length is missing: objective = 'time' needs a course")
    if scene.objective == "magnify" and scene.growth is None:
        raise ValueError(
            f"{file}: the table [growth] is missing: objective = 'magnify' needs free heights"
        )
    if scene.objective == "toppled" and scene.limits is not None:
        raise ValueError(
            f"{file}: [limits] judge waves that run through: not with objective = 'toppled'"
        )
    if scene.growth is not None and not scene.in_heights:
        raise ValueError(
            f'{file}: [growth] needs spacing and thickness in heights: write of = "height" in both'
        )
    if scene.in_heights:
        asked = {
            "row.length": scene.length, "spacing.step or values": scene.spacing_values,
            "thickness.step or values": scene.thickness_values, "[stock]": scene.stock,
            "spacing.largest_change": scene.largest_change,
        }  # fmt: skip
        for name, value in asked.items():
            if value is not None:
                raise ValueError(f'{file}: {name} is in metres: not with of = "height"')
    if scene.stock is not None and scene.length is not None:
        assert scene.stock is not None
        if sum(scene.stock.count) != scene.count:
            raise ValueError(
                f"{file}: stock.count adds up to {sum(scene.stock.count)}: with row.length, give "
                f"exactly row.count = {scene.count}"
            )


def _feasible(scene: Scene, file: str) -> None:
    """Whether any row within the bounds meets the length; lists and steps: `optimize.feasible`."""
    if scene.length is None:
        return
    pairs = scene.count - 1
    least, most = (pairs * (scene.spacing[k] + scene.thickness[k]) for k in (0, 1))
    if scene.stock is not None:
        bodies = float(scene.stock.without(scene.first_thickness).dominoes.sum())
        least, most = (pairs * scene.spacing[k] + bodies for k in (0, 1))
    if not least - 1e-12 <= scene.length <= most + 1e-12:
        raise ValueError(
            f"{file}: row.length = {scene.length} m cannot be met: {scene.count} dominoes within "
            f"the bounds cover {least:.6g} to {most:.6g} m"
        )
