"""Generate the pages of scenes, methods and public names.

``python docs/pages.py`` writes the tables of README.md and those generated pages that readers of
the repository have too: docs/scenes/index.md, docs/methods.md and docs/reference.md. MkDocs calls
`on_config`, `on_files` and `on_page_markdown` (mkdocs.yml, hooks) and adds a page for every scene
and every public name.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from importlib.resources import files as package_files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import domino_env as de
from domino_env.core.tables import markdown_table
from domino_env.physics.motion import Motion, outlines
from domino_env.rigid.known import known_verification, not_toppled, read_verified
from domino_env.scenes.shipping import scene_schema
from domino_env.view.ground import ground_line
from optimize.experiments.best_known import BestKnown, best_known
from optimize.methods.registry import METHODS, PEERS

if TYPE_CHECKING:
    from collections.abc import Callable

    from mkdocs.structure.files import Files

WIDE, ROOM = 940.0, 10.0  # [px]
ENDS = 36  # dominoes that are drawn at either end of a long layout
BREAK = 2.0  # [heights] between the two ends
FALLEN = 0.6  # of the wave's time: the moment that is drawn
STANDARD = 0.0075  # thickness of a standard domino [m]
README_FLOOR = 0.5  # friction of the floor of README's table
FLOOR_NOTE = (
    "",
    "The last columns are gains on floors of the given friction (`domino best-known --verify`). A",
    "layout of which dominoes remain standing has no gain; of `marathon` only the first 100",
    "dominoes are simulated on floors ([verification](../verification.md)). The score of",
    "`jitter` is the speed that 95 % of inexact placements reach; on floors its mean speed",
    "without errors is compared. The baseline of `draw` is a mean over random orders, on floors",
    "that of one order; its best known layout has a free order and is a bound.",
)
QUESTIONS = {
    "course": "How fast can sixty dominoes cover 1.2 m?",
    "downhill": "How fast are forty dominoes down a slope of 3°?",
    "draw": "How fast are forty dominoes drawn from a box? (gain: a bound, with a free order)",
    "gentle": "How fast are thirty rough dominoes after a faint push?",
    "hills": "Which gaps lead fastest over two hills?",
    "ideal": "How fast are forty dominoes of any thickness without friction?",
    "jitter": "Which forty gaps are fast although they are placed inexactly?",
    "magnify": "How tall a domino can twelve growing ones topple?",
    "marathon": "How fast are a thousand dominoes?",
    "sprint": "How fast are forty standard dominoes?",
    "sprint-thickness": "How fast are they if each may have another thickness?",
    "stock": "Which order of forty dominoes from a box of three thicknesses is fastest?",
    "table": "Which layout is fastest on a table, where dominoes slip?",
    "tempo": "Which gaps and thicknesses accelerate the hits evenly from 30 a second to 45?",
    "tempo-noise": "How closely do they follow that schedule if placed inexactly?",
    "uphill": "How fast are forty dominoes up a slope of 4°?",
}
MADE = r"(<!-- {} -->\n).*?(<!-- end -->)"  # the text between two comments
SCENES_HERE = "made by python docs/pages.py"
DOCS = Path(__file__).resolve().parent
PACKAGES = {
    "domino_env": "the simulator, the scenes and the environments",
    "optimize": "the searches",
    "agents": "training, evaluation and design by policies",
}
UNDERLINED = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)  # a section of a docstring


def on_config(config: Any) -> Any:
    """Add every scene and every public name to the menu."""
    for section in config.nav:
        if "Scenes" in section:
            section["Scenes"] = ["scenes/index.md"] + [
                {name: f"scenes/{name}.md"} for name in de.scene_names()
            ]
        if "Reference" in section:
            section["Reference"] = ["reference.md"] + [
                {package: [{name: _page_of(package, name)} for name in public_names(package)]}
                for package in PACKAGES
            ]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages; those of the repository with links to the others."""
    from mkdocs.structure.files import File

    records = best_known()
    pages = {f"scenes/{name}.md": scene_page(name, records.get(name)) for name in de.scene_names()}
    pages["scenes/index.md"] = scenes_page(records, "{}.md")
    pages["reference.md"] = reference_page(_page_of)
    for package in PACKAGES:
        for name in public_names(package):
            pages[_page_of(package, name)] = object_page(package, name)
    for path, content in pages.items():
        if present := files.get_file_from_path(path):
            files.remove(present)
        files.append(File.generated(config, path, content=content))
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
    """Load a scene; its uniform baseline is computed once."""
    return de.load_scene(name)


def scenes_page(
    records: dict[str, BestKnown], link: str = "../../domino_env/scenes/shipped/{}.toml"
) -> str:
    """Return the page with the table of all scenes, each with a link."""
    lines = [
        "---",
        "hide: [toc]",  # the table is wide
        "---",
        "# Scenes",
        "",
        "For everyone who looks for a design problem, or writes one. A scene is a problem in one",
        "TOML file: dominoes, physics, free variables, rules, objective. Copy one of these as a",
        "start. This page is generated by `python docs/pages.py`.",
        "",
        *scenes_table(records, link),
        "",
        "## Keys of a scene file",
        "",
        *keys(),
        "",
        "Continue with [scene files](../scene-files.md).",
    ]
    return "\n".join(lines) + "\n"


def scenes_table(records: dict[str, BestKnown], link: str) -> list[str]:
    """Return the table of scenes: baselines, best known layouts and gains on floors."""
    floors = floor_frictions()
    rows = []
    for name in de.scene_names():
        scene = shipped(name)
        habit, uniform, best = three_layouts(scene, records.get(name))
        rows.append(
            (
                f"[`{name}`]({link.format(name)})",
                scene.title,
                *(score_cell(scene, one) for one in (habit, uniform, best)),
                advantage(scene, best, habit),
                advantage(scene, best, uniform),
                *(gain_on_floor(floor, name, records) for floor in floors),
            )
        )
    names = ["scene", "problem", "gap = thickness", "best equal gaps", "best known"]
    names += ["over gap = thickness", "over equal gaps", *(f"floor {floor:g}" for floor in floors)]
    return [
        *markdown_table(names, rows),
        "",
        "Speeds are in m/s. *gap = thickness* is a habit of builders (7.5 mm if the thickness",
        "is free). A dash: no such layout, or a ratio without meaning.",
        *FLOOR_NOTE,
    ]


def readme_table(records: dict[str, BestKnown]) -> list[str]:
    """Return README's table of scenes: question, gain, and gain on a floor."""
    rows = []
    for name in de.scene_names():
        scene = shipped(name)
        _, uniform, best = three_layouts(scene, records.get(name))
        place = f"[`{name}`](domino_env/scenes/shipped/{name}.toml)"
        floor = gain_on_floor(README_FLOOR, name, records)
        rows.append((place, QUESTIONS[name], advantage(scene, best, uniform), floor))
    names = (
        "scene",
        "question",
        "gain over equal gaps",
        f"on a floor of friction {README_FLOOR:g}",
    )
    return markdown_table(names, rows)


def three_layouts(
    scene: de.Scene, record: BestKnown | None
) -> list[tuple[float, de.Layout] | None]:
    """Return score and layout of gaps as wide as the thickness, the baseline and the best known."""
    baseline = scene.uniform()
    thickness = baseline.layout.thickness if scene.stock else np.full(scene.count, STANDARD)
    values = thickness[:-1], thickness, baseline.layout.height
    habit = de.Layout(*values) if scene.ground is None else scene.ground.layout(*values)
    allowed = not scene.violations(habit) and not scene.free_height
    return [
        (scene.score(habit), habit) if allowed else None,
        (baseline.score, baseline.layout),
        (record.score, record.layout) if record else None,
    ]


def score_cell(scene: de.Scene, scored: tuple[float, de.Layout] | None) -> str:
    """Format the score of a layout for a table."""
    if scored is None:
        return "–"
    score, layout = scored
    if score <= 0.0:
        return "stops"
    return f"{score:.4f}" if scene.unit == "m/s" else scene.in_words(score, scene.simulate(layout))


def advantage(
    scene: de.Scene, scored: tuple[float, de.Layout] | None, other: tuple[float, de.Layout] | None
) -> str:
    """Format by how much one layout is faster than another."""
    if scored is None or other is None or other[0] <= 0.0 or scene.unit != "m/s":
        return "–"
    return f"{scored[0] / other[0] - 1.0:+.1%}"


def floor_frictions() -> list[float]:
    """Return the frictions of the floors on which the best known layouts were simulated."""
    checks = [check for one in read_verified().values() for check in one.floors]
    return sorted({check.floor for check in checks if check.floor})


def gain_on_floor(floor: float, name: str, records: dict[str, BestKnown]) -> str:
    """Format the gain of a best known layout on a floor over the uniform baseline there."""
    record = records.get(name)
    one = record and known_verification(record.layout, shipped(name).physics)
    for check in one.floors if one else ():
        if check.floor == floor:
            if check.staying_up:
                return not_toppled(check.staying_up)
            # a gain of the first dominoes only is another quantity
            return "–" if check.gain is None or one.first < one.count else f"{check.gain:+.1%}"
    return "–"


def keys() -> list[str]:
    """Return the table of the keys of a scene file, from its schema."""
    schema = scene_schema()
    rows = []
    for table, entry in schema["properties"].items():
        inside = schema["$defs"].get(entry.get("$ref", "").rpartition("/")[2])
        fields = inside["properties"] if inside else {table: entry}
        for key, field in fields.items():
            default = field.get("default")
            shown = "" if default is None else f"`{default}`"
            where = f"[{table}]" if inside else ""
            choice = ": " + ", ".join(field["enum"]) if len(field.get("enum", ())) > 1 else ""
            rows.append((where, f"`{key}`", field["description"] + choice, shown))
    return list(markdown_table(("table", "key", "meaning", "default"), rows))


def scene_page(name: str, record: BestKnown | None) -> str:
    """Return the page of a scene with drawings of its baseline and its best known layout."""
    scene = shipped(name)
    baseline = scene.uniform()
    text = [
        f"# {name}", "", scene.title + ".", "",
        f"Uniform baseline: {scene.in_words(baseline.score, baseline.wave)}, "
        f"gaps {1e3 * baseline.layout.spacing[0]:.2f} mm, "
        f"thickness {1e3 * baseline.layout.thickness[-1]:.2f} mm.", "",
        drawing(baseline.layout, scene), "",
    ]  # fmt: skip
    if record is not None:
        wave = scene.simulate(record.layout)
        gain = ""
        if baseline.score > 0.0 and scene.unit:
            gain = f", {record.score / baseline.score - 1.0:+.2%}"
        text += [
            f"Best known layout: **{scene.in_words(record.score, wave)}**{gain}; found by "
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
            f"domino optimize {name}                        # search for a layout",
            f"domino best-known {name} --layout runs/best.csv # write the best known layout",
            f"domino report runs/best.csv --scene {name}      # compare it with the baseline",
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
    """Return the verification of a best known layout on fixed pivots and on floors."""
    one = known_verification(record.layout, scene.physics)
    if one is None:
        return []
    lines = [f"On fixed pivots, by the reference simulator: {one.verdict}", ""]
    for check in one.floors[1:]:
        gain = "" if check.gain is None else f", {check.gain:+.2%} over the uniform baseline there"
        up = f"; {not_toppled(check.staying_up)}" if check.staying_up else ""
        lines.append(f"- On a floor of friction {check.floor:g}: {check.score}{gain}{up}.")
    first = ""
    if one.first < one.count:
        first = f" Of the first {one.first} dominoes of both layouts, whose gain differs."
    return [*lines, "", f"[Verification](../verification.md).{first}", ""]


def methods_page() -> str:
    """Return the page of methods from the docstrings of their modules."""
    lines = [
        "# Search methods",
        "",
        "For users who choose a method or want to know what one does:",
        "`domino optimize SCENE --method NAME`, or `search(scene, method=NAME)`. This page is",
        "generated by `python docs/pages.py` from the docstrings of the modules.",
        "",
    ]
    modules: dict[str, list[str]] = {}
    for name, place in METHODS.items():
        modules.setdefault(place.partition(":")[0], []).append(f"`{name}`")
    for module, names in modules.items():
        source = DOCS.parent / "optimize" / "methods" / f"{module.replace('.', '/')}.py"
        text = ast.get_docstring(ast.parse(source.read_text("utf-8"))) or ""
        lines += [f"## {', '.join(names)}", "", UNDERLINED.sub(r"**\1**", text), ""]
    lines += ["## Third-party methods", "", "Available if their packages are installed:", ""]
    lines += [f"- `{name}` needs {needed}" for name, (_, needed) in PEERS.items()]
    lines += ["", "Continue with [comparing methods](searching.md) or"]
    lines += ["[your own optimiser](your-own-optimiser.md)."]
    return "\n".join(lines) + "\n"


@cache
def public_names(package: str) -> dict[str, Path]:
    """Return the names that a package's stub lists, each with the file that defines it."""
    folder = DOCS.parent / package
    found = {}
    for node in ast.parse((folder / "__init__.pyi").read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            place = folder.joinpath(*node.module.split("."))
            source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            found |= {alias.name: source for alias in node.names}
    return dict(sorted(found.items(), key=lambda item: (item[0].casefold(), item[0])))


def summary_of(name: str, source: Path) -> str:
    """Return the first line of the docstring of a class, function or constant."""
    body = ast.parse(source.read_text("utf-8")).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            text = ast.get_docstring(node)
        elif isinstance(node, ast.Assign) and getattr(node.targets[0], "id", None) == name:
            text = after.value.value if isinstance(after, ast.Expr) else None
        else:
            continue
        if text:
            return str(text).partition("\n\n")[0].replace("\n", " ")
    raise ValueError(f"{source}: {name} has no docstring here")


def reference_page(link: Callable[[str, str], str] | None = None) -> str:
    """Return the list of all public names, each with a link to its page or to its source."""
    lines = [
        "# Reference",
        "",
        "For everyone who writes Python. All public names; the site (`make docs`) has a page for",
        "each with its parameters and results. Generated by `python docs/pages.py`.",
    ]
    for package, content in PACKAGES.items():
        rows = []
        for name, source in public_names(package).items():
            target = f"../{source.relative_to(DOCS.parent).as_posix()}"
            if link is not None:
                target = link(package, name)
            rows.append((f"[`{name}`]({target})", summary_of(name, source)))
        lines += ["", f"## {package}", "", f"`import {package}`: {content}.", ""]
        lines += markdown_table(("name", "summary"), rows)
    lines += ["", "Continue with [simulating a layout](simulating.md) for examples."]
    return "\n".join(lines) + "\n"


def object_page(package: str, name: str) -> str:
    """Return the page of a public name, which mkdocstrings fills."""
    return (
        f"# {name}\n\n::: {package}.{name}\n    options:\n      heading_level: 2\n"
        "      inherited_members: true\n\n[All public names](../reference.md)\n"
    )


def _page_of(package: str, name: str) -> str:
    """Return the path of a name's page; names may differ in upper and lower case only."""
    alike = sum(other.casefold() == name.casefold() for other in public_names(package)) > 1
    kind = ".function" if alike and name == name.casefold() else ""
    return f"reference/{package}.{name}{kind}.md"


def drawing(layout: de.Layout, scene: Any) -> str:
    """Draw a layout while it topples, to scale, as SVG."""
    motion = Motion(layout, scene.physics)
    cut = layout.count > 2.5 * ENDS and layout.is_flat
    instant = FALLEN * motion.end
    if cut:  # a moment at which the leading domino is drawn
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
    """Draw numbers along the layout as bars with a scale, as SVG."""
    high, left = 120.0, 44.0
    top = float(values.max())
    scale, step = (high - 26.0) / top, (WIDE - left - ROOM) / len(values)
    bars = "".join(
        f'<rect x="{left + k * step:.2f}" y="{high - 6.0 - v * scale:.1f}" '
        f'width="{max(0.8 * step, 0.5):.2f}" height="{v * scale:.1f}" fill="#0b6e99"/>'
        for k, v in enumerate(values)
    )
    labels = "".join(
        f'<text x="{left - 6:.0f}" y="{high - 2.0 - v * scale:.0f}" text-anchor="end" '
        f'font-size="11" fill="currentColor">{v:.3g}</text>'
        for v in (top, 0.0)
    )
    title = f'<text x="{left:.0f}" y="12" font-size="12" fill="currentColor">{name}</text>'
    words = f"{name}: first {values[0]:.3g}, least {values.min():.3g}, last {values[-1]:.3g}"
    return _svg(high, title + labels + bars, words)


def _svg(high: float, inside: str, words: str) -> str:
    return (
        f'<div><svg viewBox="0 0 {WIDE:.0f} {high:.0f}" width="100%" role="img" '
        f'aria-label="{words}"><title>{words}</title>{inside}</svg></div>'
    )


def readme_with_table(text: str) -> str:
    """Return README with the present table of scenes."""
    table = "\n".join(readme_table(best_known()))
    place = re.compile(MADE.format(re.escape(SCENES_HERE)), re.DOTALL)
    return place.sub(lambda match: f"{match[1]}\n{table}\n\n{match[2]}", text)


def committed_pages() -> dict[str, str]:
    """Return the generated pages that are part of the repository, by path in docs."""
    return {
        "scenes/index.md": scenes_page(best_known()),
        "methods.md": methods_page(),
        "reference.md": reference_page(),
    }


if __name__ == "__main__":
    README = DOCS.parent / "README.md"
    README.write_text(readme_with_table(README.read_text("utf-8")), "utf-8")
    for path, content in committed_pages().items():
        (DOCS / path).parent.mkdir(exist_ok=True)
        (DOCS / path).write_text(content, "utf-8")
