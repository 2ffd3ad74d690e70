"""Run the notebooks of examples/ and store what they print and draw: python docs/notebooks.py.

No time or version is stored, so a file changes only with results and the run times that it draws.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import os
import sys
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from domino_env.core.plot_style import own_style

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
WIDTH = 760  # [px] of a figure


@own_style()
def run(path: Path) -> tuple[dict[str, Any], dict[str, object]]:
    """Run a notebook in an empty folder; return it with its outputs, and its names."""
    plt.switch_backend("agg")
    plt.close("all")  # those of the calling process
    notebook, names = json.loads(path.read_text("utf-8")), dict[str, object]()
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    folder = Path.cwd()
    with TemporaryDirectory() as empty:
        os.chdir(empty)
        try:
            for number, cell in enumerate(code, 1):
                printed, value = io.StringIO(), None
                *statements, last = ast.parse("".join(cell["source"])).body
                with redirect_stdout(printed):
                    exec(compile(ast.Module(statements, []), path.name, "exec"), names)
                    if isinstance(last, ast.Expr):
                        value = eval(compile(ast.Expression(last.value), path.name, "eval"), names)
                    else:
                        exec(compile(ast.Module([last], []), path.name, "exec"), names)
                shown = dict.fromkeys([*map(plt.figure, plt.get_fignums()), value])
                figures = [figure for figure in shown if isinstance(figure, Figure)]
                outputs = _outputs(printed.getvalue(), figures)
                cell.update(execution_count=number, outputs=outputs)
                plt.close("all")
        finally:
            os.chdir(folder)
    return notebook, names


def _outputs(text: str, figures: list[Figure]) -> list[dict[str, Any]]:
    """Return a text and figures as outputs of a cell."""
    outputs: list[dict[str, Any]] = []
    if text:
        lines = text.splitlines(keepends=True)
        outputs.append({"name": "stdout", "output_type": "stream", "text": lines})
    for figure in figures:
        buffer = io.BytesIO()
        dpi = WIDTH / figure.get_size_inches()[0]
        figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
        image = base64.b64encode(buffer.getvalue()).decode()
        outputs.append({
            "data": {"image/png": image, "text/plain": ["a figure"]},
            "metadata": {}, "output_type": "display_data",
        })  # fmt: skip
    return outputs


if __name__ == "__main__":
    for path in [Path(name) for name in sys.argv[1:]] or sorted(EXAMPLES.glob("*.ipynb")):
        path.write_text(json.dumps(run(path)[0], indent=1, ensure_ascii=False) + "\n", "utf-8")
