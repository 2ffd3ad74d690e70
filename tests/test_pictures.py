"""Pictures and pages follow no settings of the user."""

import ast
import re
from pathlib import Path

import matplotlib as mpl
import pytest

import domino_env as de
from domino_env.validation import accuracy, chapman, measured, measured_page
from domino_env.validation.edge_cases import CaseResult, EdgeCase
from domino_env.validation.source import shipped_sources
from domino_env.view.template import write_template
from optimize import compare, search
from optimize.experiments import pictures

ROOT = Path(__file__).resolve().parents[1]
HOSTILE = {
    "savefig.bbox": "tight", "savefig.pad_inches": 2.0, "savefig.dpi": 37, "savefig.format": "svg",
    "savefig.transparent": True, "savefig.facecolor": "red", "savefig.orientation": "portrait",
    "figure.dpi": 33, "figure.autolayout": True, "figure.subplot.left": 0.3, "font.size": 30,
    "font.family": "monospace", "font.weight": "bold", "text.color": "green", "text.usetex": True,
    "axes.facecolor": "black", "axes.linewidth": 4.0, "axes.grid": True, "axes.xmargin": 0.4,
    "axes.spines.left": False, "axes.unicode_minus": False, "axes.titlelocation": "right",
    "axes.autolimit_mode": "round_numbers", "axes.prop_cycle": mpl.cycler(color=["red"]),
    "lines.linewidth": 9.0, "lines.marker": "x", "patch.linewidth": 5.0, "hatch.linewidth": 9.0,
    "xtick.direction": "in", "xtick.major.size": 30.0, "xtick.minor.visible": True,
    "ytick.labelsize": 30, "ytick.right": True, "legend.framealpha": 0.1, "legend.shadow": True,
    "legend.title_fontsize": 30, "grid.linestyle": ":", "image.cmap": "gray", "path.sketch":
    (9.0, 9.0, 9.0), "pdf.compression": 9, "pdf.fonttype": 3, "pdf.use14corefonts": True,
}  # fmt: skip
LAYOUT = de.Layout([0.012, 0.014, 0.009], 0.0075)
SCENE = de.load_scene("sprint").replace(count=6)
CASE = EdgeCase("six", "six", LAYOUT, de.Physics())
RUNS = [accuracy.Measurement("six", accuracy.SIMULATE, e, e, e, 1e-3 / e) for e in (1e-6, 1e-4)]
RESULT = CaseResult("six", "six", "PROPAGATED", 1e-9, 1e-8, True, "tightest run", ())


@pytest.fixture(scope="module")
def results():
    """Return an experiment, a search, and a comparison with measurements."""
    experiment = compare([SCENE], methods=["uniform", "random"], seeds=range(2), budget=10)
    validation = measured.validate(shipped_sources()["school"], {})
    return experiment, search(SCENE, "random", budget=10), validation


def write_figure(value):
    return lambda path, *_: path.write_bytes(value.plot()._repr_png_())


WRITERS = {
    "layout": write_figure(LAYOUT),
    "wave": write_figure(de.simulate(LAYOUT)),
    "result": lambda path, _, result, __: write_figure(result)(path),
    "template": lambda path, *_: write_template(LAYOUT, path, physics=de.Physics()),
    "accuracy": lambda path, *_: accuracy.draw_accuracy([CASE], RUNS, path),
    "stability": lambda path, *_: accuracy.draw_stability([RESULT], path),
    "measured": lambda path, *results: measured_page.draw(results[-1:], path),
    "curves": lambda path, experiment, *_: pictures.draw_over_time(experiment, path),
    "intervals": lambda path, experiment, *_: pictures.draw_intervals(experiment, path, ["random"]),
    "chapman": lambda path, *_: chapman.draw("formula", path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_picture_does_not_depend_on_the_settings_of_matplotlib(name, tmp_path, results):
    WRITERS[name](tmp_path / "usual", *results)
    with mpl.rc_context(HOSTILE):
        mpl.use("agg")
        before = mpl.rcParams.copy()
        WRITERS[name](tmp_path / "hostile", *results)
        assert mpl.rcParams == before
    assert (tmp_path / "hostile").read_bytes() == (tmp_path / "usual").read_bytes()


def test_a_figure_in_axes_of_the_user_follows_the_user():
    with mpl.rc_context({"xtick.labelsize": 3.0}):
        figure = mpl.figure.Figure()
        assert LAYOUT.plot(figure.add_subplot()) is figure
        assert figure.axes[0].get_xticklabels()[0].get_size() == 3.0


def test_every_function_that_makes_a_figure_has_our_style():
    makers, found = r"\b(new_figure|new_axes|new_panels|PdfPages)\(", set()
    paths = (ROOT / part for part in ("domino_env", "optimize", "agents", "docs", "examples"))
    for path in (file for folder in paths for file in folder.rglob("*.py")):
        text = path.read_text("utf-8")
        if path.name == "plot_style.py" or not re.search(makers, text):
            continue
        for node in ast.walk(ast.parse(text)):
            source = ast.unparse(node) if isinstance(node, ast.FunctionDef) else ""
            if re.search(makers, source):
                assert "own_style()" in source, (path, node.name)
                found.add(node.name)
    assert {"write_template", "draw_curves", "draw_accuracy", "draw_record"} <= found
