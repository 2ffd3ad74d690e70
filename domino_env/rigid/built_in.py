"""The simulator of standing rows as a judge."""

from __future__ import annotations

from dataclasses import dataclass

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.rigid.judges import Fall
from domino_env.standing.simulation import simulate_standing

RTOL = 1e-3


@dataclass(frozen=True)
class Standing:
    """`simulate_standing`, which comes with this package and keeps no contact closed.

    Parameters
    ----------
    rtol
        Relative error asked of the arrival times.
    """

    rtol: float = RTOL

    @property
    def name(self) -> str:
        """What it is called."""
        return "simulate_standing"

    def fall(self, layout: Layout, physics: Physics, floor: float | None) -> Fall:
        """Topple a row on a floor of this friction, or hinged (None)."""
        seen = simulate_standing(layout, physics, floor_friction=floor, rtol=self.rtol)
        return Fall(
            floor=floor,
            arrivals=seen.arrival_times,
            toppled=seen.toppled,
            doubt=seen.error_estimate,
            converged=seen.converged,
            how=f"{seen.steps} steps",
        )
