"""The JavaScript of the page, run by node."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

import domino_env as de

FOLDER = Path(__file__).parents[1] / "optimize" / "studio"
PRELUDE = """
import fs from "fs";
import * as kernel from "FOLDER/kernels.js";
import { Ground } from "FOLDER/ground.js";
import { Scene } from "FOLDER/scene.js";
import { search } from "FOLDER/search.js";
import { serve } from "FOLDER/worker.js";
const kernels = await kernel.loadKernels(fs.readFileSync("FOLDER/chain.wasm"));
const data = JSON.parse(fs.readFileSync(0, "utf8"));
const array = (x) => (Array.isArray(x) ? Float64Array.from(x) : x);
const layoutOf = (sizes) => Object.fromEntries(
  Object.entries(sizes).map(([name, x]) => [name, array(x)]));
const message = (action) => {
  try { action(); return ""; } catch (error) { return `${error.name}: ${error.message}`; }
};
const plain = (x) => (typeof x === "number" && !Number.isFinite(x) ? `@${x}` : x);
const encode = (_, x) => (ArrayBuffer.isView(x) ? Array.from(x, plain) : plain(x));
const answer = (value) => console.log(
  JSON.stringify(value, encode).replace(/"@(-?Infinity|NaN)"/g, "$1"));
""".replace("FOLDER", FOLDER.as_posix())


def run_javascript(script: str, data: object) -> Any:
    """Run a script that calls `answer` once, on `data`; skip the test without node."""
    if shutil.which("node") is None:
        pytest.skip("no node here")
    command = ["node", "--input-type=module", "-e", PRELUDE + script]
    process = subprocess.run(command, input=json.dumps(data), capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


def sizes(layout: de.Layout) -> dict[str, Any]:
    """Return a layout as `layoutOf` reads it."""
    names = ("spacing", "thickness", "height", "density")
    names += () if layout.is_flat else ("rise", "tilt")
    return {name: getattr(layout, name).tolist() for name in names} | {"width": layout.width}


def numbers(physics: de.Physics) -> dict[str, float]:
    """Return physics as JavaScript has them."""
    return {name: getattr(physics, name) for name in ("friction", "gravity", "push")}
