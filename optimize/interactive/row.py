"""Row: a canvas on which dominoes are dragged, pushed and heard in the browser."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import param
from panel.custom import JSComponent

from domino_env.physics.motion import Motion
from domino_env.physics.wave import Wave
from domino_env.view.comparison import layout_data, motion_data
from optimize.interactive.design import Design

BEHIND, AHEAD = 0.6, 1.2  # [heights of a domino] before the first, and ahead of the last pivot
TIE = 5e-4  # [s] smaller differences are a tie
PACES = {"real time": 1.0, "4 × slower": 0.25, "10 × slower": 0.1}


class Row(JSComponent):  # type: ignore[misc]
    """Canvas of a row, and of the one that it races, see `row.js`.

    Attributes
    ----------
    state
        Data of both rows and texts, as `show` makes them.
    pace
        Time of the wave over time on the page.
    sound
        True for a click at every hit.
    address
        Query of the page's address, which contains the design.
    """

    state = param.Dict(default={})
    pace: Any = param.Selector(default=0.25, objects=PACES)
    sound = param.Boolean(default=True)
    address = param.String(default="")

    _esm: ClassVar[str] = (files("domino_env.view") / "assets/motion.js").read_text("utf-8") + Path(
        __file__
    ).with_name("row.js").read_text("utf-8")

    _limits = -1.0, 1.0  # [m] range of x that shows both rows

    def show(
        self, design: Design, rival: Wave | None, name: str, *, moves: bool
    ) -> tuple[float, float]:
        """Show a design and the row that it races, and return the range of x that shows both [m].

        Parameters
        ----------
        design
            The design.
        rival
            Wave of the other row; None for none.
        name
            Name of the other row.
        moves
            True to send the motions too, and to fit the range of x to the rows.
        """
        layouts, waves = [design.wave.layout], [design.wave]
        if rival:
            layouts, waves = [*layouts, rival.layout], [*waves, rival]
        tallest = max(float(layout.height.max()) for layout in layouts)
        z = np.concatenate([layout.pivots[:, 1] for layout in layouts])
        if moves:
            low = -max(float(layout.thickness[0]) for layout in layouts) - BEHIND * tallest
            high = max(
                float(layout.pivots[-1, 0] + AHEAD * layout.height[-1]) for layout in layouts
            )
            self._limits = low, high
            rows = [_motion_data(wave) for wave in waves]
        else:
            rows = [layout_data(layout) for layout in layouts]
        bottom, top = float(z.min()), float(z.max()) + tallest
        self.state = {
            "rows": rows,
            "extent": dict(
                zip(("low", "high", "bottom", "top"), (*self._limits, bottom, top), strict=True)
            ),
            "designed": design.scene.count,
            "stop": -1 if design.stop is None else design.stop,
            "rival": name,
            "verdict": _verdict(design.wave, rival, name) if rival else "",
        }
        return self._limits


@lru_cache(8)
def _motion_data(wave: Wave) -> dict[str, Any]:
    """Return the data of a motion, kept as one of the two rows seldom changes."""
    return motion_data(wave, Motion(wave.layout, wave.physics))


def _verdict(own: Wave, rival: Wave, name: str) -> str:
    """Return the result of the race in words."""
    if own.hit < own.layout.count or rival.hit < rival.layout.count:
        return "yours stops" if own.hit < own.layout.count else f"{name} stop"
    earlier = float(rival.arrival_times[-1] - own.arrival_times[-1])
    longer = 1e3 * (own.layout.length - rival.layout.length)
    words = f"{abs(earlier):.3f} s {'earlier' if earlier > 0.0 else 'later'} than {name}"
    if abs(earlier) < TIE:
        words = f"at the same time as {name}"
    if abs(longer) >= 1.0:
        words += f"; the row is {abs(longer):.0f} mm {'longer' if longer > 0.0 else 'shorter'}"
    return words
