"""Verification picture: how far the engine's arrival times are from the model's, along the row."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from domino_env.files import write_bytes
from domino_env.look.verification import AGREES, Verification

HINGED, FREE, PALE = "#0072b2", "#d55e00", "#969ea8"


def write_picture(checked: Verification, path: Path, title: str) -> None:
    """A PNG: differences in per cent of every arrival time, hinged at each step, limit, free."""
    figure = Figure(figsize=(8.0, 4.0), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    ours = checked.wave.arrival_times[1:]
    numbers = np.arange(1, checked.wave.layout.count)

    def share(times: np.ndarray) -> np.ndarray:
        both = np.isfinite(ours) & np.isfinite(times[1:])
        return np.where(both, times[1:] / np.where(both, ours, 1.0) - 1.0, np.nan) * 100.0

    axes.axhspan(-100.0 * AGREES, 100.0 * AGREES, color="#eef1f4", zorder=0)
    axes.axhline(0.0, color="#282c34", linewidth=0.8)
    for k, (step, times) in enumerate(zip(checked.steps, checked.hinged, strict=True)):
        # the finer, the bolder
        axes.plot(
            numbers, share(times), color=PALE, linewidth=0.8 + 0.6 * k,
            label=f"hinged, {step * 1e6:g} µs",
        )  # fmt: skip
    axes.plot(numbers, share(checked.limit), color=HINGED, label="hinged, extrapolated")
    axes.plot(numbers, share(checked.free_limit), color=FREE, linestyle="--", label="free")
    axes.set_xlabel("domino")
    axes.set_ylabel("arrival: engine over model [%]")
    title = title.replace("$", r"\$")  # two of them would begin a formula
    axes.set_title(f"{title}: {checked.verdict.split('.', 1)[0].split(':')[0].lower()}", loc="left")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, ncols=2, fontsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    write_bytes(path, lambda file: file.write(buffer.getvalue()))
