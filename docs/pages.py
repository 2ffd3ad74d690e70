"""Pages that are made when the site is built: scenes and methods, from the data and docstrings.

Run as a program it writes the tables of README.md anew.

MkDocs calls `on_config`, `on_files` and `on_page_markdown` (mkdocs.yml, hooks).
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files as package_files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import domino_env as de
from domino_env.core.tables import markdown_table
from domino_env.physics.motion import Motion, outlines
from domino_env.rigid.known import known_verification, read_verified
from domino_env.scenes.io.schema import scene_schema
from domino_env.view.ground import ground_line
from optimize.experiments.best_known import BestKnown, best_known
from optimize.methods.registry import METHODS, PEERS

if TYPE_CHECKING:
    from mkdocs.structure.files import Files

WIDE, ROOM = 940.0, 10.0  # [px]
ENDS = 36  # dominoes at either end that are drawn of a long row
BREAK = 2.0  # [heights] between the two ends
FALLEN = 0.6  # of the wave's time: the instant that is drawn
USUAL = 0.0075  # [m]: a standard domino's thickness
WHAT_FLOORS_LEAVE = (
    "",
    "The last column is what is left of *over equal* when rows stand free on floors of such",
    "friction, by `domino best-known --verify`; dominoes that stay up are counted.",
)
MADE = r"(<!-- {} -->\n).*?(<!-- end -->)"  # the text between two comments
SCENES_HERE, BENCHMARK_HERE = "made by python docs/pages.py", "summary of docs/benchmark.md"
METHOD_OPTIONS = (  # of mkdocstrings: the module's docstring alone, under a heading of ours
    "    options:",
    "      members: false",
    "      show_root_heading: false",
    "      show_root_toc_entry: false",
)


def on_config(config: Any) -> Any:
    """A line of the menu for every scene."""
    for section in config.nav:
        if "Scenes" in section:
            section["Scenes"] = ["scenes/index.md"] + [
                {name: f"scenes/{name}.md"} for name in de.scene_names()
            ]
    return config


def on_files(files: Files, config: Any) -> Files:
    """The pages that no file holds."""
    from mkdocs.structure.files import File

    records = best_known()
    for name in de.scene_names():
        page = scene_page(name, records.get(name))
        files.append(File.generated(config, f"scenes/{name}.md", content=page))
    files.append(File.generated(config, "scenes/index.md", content=scenes_page(records)))
    files.append(File.generated(config, "methods.md", content=methods_page()))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Write the equations of a page, between pairs of $$, as MathML."""
    return re.sub(r"^\$\$(.+?)(?: \\tag\{(\d+)\})?\$\$$", _equation, markdown, flags=re.MULTILINE)


def _equation(equation: re.Match[str]) -> str:
    """Return the MathML of an equation, with its number at the right."""
    from latex2mathml.converter import convert

    number = f"<span>({equation[2]})</span>" if equation[2] else ""
    style = "display:flex;justify-content:space-between;overflow:auto hidden"
    return (
        f'<div style="{style}"><span></span>{convert(equation[1], display="block")}{number}</div>'
    )


@cache
def shipped(name: str) -> de.Scene:
    """A scene; its best uniform row is found once."""
    return de.load_scene(name)


def scenes_page(records: dict[str, BestKnown]) -> str:
    """All scenes in a table."""
    lines = [
        "---",
        "hide: [toc]",  # the table is wide
        "---",
        "# Scenes",
        "",
        "A scene is a design problem in one TOML file: what stands, what may be chosen, what",
        "counts. These ship, and are there to be copied.",
        "",
        *scenes_table(records, "{}.md"),
        "",
        "## What a scene's file holds",
        "",
        "[Searching a better row](../searching.md) shows a file of your own.",
        "",
        *keys(),
    ]
    return "\n".join(lines) + "\n"


def scenes_table(records: dict[str, BestKnown], link: str) -> list[str]:
    """What every scene asks, how three rows of it compare, and what floors leave of the gain."""
    floors = floor_frictions()
    rows = []
    for name in de.scene_names():
        scene = shipped(name)
        usual, uniform, best = three_rows(scene, records.get(name))
        rows.append(
            (
                f"[`{name}`]({link.format(name)})",
                scene.title,
                *(worth(scene, row) for row in (usual, uniform, best)),
                lead(scene, best, usual),
                lead(scene, best, uniform),
                *([" / ".join(left_on(f, name, records) for f in floors)] if floors else []),
            )
        )
    names = ["scene", "what it asks", "usual gaps", "best equal gaps", "best row known"]
    names += ["over usual", "over equal"]
    names += [f"on floors of {' / '.join(f'{floor:g}' for floor in floors)}"] if floors else []
    sprint = shipped("sprint")
    usual, uniform, best = three_rows(sprint, records["sprint"])
    return [
        *markdown_table(names, rows),
        "",
        "Speeds are in m/s. *Usual gaps* are as wide as the dominoes are thick (7.5 mm where the",
        "thickness is free): how builders like them. A dash: no such row, or no ratio that says",
        f"much. On `sprint` the best row known is {lead(sprint, best, usual)[1:]} faster than",
        f"usual gaps and {lead(sprint, best, uniform)[1:]} faster than the best equal gaps.",
        *(WHAT_FLOORS_LEAVE if floors else ()),
    ]


def three_rows(scene: de.Scene, record: BestKnown | None) -> list[tuple[float, de.Layout] | None]:
    """Score and layout: gaps as builders like them, the best equal ones, the best row known."""
    mark = scene.uniform()
    thickness = mark.layout.thickness if scene.stock else np.full(scene.count, USUAL)
    row = thickness[:-1], thickness, mark.layout.height
    usual = de.Layout(*row) if scene.ground is None else scene.ground.layout(*row)
    allowed = not scene.violations(usual) and not scene.free_height
    return [
        (scene.score(usual), usual) if allowed else None,
        (mark.score, mark.layout),
        (record.score, record.layout) if record else None,
    ]


def worth(scene: de.Scene, row: tuple[float, de.Layout] | None) -> str:
    """Write what a row is worth into a cell."""
    if row is None:
        return "–"
    score, layout = row
    if score <= 0.0:
        return "dies"
    return f"{score:.4f}" if scene.unit == "m/s" else scene.in_words(score, scene.simulate(layout))


def lead(
    scene: de.Scene, row: tuple[float, de.Layout] | None, other: tuple[float, de.Layout] | None
) -> str:
    """How much faster one row is than another."""
    if row is None or other is None or other[0] <= 0.0 or scene.unit != "m/s":
        return "–"
    return f"{row[0] / other[0] - 1.0:+.1%}"


def floor_frictions() -> list[float]:
    """On which floors the rows that ship were looked at."""
    checks = [check for one in read_verified().values() for check in one.floors]
    return sorted({check.floor for check in checks if check.floor})


def left_on(floor: float, name: str, records: dict[str, BestKnown]) -> str:
    """How much faster the best row is on a floor than the best uniform row of that floor."""
    record = records.get(name)
    one = record and known_verification(record.layout, shipped(name).physics)
    for look in one.floors if one else ():
        if look.floor == floor:
            up = look.staying_up
            gain = "–" if look.gain is None else f"{look.gain:+.1%}"
            first = f" (first {one.first})" if one.first < one.count else ""
            return gain + first + (f" ({up} up)" if up else "")
    return "–"


def keys() -> list[str]:
    """The keys of a scene's file, from its schema."""
    schema = scene_schema()
    rows = []
    for table, told in schema["properties"].items():
        inside = schema["$defs"].get(told.get("$ref", "").rpartition("/")[2])
        fields = inside["properties"] if inside else {table: told}
        for key, field in fields.items():
            default = field.get("default")
            shown = "" if default is None else f"`{default}`"
            where = f"[{table}]" if inside else ""
            choice = ": " + ", ".join(field["enum"]) if len(field.get("enum", ())) > 1 else ""
            rows.append((where, f"`{key}`", field["description"] + choice, shown))
    return list(markdown_table(("table", "key", "what it is", "default"), rows))


def scene_page(name: str, record: BestKnown | None) -> str:
    """One scene: what it asks, the best uniform row, the best row known, drawn."""
    scene = shipped(name)
    mark = scene.uniform()
    text = [
        f"# {name}", "", scene.title + ".", "",
        f"Best uniform row: {scene.in_words(mark.score, mark.wave)}, "
        f"gaps {1e3 * mark.layout.spacing[0]:.2f} mm, "
        f"thickness {1e3 * mark.layout.thickness[-1]:.2f} mm.", "",
        drawing(mark.layout, scene), "",
    ]  # fmt: skip
    if record is not None:
        wave = scene.simulate(record.layout)
        lead = record.score / mark.score - 1.0 if mark.score > 0.0 else None
        gain = "" if lead is None or not scene.unit else f", {lead:+.2%}"
        text += [
            f"Best row known: **{scene.in_words(record.score, wave)}**{gain}; found by "
            f"`{record.method}` (seed {record.seed}) in {record.seconds:g} s.", "",
            drawing(record.layout, scene), "",
            schedule("gap in front of each domino [mm]", 1e3 * record.layout.spacing), "",
        ]  # fmt: skip
        if scene.free_thickness or scene.stock:
            text += [schedule("thickness [mm]", 1e3 * record.layout.thickness), ""]
        if scene.free_height:
            text += [schedule("height [m]", record.layout.height), ""]
        text += checked(record, scene)
    source = (package_files("domino_env.scenes") / "shipped" / f"{name}.toml").read_text("utf-8")
    return "\n".join(
        [
            *text,
            "## Try it",
            "",
            "```",
            f"domino optimize {name}                        # search one yourself",
            f"domino best-known {name} --layout runs/best.csv # the row above",
            f"domino report runs/best.csv --scene {name}      # and see it race",
            "```",
            "",
            "## The file",
            "",
            "```toml",
            source.rstrip(),
            "```",
            "",
        ]
    )


def checked(record: BestKnown, scene: Any) -> list[str]:
    """What others than the model saw of the row: hinged, and what is left of its gain on floors."""
    one = known_verification(record.layout, scene.physics)
    if one is None:
        return []
    lines = [f"On fixed pivots, in the simulator that keeps no contact closed: {one.verdict}", ""]
    for look in one.floors[1:]:
        lead = "" if look.gain is None else f", {look.gain:+.2%} over the best uniform row there"
        up = f"; {look.staying_up} stay up" if look.staying_up else ""
        lines.append(f"- On a floor of friction {look.floor:g}: {look.score}{lead}{up}.")
    first = f" (The first {one.first} dominoes.)" if one.first < one.count else ""
    return [*lines, "", f"[Checked in other physics](../verification.md).{first}", ""]


def methods_page() -> str:
    """Every method's idea, as its module tells it."""
    lines = ["# Search methods", ""]
    lines += ["`domino optimize SCENE --method NAME`, or `search(scene, method=NAME)`.", ""]
    modules: dict[str, list[str]] = {}
    for name, place in METHODS.items():
        modules.setdefault(place.partition(":")[0], []).append(f"`{name}`")
    for module, names in modules.items():
        lines += [f"## {', '.join(names)}", "", f"::: optimize.methods.{module}", *METHOD_OPTIONS]
        lines.append("")
    lines += ["## Peers", "", "Methods of other projects, where these are installed:", ""]
    lines += [f"- `{name}` needs {needed}" for name, (_, needed) in PEERS.items()]
    return "\n".join(lines) + "\n"


def drawing(layout: de.Layout, scene: Any) -> str:
    """A row as it topples, to scale: an SVG picture in a block of its own."""
    motion = Motion(layout, scene.physics)
    cut = layout.count > 2.5 * ENDS and layout.is_flat
    instant = FALLEN * motion.end
    if cut:  # the front is among those that are drawn
        instant = float(scene.simulate(layout).arrival_times[ENDS // 2])
    leader = int(motion.leader([instant])[0][0])
    corners = outlines(layout, motion.angles([instant])[0])
    shown = list(range(layout.count))
    if cut:
        shown = [*range(ENDS), *range(layout.count - ENDS, layout.count)]
        between = layout.positions[layout.count - ENDS] - layout.positions[ENDS - 1]
        corners[layout.count - ENDS :, :, 0] -= between - BREAK * layout.height[0]
    tall = float(layout.height.max())
    left = float(corners[shown, :, 0].min())
    scale = (WIDE - 2.0 * ROOM) / (float(corners[shown, :, 0].max()) - left)
    ground = ground_line(layout, tall, tall)
    lowest = float(ground[:, 1].min())
    high = (tall + float(np.ptp(ground[:, 1]))) * scale + 2.0 * ROOM
    base = high - ROOM + lowest * scale  # where the height of the first pivot is
    shapes = []
    for i in shown:
        points = " ".join(
            f"{ROOM + (x - left) * scale:.1f},{base - z * scale:.1f}" for x, z in corners[i]
        )
        kind = "#d55e00" if i == leader else "#0b6e99" if i < leader else "#8d99a6"
        shapes.append(f'<polygon points="{points}" fill="{kind}"/>')
    if cut:
        middle = float(corners[layout.count - ENDS, :, 0].min()) - 0.5 * BREAK * tall
        x = ROOM + (middle - left) * scale
        words = f"… {layout.count - 2 * ENDS} more …"
        shapes.append(
            f'<text x="{x:.0f}" y="{high / 2:.0f}" text-anchor="middle" font-size="11" '
            f'fill="currentColor">{words}</text>'
        )
    floor = f'<line x1="0" x2="{WIDE:.0f}" y1="{base:.1f}" y2="{base:.1f}" stroke="#8d99a6"/>'
    if not layout.is_flat:
        line = " ".join(
            f"{ROOM + (x - left) * scale:.1f},{base - z * scale:.1f}" for x, z in ground
        )
        floor = f'<polyline points="{line}" fill="none" stroke="#8d99a6"/>'
    words = f"{layout.count} dominoes to scale, {layout.length:.3f} m, {instant:.2f} s after a push"
    return _svg(high, floor + "".join(shapes), words)


def schedule(name: str, values: np.ndarray) -> str:
    """Numbers along the row as bars: an SVG picture with a scale."""
    high, left = 120.0, 44.0
    top = float(values.max())
    scale, step = (high - 26.0) / top, (WIDE - left - ROOM) / len(values)
    bars = "".join(
        f'<rect x="{left + k * step:.2f}" y="{high - 6.0 - v * scale:.1f}" '
        f'width="{max(0.8 * step, 0.5):.2f}" height="{v * scale:.1f}" fill="#0b6e99"/>'
        for k, v in enumerate(values)
    )
    marks = "".join(
        f'<text x="{left - 6:.0f}" y="{high - 2.0 - v * scale:.0f}" text-anchor="end" '
        f'font-size="11" fill="currentColor">{v:.3g}</text>'
        for v in (top, 0.0)
    )
    title = f'<text x="{left:.0f}" y="12" font-size="12" fill="currentColor">{name}</text>'
    words = f"{name}: first {values[0]:.3g}, least {values.min():.3g}, last {values[-1]:.3g}"
    return _svg(high, title + marks + bars, words)


def _svg(high: float, inside: str, words: str) -> str:
    return (
        f'<div><svg viewBox="0 0 {WIDE:.0f} {high:.0f}" width="100%" role="img" '
        f'aria-label="{words}"><title>{words}</title>{inside}</svg></div>'
    )


def readme_with_table(text: str) -> str:
    """README with the table of scenes as the records are now, and that of the benchmark's page."""
    benchmark = (Path(__file__).parent / "benchmark.md").read_text("utf-8")
    table = re.search(r"<!-- summary -->\n\n(.*?)\n\n<!-- end -->", benchmark, re.DOTALL)
    assert table is not None
    scenes = "\n".join(scenes_table(best_known(), "domino_env/scenes/shipped/{}.toml"))
    return _between(BENCHMARK_HERE, _between(SCENES_HERE, text, scenes), table[1])


def _between(comment: str, text: str, table: str) -> str:
    """A text with another table after a comment."""
    place = re.compile(MADE.format(re.escape(comment)), re.DOTALL)
    return place.sub(lambda found: f"{found[1]}\n{table}\n\n{found[2]}", text)


if __name__ == "__main__":
    README = Path(__file__).resolve().parents[1] / "README.md"
    README.write_text(readme_with_table(README.read_text("utf-8")), "utf-8")
