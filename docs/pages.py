"""Fill the pages with tables and numbers from docstrings, stored results and short simulations.

``python docs/pages.py`` writes README.md, the pages in docs/ and scenes.csv: tables, between the
comments ``<!-- name -->`` and ``<!-- end -->``, and numbers that several pages quote. A number is
marked by an HTML comment with its name directly behind it: 3.2 and ``<!--gain.sprint-->``. MkDocs
calls `on_config`, `on_files` and `on_page_markdown` (mkdocs.yml, hooks), which add a page for every
scene, with pictures, and pages of the public names, and list them in the navigation.
"""

from __future__ import annotations

import ast
import csv
import re
from functools import cache, partial
from importlib.resources import files as package_files
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

import domino_env as de
from agents.benchmark import references
from agents.rollout import evaluation_seeds, is_random
from agents.scripted import ScriptedPolicy
from domino_env import DominoChain, DominoChainVector
from domino_env.core.checks import CODE_ADDRESS
from domino_env.core.colours import UNIFORM
from domino_env.core.plot_style import png
from domino_env.core.tables import csv_table, fill_tables, markdown_table
from domino_env.core.types import Floats
from domino_env.rigid.known import known_verification, not_toppled, read_verified
from domino_env.scenes.io.reading import read_layout, schema_fields
from domino_env.validation.source import shipped_sources
from domino_env.view.animation import poses
from domino_env.view.compared import ComparedLayout
from domino_env.view.figures import DrawnLayout, draw_layouts, draw_with_uniform
from optimize import search
from optimize.experiments.best_known import BestKnown, best_known
from optimize.methods.registry import METHODS, THIRD_PARTY
from optimize.studio.page import page_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mkdocs.structure.files import Files

STANDARD = 0.0075  # thickness of a standard domino [m]
SUMMARY_COLUMNS = ("scene", "problem", "result, over equal gaps", "floor 0.5")
REACTING = {"draw": "rule", "tempo-noise": "controller"}  # policies that see what is random
DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
PACKAGES = ("domino_env", "optimize", "agents")
MODULE = "-module"  # end of names: of Wave and wave, some file systems would keep one
UNDERLINED = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)  # a section of a docstring
SCENE_PAGE = """\
# {name}

{title}.

{text}

![The layout and the uniform baseline]({name}.png)

## Try it

[Open the scene in the page of the studio](../domino-studio.html#scene={name}), or

```
domino studio {name}                          # the same page, without network
domino optimize {name}                        # search for a layout
domino best-known {name} --layout runs/best.csv # write the best known layout
domino report runs/best.csv --scene {name}      # race it against the baseline
```

## The file

```toml
{source}```
"""
BEST = """\
The best known layout was found by `{method}` (seed {seed}). [Verification](../verification.md)
compares it with rigid bodies, on fixed pivots and on floors."""
DRAWN = """\
Below, one random order of the pieces: equal gaps, and the layout of the policy `rule`, which sees
the pieces in hand. Means over 200 orders, with the best known layout for each order as hindsight:
[when to learn](../when-to-learn.md). The best known layout, with {best:.4f} m/s, takes the pieces
in any order."""
MARK = re.compile(r"([^\s<>(|*`~]+)<!--([a-z][\w.-]*)-->")
MEASURED = {
    # [s] simulation of forty free-standing dominoes on one core (domino simulate --floor 0.5)
    "seconds.standing.least": "0.1",
    "seconds.standing.most": "0.2",
    # [s] compilation before a first search on one core (empty the cache, then domino optimize)
    "seconds.compile.least": "10",
    "seconds.compile.most": "25",
    # [µs] de.simulate of forty dominoes on one core: equal ones, random layouts (timeit)
    "us.equal": "35",
    "us.most": "80",
    # simulations that take as long as one with its gradient (make bench)
    "gradient.least": "3",
    "gradient.most": "4",
}
GALLERY = "<!-- on the site, a gallery of the scenes -->"
PAGE = "domino-studio.html"
OPEN_PAGE = "<!-- on the site, a link to the page -->"
BUTTON = f"[Design a row now, in this browser]({PAGE}){{ .md-button .md-button--primary }}"
EQUATION = re.compile(r"^\$\$(.+?)(?: \\tag\{(\d+)\})?\$\$$", re.MULTILINE)
SITE_LINKS = {  # links to files of the repository, and to pages of the site
    r"\(\.\./\.\./domino_env/scenes/shipped/([\w-]+)\.toml\)": r"(\1.md)",
    r"\[`(\w+)`\]\(\.\./(\w+)/([\w/]+)\.py\)": r"[`\1`][\2.\1]",
}


def on_config(config: Any) -> None:
    """Set the address of the code, from which the site links to it."""
    config.repo_url = CODE_ADDRESS or None


def on_files(files: Files, config: Any) -> Files:
    """Add the page of the studio, pages and pictures of the scenes, and pages of public names."""
    from mkdocs.structure.files import File

    pages: dict[str, str | bytes] = {PAGE: page_text()}
    for name, record in best_known().items():
        scene = de.load_scene(name)
        source = package_files("domino_env.scenes") / "shipped" / f"{name}.toml"
        text = (DRAWN if scene.hand else BEST).format(
            method=record.method, seed=record.seed, best=record.score
        )
        pages[f"scenes/{name}.md"] = SCENE_PAGE.format(
            name=name, title=scene.title, text=text, source=source.read_text("utf-8")
        )
        pages[f"scenes/{name}.png"] = png(_scene_figure(scene, record))
        pages[f"scenes/{name}-strip.png"] = _strip(scene, record.layout)
    _entries(config.nav, "Scenes").extend({n: f"scenes/{n}.md"} for n in best_known())
    for package in PACKAGES:
        listed: list[dict[str, str]] = []
        for title, names in reference_pages(package):
            place = f"reference/{package}/{title}.md"
            listed.append({", ".join(names): place})
            level = 2 if title.endswith(MODULE) else 1  # signatures are too long for a title
            objects = (
                f"::: {package}.{n}\n    options: {{heading_level: {level}}}\n" for n in names
            )
            pages[place] = f"# {', '.join(names)}\n\n" * (level == 2) + "\n".join(objects)
        _entries(config.nav, "Reference").append({package: listed})
    for path, content in pages.items():
        files.append(File.generated(config, path, content=content))
    return files


def _entries(nav: list[Any], title: str) -> list[Any]:
    """Return the entries of a section of the navigation."""
    return next(entry[title] for entry in nav if title in entry)


def reference_pages(package: str) -> list[tuple[str, list[str]]]:
    """Return names of pages and the public names on each: a class, or functions of a module."""
    pages: dict[str, list[str]] = {}
    for name, source in public_names(package).items():
        is_class = name[:1].isupper() and not name.isupper()
        page = name if is_class else source.stem + MODULE
        pages.setdefault(page, []).append(name)
    return sorted(pages.items(), key=lambda page: page[1][0].casefold())


def _scene_figure(scene: de.Scene, record: BestKnown) -> Figure:
    """Draw the best known layout and the uniform baseline; of `draw`, the rule in one order."""
    if not scene.hand:
        drawn = SimpleNamespace(scene=scene, layout=record.layout, score=record.score)
        drawn.wave = scene.simulate(record.layout)
        drawn.score_text = scene.format_with_gain(record.score, drawn.wave)
        return draw_with_uniform(drawn, "best known")
    layout = ScriptedPolicy("rule").build(scene).layout
    (order,) = scene.orders([np.random.default_rng(evaluation_seeds(scene)[0])])
    uniform = scene.layout(scene.uniform().layout.spacing, order)
    waves = scene.simulate(uniform), scene.simulate(layout)
    drawn_layouts = [
        DrawnLayout(uniform, waves[0], "equal gaps, pieces as they come", UNIFORM),
        DrawnLayout(layout, waves[1], "rule, with three pieces in hand"),
    ]
    gain = waves[1].mean_speed / waves[0].mean_speed - 1.0
    headline = f"{scene.name}: {gain:.1%} over equal gaps in this order of the pieces"
    return draw_layouts(drawn_layouts, headline, scene.title, scene)


def _strip(scene: de.Scene, layout: de.Layout) -> bytes:
    """Return a picture of a layout at one moment of its wave, as PNG."""
    wave, file = scene.simulate(layout), BytesIO()
    poses([ComparedLayout(scene.name, wave)], 1, 500).save(file, "PNG")
    return file.getvalue()


def gallery() -> str:
    """Return the gallery of the scenes, for the site."""
    cards = (
        f"-   [![Its best known layout, half toppled]({name}-strip.png)]({name}.md)\n\n"
        f"    [**{name}**]({name}.md): {de.load_scene(name).title}\n"
        for name in best_known()
    )
    return '<div class="grid cards" markdown>\n\n' + "\n".join(cards) + "\n</div>"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Write equations, between pairs of $$, as MathML, links to pages of the site, the gallery."""
    markdown = markdown.replace(OPEN_PAGE, BUTTON)
    if GALLERY in markdown:
        markdown = markdown.replace(GALLERY, gallery())
    for link, place in SITE_LINKS.items():
        markdown = re.sub(link, place, markdown)
    return EQUATION.sub(_equation, markdown)


def _equation(equation: re.Match[str]) -> str:
    """Return the MathML of an equation, with its number at the right."""
    from latex2mathml.converter import convert

    number = f"<span>({equation[2]})</span>" if equation[2] else ""
    style = "display:flex;justify-content:space-between;overflow:auto hidden"
    return (
        f'<div style="{style}"><span></span>{convert(equation[1], display="block")}{number}</div>'
    )


def filled_pages() -> dict[Path, str]:
    """Return README, the pages and the table of scenes with their present content."""
    columns = scene_columns()
    tables: dict[str, dict[str, list[str]]] = {
        "README.md": {"code": code_lines(), "citation": citation()},
        "docs/index.md": {"code": code_lines()},
        "docs/scenes/index.md": {
            "scenes": scene_table("../../domino_env", summary_columns(), SUMMARY_COLUMNS),
            "keys": key_table(),
        },
        "docs/methods.md": {
            "methods": method_sections(),
            "peers": [f"- `{name}` needs {package}" for name, (_, package) in THIRD_PARTY.items()],
        },
        "docs/reference.md": {package: name_table(package) for package in PACKAGES},
    }
    values, pages = numbers(), {}
    for path in (ROOT / "README.md", DOCS / "scenes" / "index.md", *sorted(DOCS.glob("*.md"))):
        text = fill_tables(_text(path), tables.get(path.relative_to(ROOT).as_posix(), {}))
        pages[path] = with_numbers(text, values)
    columns = columns | return_columns()
    pages[DOCS / "scenes.csv"] = csv_table(columns, zip(*columns.values(), strict=True))
    return pages


def code_lines() -> list[str]:
    """Return the line that says where the commands are entered."""
    if CODE_ADDRESS:
        return [f"`git clone {CODE_ADDRESS}`, then, in its folder:"]
    return ["In the folder of the project:"]


def citation() -> list[str]:
    """Return the BibTeX entry of CITATION.cff."""
    text = _text(ROOT / "CITATION.cff").partition("references:")[0]
    fields = dict(re.findall(r"^ *(?:- )?([a-z-]+): (.+)$", text, re.MULTILINE))
    abstract = re.findall(r"abstract: >-\n +(.+)\.\n", text)[0]
    entry = {
        "author": f"{{{fields['name']}}}",
        "title": f"{{{fields['title']}}}: {abstract[0].lower()}{abstract[1:]}",
        "version": fields["version"],
        "year": fields.get("date-released", "").strip("'\"")[:4],
        "url": CODE_ADDRESS,
    }
    lines = [f"  {key} = {{{value}}}," for key, value in entry.items() if value]
    return ["```bibtex", "@software{domino_chains,", *lines, "}", "```"]


@cache
def scene_columns() -> dict[str, list[str]]:
    """Return the columns of the table of scenes: scores, and gains on pivots and on floors."""
    checks = [check for verified in read_verified().values() for check in verified.floors]
    floors = sorted({check.floor for check in checks if check.floor})
    names = ["scene", "problem", "gap = thickness", "equal gaps", "best known"]
    names += ["over gap = thickness", "over equal gaps", *(f"floor {floor:g}" for floor in floors)]
    lines = []
    for name, record in best_known().items():
        scene = de.load_scene(name)
        baseline = scene.uniform()
        habit = habitual_layout(scene)
        scores = None if habit is None else scene.score(habit), baseline.score, record.score
        layouts = habit, baseline.layout, record.layout
        lines.append([
            name, scene.title,
            *(score_cell(scene, *one) for one in zip(scores, layouts, strict=True)),
            *(gain_cell(scene, record.score, score) for score in scores[:2]),
            *(floor_cell(floor, scene, record) for floor in floors),
        ])  # fmt: skip
    return dict(zip(names, map(list, zip(*lines, strict=True)), strict=True))


def summary_columns() -> dict[str, list[str]]:
    """Return the columns of the page of scenes: what the titled task allows, and on one floor.

    A score that is no speed is an error; in scenes with random events it is that of a policy.
    """
    columns = scene_columns() | {SUMMARY_COLUMNS[2]: []}
    floors = columns["floor 0.5"] = columns["floor 0.5"].copy()
    for i, name in enumerate(columns["scene"]):
        gain, by = columns["over equal gaps"][i], ""
        scene, reached = de.load_scene(name), best_known()[name].score
        if policy := REACTING.get(name):
            scores, by, floors[i] = benchmark_scores(name), f", by `{policy}`", "–"
            reached = scores[policy][0]
            gain = f"{scene.criterion.gain(reached, scores['uniform'][0]):+.1%}{by}"
        if scene.tempo:
            errors = (scene.criterion.label(s, 2) for s in (reached, scene.uniform().score))
            error, even = (text.removeprefix("RMS error ") for text in errors)
            gain = f"error {error}, not {even}{by}"
        columns[SUMMARY_COLUMNS[2]].append(gain)
    return columns


@cache
def benchmark_scores(name: str) -> dict[str, Floats]:
    """Return the scores of each policy in a scene, of the uniform baseline, and with hindsight."""
    runs = [run for run in read_csv("benchmark.csv") if run["scene"] == name]
    scores: dict[str, list[float]] = {}
    for run in runs:
        scores["uniform"] = [float(run["uniform"])]
        scores.setdefault(run["algorithm"], []).append(float(run["score"]))
    if name in references():
        scores["hindsight"] = [references()[name]["hindsight"]]
    return {policy: np.array(values) for policy, values in scores.items()}


def read_csv(name: str) -> list[dict[str, str]]:
    """Return the lines of a table beside this file."""
    with (DOCS / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def scene_table(package: str, columns: dict[str, list[str]], names: tuple[str, ...]) -> list[str]:
    """Return the table of scenes with some columns; `package` is the place of domino_env."""
    links = [f"[`{name}`]({package}/scenes/shipped/{name}.toml)" for name in columns["scene"]]
    cells = [columns[name] for name in names[1:]]
    return markdown_table(names, zip(links, *cells, strict=True))


def habitual_layout(scene: de.Scene) -> de.Layout | None:
    """Return the layout with gaps as wide as the thickness; None if the scene forbids it."""
    baseline = scene.uniform().layout
    thickness = baseline.thickness if scene.stock else np.full(scene.count, STANDARD)
    sizes = thickness[:-1], thickness, baseline.height
    layout = de.Layout(*sizes) if scene.ground is None else scene.ground.layout(*sizes)
    return None if scene.violations(layout) or scene.space.growth.is_free else layout


def score_cell(scene: de.Scene, score: float | None, layout: de.Layout | None) -> str:
    """Format the score of a layout for a table."""
    if score is None or layout is None:
        return "–"
    if score <= 0.0:
        return "stops"
    if scene.criterion.is_mean_speed:
        return f"{score:.4f}"
    return scene.format_score(score, scene.simulate(layout))


def gain_cell(scene: de.Scene, score: float, reference: float | None) -> str:
    """Format by how much the best known layout is faster than another."""
    if reference is None or reference <= 0.0 or not scene.criterion.is_mean_speed:
        return "–"
    return f"{score / reference - 1.0:+.1%}"


def floor_cell(floor: float, scene: de.Scene, record: BestKnown) -> str:
    """Format the gain of a best known layout on a floor over the uniform baseline there."""
    verified = known_verification(record.layout, scene.physics)
    check = next((c for c in verified.floors if c.floor == floor), None) if verified else None
    if verified is None or check is None:
        return "–"
    if check.staying_up:
        return not_toppled(check.staying_up)
    if check.error is not None and not scene.placement:
        return f"{check.error:.1f} ms"
    # a gain of the first dominoes only is another quantity
    return "–" if check.gain is None or verified.first < verified.count else f"{check.gain:+.1%}"


def key_table() -> list[str]:
    """Return the table of the keys of a scene file, from its schema."""
    lines = []
    for table, key, field in schema_fields():
        default = field.get("default")
        choice = ": " + ", ".join(field["enum"]) if len(field.get("enum", ())) > 1 else ""
        value = "" if default is None else f"`{default}`"
        lines.append((f"[{table}]" * bool(table), f"`{key}`", field["description"] + choice, value))
    return markdown_table(("table", "key", "meaning", "default"), lines)


def return_columns() -> dict[str, list[object]]:
    """Return columns of observations, actions and returns in all scenes.

    Returns are means over episodes [%]; random layouts on a floor, which take minutes, are left
    out. References react to what is random in the scene, or are planned for it.
    """
    lines: list[tuple[object, ...]] = []
    for name, record in best_known().items():
        scene = de.load_scene(name)
        env, rng = DominoChain(scene), np.random.default_rng(0)
        (size,), (entries,) = env.action_space.shape, env.observation_space.shape
        gain, uniform = scene.criterion.gain, scene.uniform().score
        others = {"best known": gain(record.score, uniform)}
        if policy := REACTING.get(name):
            scores = benchmark_scores(name)
            others = {one: gain(scores[one][0], uniform) for one in ("plan", policy, "hindsight")}
        means = []
        for spread in (1.0, 0.0):
            if spread and scene.simulator.is_slow:
                means.append("")
                continue
            seeds = range(256 if spread or is_random(scene) else 1)
            act = partial(_random_actions, rng, spread, size)
            vector = DominoChainVector(len(seeds), scene)
            means.append(f"{_returns(act, vector, seeds).mean():z.1f}")
        known = ", ".join(f"{key} {100.0 * value:.1f}" for key, value in others.items())
        lines.append((entries, size, scene.count - 1, *means, known))
    names = ("entries of an observation", "entries of an action", "steps of an episode")
    names += ("return of random actions", "return of actions of 0", "returns of references")
    return dict(zip(names, map(list, zip(*lines, strict=True)), strict=True))


def _returns(act: Any, env: DominoChainVector, seeds: range) -> Floats:
    """Return the returns (B,) of one episode in each of B environments."""
    returns, running = np.zeros(env.num_envs), np.ones(env.num_envs, np.bool_)
    observations, _ = env.reset(seed=[*seeds])
    while running.any():
        observations, rewards, ended, _, _ = env.step(act(observations))
        returns += np.where(running, rewards, 0.0)
        running &= ~ended
    return returns


def _random_actions(rng: np.random.Generator, spread: float, size: int, observations: Any) -> Any:
    """Return uniform random actions (B, A) within ±spread."""
    return spread * rng.uniform(-1.0, 1.0, (len(observations), size))


def method_sections() -> list[str]:
    """Return a section for each module of search methods, from its docstring."""
    modules: dict[str, list[str]] = {}
    for name, place in METHODS.items():
        modules.setdefault(place.partition(":")[0], []).append(f"`{name}`")
    lines: list[str] = []
    for module, names in modules.items():
        source = ROOT / "optimize" / "methods" / f"{module.replace('.', '/')}.py"
        text = ast.get_docstring(ast.parse(source.read_text("utf-8"))) or ""
        text = UNDERLINED.split(text)[0].rstrip()  # without references
        lines += [f"## {', '.join(names)}", "", text, ""]
    return lines[:-1]


@cache
def public_names(package: str) -> dict[str, Path]:
    """Return the names that a package's stub lists, each with the file that defines it."""
    folder = ROOT / package
    sources = {}
    for node in ast.parse((folder / "__init__.pyi").read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            place = folder.joinpath(*node.module.split("."))
            source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            sources |= {alias.name: source for alias in node.names}
    return dict(sorted(sources.items(), key=lambda item: (item[0].casefold(), item[0])))


def name_table(package: str) -> list[str]:
    """Return the table of the public names of a package, each with a link to its source."""
    lines = []
    for name, source in public_names(package).items():
        link = f"[`{name}`](../{source.relative_to(ROOT).as_posix()})"
        lines.append((link, summary(name, source)))
    return markdown_table(("name", "summary"), lines)


def summary(name: str, source: Path) -> str:
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


# quoted numbers ---------------------------------------------------------------------------------


def numbers() -> dict[str, str]:
    """Return all numbers by name, as they are written."""
    course = de.load_scene("course")
    layouts = {"uniform": course.uniform().layout, "best": best_known()["course"].layout}
    times = {
        f"seconds.course.{name}": f"{course.simulate(layout).arrival_times[-1]:.3f}"
        for name, layout in layouts.items()
    }
    computed = scene_numbers() | verification_numbers() | source_numbers() | run_numbers()
    computed |= race_numbers() | free_end_numbers() | reached_numbers()
    claims = {f"claims.{x['quantity']}": x["value"] for x in read_csv("claims.csv") if not x["gap"]}
    questions = {f"questions.{x['quantity']}": x["value"] for x in read_csv("open-questions.csv")}
    return MEASURED | times | computed | claims | questions


def scene_numbers() -> dict[str, str]:
    """Return speeds, gains [%] and lengths [mm] of the scenes whose scores are speeds."""
    (gain,) = re.findall(r"^\| length 997 mm .* \+([\d.]+)% \|", _text(DOCS / "why.md"), re.M)
    values = {"gain2.sprint.length": gain}
    for name, record in best_known().items():
        scene = de.load_scene(name)
        baseline = scene.uniform()
        verified = known_verification(record.layout, scene.physics)
        if not scene.criterion.is_mean_speed:
            for check in verified.floors if verified else ():
                if check.error is not None:
                    values[f"error.{check.floor}.{name}"] = f"{check.error:.1f}"
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


def race_numbers() -> dict[str, str]:
    """Return the lengths [mm], times [s] and gain [%] of race.gif."""
    scene = de.load_scene(DOCS / "race.scene.toml")
    best, uniform = scene.simulate(read_layout(DOCS / "race.csv", scene)), scene.uniform()
    return {
        "race.designed": f"{1e3 * uniform.layout.length:.0f}",
        "race.length": f"{1e3 * best.layout.length:.0f}",
        "race.gain": f"{100.0 * (scene.score(best) / uniform.score - 1.0):.1f}",
        "race.seconds.best": f"{best.arrival_times[-1]:.3f}",
        "race.seconds.uniform": f"{uniform.wave.arrival_times[-1]:.3f}",
    }


def free_end_numbers() -> dict[str, str]:
    """Return what the free end of `course` buys, if sixty dominoes follow at the equal gap [%].

    These are losses in mean speed of the best known layout at some dominoes, and the gain of a
    layout that was designed for the longer row.
    """
    course = de.load_scene("course")
    uniform, best = course.uniform().layout, best_known()["course"].layout
    longer = course.replace(run_out=de.RunOut(60, float(uniform.spacing[0])))
    speeds = []
    for layout in (uniform, best):
        wave = longer.simulate(layout)
        speeds.append(wave.layout.positions[1:] / wave.arrival_times[1:])
    loss = 100.0 * (1.0 - speeds[1] / speeds[0])
    values = {f"free_end.{n}": f"{loss[n - 1]:.1f}" for n in (62, 65, 119)}
    return values | {"free_end.designed": f"{100.0 * search(longer, budget=500, seed=0).gain:.1f}"}


def reached_numbers() -> dict[str, str]:
    """Return medians of normalised scores of the benchmark [%], by scene and algorithm."""
    scores: dict[str, list[float]] = {}
    for run in read_csv("benchmark.csv"):
        name = f"reached.{run['scene']}.{run['algorithm']}"
        scores.setdefault(name, []).append(100.0 * float(run["normalised_score"]))
    return {name: f"{np.median(values):.0f}" for name, values in scores.items()}


def run_numbers() -> dict[str, str]:
    """Return results of benchmark.csv: counts on sprint, means in scenes with random events.

    A hindsight score is 0 for the open-loop plan, and 1 where all that is random is known.
    """
    values, best = {}, best_known()["sprint"].score
    for policy, scores in benchmark_scores("sprint").items():
        values[f"{policy}.runs"] = str(len(scores))
        values[f"{policy}.near"] = str((scores >= 0.999 * best).sum())
    for name in REACTING:
        criterion, runs = de.load_scene(name).criterion, benchmark_scores(name)
        (uniform,), (plan,), (hindsight,) = (runs[x] for x in ("uniform", "plan", "hindsight"))
        for policy, scores in runs.items():
            normalised = (scores - plan) / (hindsight - plan)
            values |= {
                f"{name}.{policy}.score": f"{scores.mean():.4f}",
                f"{name}.{policy}.gain": f"{100.0 * criterion.gain(scores, uniform).mean():.2f}",
                f"{name}.{policy}.hindsight_score": f"{normalised.mean():.2f}",
                f"{name}.{policy}.rms_ms": f"{criterion.displayed(scores).mean():.2f}",
            }
    return values


def verification_numbers() -> dict[str, str]:
    """Return the agreement of the model with the reference simulator on fixed pivots."""
    verified = read_verified().values()
    agreeing = [entry for entry in verified if entry.verdict.startswith("AGREES")]
    largest = max(entry.checks[0].largest for entry in agreeing)
    verdicts = [line["verdict"] for line in read_csv("verified-random.csv")]
    return {
        "known.agree": str(len(agreeing)),
        "known.all": str(len(verified)),
        "known.largest": f"{100.0 * largest:.3f}",
        "random.all": str(len(verdicts)),
        "random.differ": str(verdicts.count("differs")),
        "random.close": str(verdicts.count("close")),
    }


def source_numbers() -> dict[str, str]:
    """Return results of the comparison with measured chains, differences in speed in percent."""
    page = _text(DOCS / "measured-sources.md")
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


def with_numbers(text: str, values: dict[str, str]) -> str:
    """Return the text of a page with the current values of its marked numbers.

    Raises
    ------
    KeyError
        For a name without a value.
    """
    return MARK.sub(lambda mark: f"{values[mark[2]]}<!--{mark[2]}-->", text)


def _text(path: Path) -> str:
    return path.read_text("utf-8")


if __name__ == "__main__":
    for path, text in filled_pages().items():
        path.write_text(text, "utf-8")
