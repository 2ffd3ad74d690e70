"""Simulate one layout and print arrival times, speed and outcome.

LAYOUT is a .csv file with a header and one line per domino (spacing_mm and thickness_mm, or spacing
and thickness in metres; height and density if they differ), or a .json file.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from domino_env.cli import options

if TYPE_CHECKING:
    from domino_env.physics.layout import Layout
    from domino_env.physics.wave import Wave
    from domino_env.rigid.simulation import RigidWave
    from domino_env.scenes.scene import Scene

# fields of `Wave` and `RigidWave` in the JSON document
WAVE_FIELDS = (
    "outcome explanation mean_speed hit toppled reach error_estimate converged flushes releases "
    "largest_flush_loss"
)
DOMINO_FIELDS = "arrival_times release_velocity impact_velocity stall_margin"
RIGID_FIELDS = (
    "floor_friction mean_speed hit toppled error_estimate converged arrival_times slid opened "
    "opened_at"
)
MAX_LINES = 60  # largest number of lines of a table that is printed whole
ENDS = 10  # lines of a longer table that are printed at each of its ends


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino simulate`."""
    options.add_layout(parser)
    options.add_physics_options(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON in SI units")
    tolerance = "relative tolerance of the arrival times"
    standing = "also simulate free-standing dominoes on a floor of this friction ('free' is 1)"
    noise = "also simulate 256 draws of placement noise with this standard deviation [mm]"
    options.add_options(
        parser,
        # bounds as of `domino_env.simulate`
        ("rtol", options.number(low=1e-13, high=1e-3), "RTOL", 1e-8, tolerance),
        ("floor", options.floor, "FRICTION", None, standing),
        ("deviation", options.DEVIATION, "MM", None, noise),
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate the layout and print the results."""
    from domino_env.core.results import document
    from domino_env.physics.wave import simulate
    from domino_env.rigid.simulation import simulate_standing
    from domino_env.scenes.placement import placement_noise

    chosen = options.chosen_physics(arguments, arguments.layout)
    scene = chosen.scene
    layout = chosen.read(arguments.layout)
    if arguments.deviation is not None:
        options.require_deviation(arguments.deviation, 1e3 * layout.spacing.max(initial=0.0))
    wave = simulate(chosen.row(layout), chosen.physics, rtol=arguments.rtol)
    evaluation = _evaluation(layout, wave, scene) if scene else {}
    rigid = noise = None
    if arguments.floor is not None:
        rigid = simulate_standing(wave.layout, wave.physics, arguments.floor, progress=None)
    if arguments.deviation is not None:
        ground = scene.ground if scene else None
        run_out = wave.layout.count - layout.count
        noise = placement_noise(wave, ground, 1e-3 * arguments.deviation, run_out)
    if arguments.json:
        result = document(wave, WAVE_FIELDS) | document(wave.physics, "friction gravity push")
        result |= document(wave.layout, "positions") | document(wave, DOMINO_FIELDS)
        result |= {"physics_from": chosen.origin} | evaluation
        if rigid:
            result["free_standing"] = document(rigid, RIGID_FIELDS)
        if noise:
            result["placement_noise"] = noise
        options.print_json(result)
        return 0
    lines = [*_table(wave), *_summary(wave), chosen.line]
    lines += _evaluation_lines(evaluation, scene) if scene else []
    lines += _rigid_summary(rigid, wave) if rigid else []
    lines += [_noise_summary(noise)] if noise else []
    print("\n".join(lines))
    return 0


def _table(wave: Wave) -> list[str]:
    """Return one line for each domino that is hit, of a long layout only the first and last."""
    from domino_env.core.tables import text_table

    layout = wave.layout
    columns = {
        "domino": [str(i) for i in range(wave.hit)],
        "gap in front [mm]": [*(f"{1e3 * gap:.3f}" for gap in layout.spacing), ""],
        "thickness [mm]": [f"{1e3 * thickness:.3f}" for thickness in layout.thickness],
        "arrival [s]": [f"{t:.6f}" for t in wave.arrival_times],
        "wave speed [m/s]": ["", *(f"{speed:.4f}" for speed in wave.local_speed)],
        "hit with [rad/s]": [
            f"push {wave.physics.push:g}", *(f"{v:.3f}" for v in wave.impact_velocity)
        ],
    }  # fmt: skip
    lines = text_table([*columns], zip(*columns.values(), strict=False), right=columns)
    if wave.hit > MAX_LINES:
        lines[1 + ENDS : -ENDS] = [f"   ...  {wave.hit - 2 * ENDS:,} lines left out: see --json"]
    return lines


def _summary(wave: Wave) -> list[str]:
    """Return lines with outcome, speed, events and error of a wave."""
    lines = ["", f"{wave.outcome.name}: {wave.explanation}"]
    if wave.mean_speed > 0.0:
        lines.append(
            f"mean speed {wave.mean_speed:.6f} m/s over {wave.layout.length:.4f} m, "
            f"last domino hit after {wave.arrival_times[-1]:.6f} s"
        )
    loss = f" (largest loss of speed {wave.largest_flush_loss:.2%})"
    facts = [f"face impacts: {wave.flushes}{loss}"] * bool(wave.flushes)
    facts += [f"separations: {wave.releases}"] * bool(wave.releases)
    if wave.error_estimate > 0.0:  # 0 if the first domino hits no other
        facts.append(f"relative error of the times below {wave.error_estimate:.1e}")
    lines += ["; ".join(facts)] * bool(facts)
    if not wave.converged:
        lines.append(
            f"the wave is so close to a stall that rounding prevents the tolerance {wave.rtol:g}; "
            "the error estimate is valid"
        )
    return lines


def _evaluation(layout: Layout, wave: Wave, scene: Scene) -> dict[str, Any]:
    """Return the violated rules of a scene, or else the scores of wave and uniform baseline."""
    violations = scene.violations(layout)
    result: dict[str, Any] = {"scene": scene.name, "violations": violations}
    if not violations and wave.physics == scene.physics:
        score, uniform = scene.score(wave), scene.uniform().score
        result |= {"score": score, "uniform_score": uniform}
        if (gain := scene.gain(score, uniform)) is not None:
            result["gain"] = gain
    return result


def _evaluation_lines(result: dict[str, Any], scene: Scene) -> list[str]:
    """Return the result of `_evaluation` in lines of text."""
    name, criterion = scene.name, scene.criterion
    if result["violations"]:
        return [f"not a layout of scene '{name}': {sentence}" for sentence in result["violations"]]
    if "score" not in result:
        return [f"no score on '{name}': these are not the friction, gravity and push of the scene"]
    score, uniform = result["score"], result["uniform_score"]
    comparison = criterion.compare(score, uniform, "the uniform baseline", detailed=True)
    if not comparison:
        reference = f"the uniform baseline ({uniform:.6f})"
        comparison = f"no gain over {reference}: a score of 0 or less is no success"
    return [f"{criterion.label(score)} on '{name}', {comparison}"]


def _noise_summary(noise: dict[str, float]) -> str:
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


def _rigid_summary(rigid: RigidWave, wave: Wave) -> list[str]:
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
