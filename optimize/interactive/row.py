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
from optimize.interactive.draft import Draft

BEHIND, AHEAD = 0.8, 1.2  # [tallest domino] before the first pivot, and ahead of the last one
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
        Query of the page's address, which contains the draft.
    """

    state = param.Dict(default={})
    pace: Any = param.Selector(default=0.25, objects=PACES)
    sound = param.Boolean(default=True)
    address = param.String(default="")

    _esm: ClassVar[str] = (files("domino_env.view") / "assets/motion.js").read_text("utf-8") + Path(
        __file__
    ).with_name("row.js").read_text("utf-8")

    def show(self, draft: Draft, other: Any, name: str, *, moves: bool, keep_scale: bool) -> None:
        """Show a draft and the row that it races.

        Parameters
        ----------
        draft
            The draft.
        other
            Object with the `wave` of the other row; None for none.
        name
            Name of the other row.
        moves
            True to send the motions too.
        keep_scale
            True to keep the range of x, as during a drag; otherwise it is fitted to the rows.
        """
        waves = [row.wave for row in (draft, other) if row]
        pivots = np.concatenate([wave.layout.pivots for wave in waves])
        tallest = max(float(wave.layout.height.max()) for wave in waves)
        (_, bottom), (end, top) = pivots.min(axis=0).tolist(), pivots.max(axis=0).tolist()
        low, high = -BEHIND * tallest, end + AHEAD * tallest
        if keep_scale:
            low, high = (self.state["extent"][name] for name in ("low", "high"))
        self.state = {
            "rows": [_row_data(wave, moves) for wave in waves],
            "extent": {"low": low, "high": high, "bottom": bottom, "top": top + tallest},
            "designed": draft.scene.count,
            "stop": -1 if draft.stop is None else draft.stop,
            "other": name,
            "verdict": _verdict(draft.wave, other.wave, name) if other else "",
        }


@lru_cache(8)
def _row_data(wave: Wave, moves: bool) -> dict[str, Any]:
    """Return the data of a layout, with its motion if it moves; one of two rows seldom changes."""
    if moves:
        return motion_data(wave, Motion(wave.layout, wave.physics))
    return layout_data(wave.layout)


def _verdict(own: Wave, other: Wave, name: str) -> str:
    """Return the result of the race in words."""
    for wave, words in ((own, "yours stops"), (other, f"{name} stop")):
        if wave.hit < wave.layout.count:
            return words
    earlier = float(other.arrival_times[-1] - own.arrival_times[-1])
    longer = 1e3 * (own.layout.length - other.layout.length)
    words = f"{abs(earlier):.3f} s {'earlier' if earlier > 0.0 else 'later'} than {name}"
    if abs(earlier) < TIE:
        words = f"at the same time as {name}"
    if abs(longer) >= 1.0:
        words += f"; the row is {abs(longer):.0f} mm {'longer' if longer > 0.0 else 'shorter'}"
    return words
