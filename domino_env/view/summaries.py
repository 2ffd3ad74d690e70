"""Summaries of simulations in words: placement noise, and free-standing dominoes on a floor."""

from __future__ import annotations

import numpy as np

from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import RigidWave
from domino_env.scenes.placement import Placement, simulate_draws
from domino_env.scenes.scene import Scene

NOISE_DRAWS = 256  # draws of placement noise


def placement_noise(wave: Wave, scene: Scene | None, deviation: float) -> dict[str, float]:
    """Return the fraction of draws that complete and statistics of their total times [s].

    `deviation` is the standard deviation of the placement error of each gap [m].
    """
    ground = scene.ground if scene else None
    waves = simulate_draws(wave.layout, wave.physics, Placement(deviation, NOISE_DRAWS), ground)
    times = waves.total_time[waves.mean_speed > 0.0]
    noise = {"deviation": deviation, "draws": len(waves), "completes": len(times) / len(waves)}
    if len(times):
        fast, slow = np.quantile(times, (0.05, 0.95)).tolist()
        noise |= {"mean": float(times.mean()), "spread": float(times.std())}
        noise |= {"fastest_5_percent": fast, "slowest_5_percent": slow}
    return noise


def noise_summary(noise: dict[str, float]) -> str:
    """Return the result of `placement_noise` in one line."""
    line = (
        f"placement noise of {1e3 * noise['deviation']:g} mm, {noise['draws']} draws: "
        f"{100.0 * noise['completes']:.4g} % complete"
    )
    if "mean" in noise:
        line += (
            f", last domino hit after {noise['mean']:.4f} s, standard deviation "
            f"{noise['spread']:.4f} s, 5 % before {noise['fastest_5_percent']:.4f} s and 5 % after "
            f"{noise['slowest_5_percent']:.4f} s"
        )
    return line


def rigid_summary(rigid: RigidWave, wave: Wave) -> list[str]:
    """Return lines with speed and toppled dominoes of a free-standing layout.

    `wave` is the wave of the same layout with fixed pivots.
    """
    count = rigid.layout.count
    lines = ["", f"free-standing rigid bodies on a floor of friction {rigid.floor_friction:g}:"]
    if rigid.mean_speed > 0.0:
        comparison = ""
        if wave.mean_speed > 0.0:
            comparison = f", {rigid.mean_speed / wave.mean_speed - 1.0:+.2%} against the model"
        lines.append(
            f"mean speed {rigid.mean_speed:.5f} m/s{comparison}, last domino hit after "
            f"{rigid.arrival_times[-1]:.5f} s"
        )
    else:
        lines.append(f"the wave stops after {rigid.hit} of {count} dominoes were hit")
    lines.append(f"{rigid.toppled} of {count} toppled")
    suffix = "" if rigid.converged else f", more than the tolerance {rigid.rtol:g}"
    return [*lines, f"relative error of these times below {rigid.error_estimate:.1e}{suffix}"]
