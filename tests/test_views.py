"""Every view of a result, for every shipped scene and a random one of each combination of tables.

`make bounds` runs these tests, too, with machine code that checks its indices.
"""

import pickle
import re
import zlib
from itertools import combinations
from pathlib import Path

import numba
import numpy as np
import pytest
from env_scenes import short

import domino_env as de
from domino_env.cli.main import main
from domino_env.kernels.arrays import SNAPSHOT
from domino_env.kernels.diagnosis import trace_motion
from domino_env.physics.gradient import arrays_from
from domino_env.physics.motion import _contacts, _lean_stacks
from domino_env.physics.wave import checked_setting
from domino_env.view.energy import energies
from domino_env.view.sound import clicks

PARTS = "stock", "ground", "limits", "placement", "run_out", "growth", "tempo"
COMMANDS = {"simulate": (), "click": (), "report": ()}
# for shipped scenes only, as each takes some 0.2 s, and 0.6 s for a template
SLOW_COMMANDS = {
    "verify": ("--no-engine", "--floor", 1),
    "render": ("--png", "row.png", "--gif", "row.gif", "--width", 200, "--slow", 0.2),
}
PRINTED = "hills", "magnify", "relay", "sprint-thickness", "stock"  # all that a template shows


def random_scene(parts, rng):
    """Return a random scene with some parts; raise a ValueError if they exclude each other."""
    count, height = int(rng.integers(4, 8)), float(rng.uniform(0.03, 0.06))
    in_heights = bool("growth" in parts or (rng.random() < 0.2 and "stock" not in parts))
    unit, ratios = 1.0 if in_heights else height, (0.12, 0.2)
    thickness = [ratio * height for ratio in ratios]
    fields = {
        "count": count, "height": height, "in_heights": in_heights, "first_thickness": thickness[0],
        "spacing": (0.1 * unit, float(rng.uniform(0.4, 0.6)) * unit),
        "thickness": tuple(ratio * unit for ratio in ratios),
        "physics": de.Physics(float(rng.uniform(0.0, 0.3)), push=float(rng.uniform(8.0, 14.0))),
    }  # fmt: skip
    if "stock" in parts:
        has_hand = rng.random() < 0.5
        fields["stock"] = de.Stock(thickness, (count - 2, 2), hand=2 if has_hand else None)
        fields["thickness"] = None
    uneven = not parts & {"run_out", "growth"}
    profile = [[0.0, 0.0], [0.2, 0.002], [0.4, 0.0], [0.6, 0.001]]
    options = {
        "ground": {"ground": de.Ground(profile=profile) if uneven else de.Ground(slope=2.0)},
        "limits": {"limits": de.Limits(0.01)},
        "placement": {"placement": de.Placement(0.0005, draws=4)},
        "run_out": {"run_out": de.RunOut(int(rng.integers(1, 9)), 0.3 * height)},
        "growth": {"growth": (1.0, 1.1)},
        "tempo": {"objective": "tempo", "settings": de.Tempo(20.0, 30.0)},
    }
    for part in parts & options.keys():
        fields |= options[part]
    return de.Scene(name="-".join(sorted(parts)) or "plain", **fields)


def random_scenes():
    """Return a random scene of each pair of parts, and of each largest combination.

    The others exclude each other, or are part of a larger combination.
    """
    scenes = {}
    for number in range(len(PARTS), -1, -1):
        for parts in combinations(PARTS, number):
            if number != 2 and any({*parts} < {*larger} for larger in scenes):
                continue
            rng = np.random.default_rng(zlib.crc32(repr(parts).encode()))
            try:
                scenes[parts] = random_scene(set(parts), rng)
            except ValueError as error:
                if not re.search("exclude|in metres", str(error)):
                    raise
    return {"+".join(["random", *parts]): scene for parts, scene in scenes.items()}


def shortened(name):
    """Return a shipped scene with six dominoes, and four of a run-out."""
    scene = short(name, 6)
    return scene if scene.run_out is None else scene.replace(run_out=de.RunOut(4, 0.003))


SCENES = {name: shortened(name) for name in de.scene_names()} | random_scenes()


def see_steps(kind, scene, rng):
    """Play an episode and show it after each step; return the last wave."""
    env = kind(scene, render_mode="rgb_array")
    env.reset(seed=1)
    over, info = False, {}
    while not over:
        assert env.render().shape[2] == 3
        # small actions, as larger ones stop many waves
        action = rng.uniform(-0.3, 0.3, env.action_space.shape)
        over, info = env.step(action)[2::2]
    assert env.render().any()
    snapshot = env.snapshot()
    assert snapshot.layout == info["wave"].layout == scene.row(info["layout"])
    assert snapshot.hit <= snapshot.layout.count
    assert pickle.loads(pickle.dumps(info)) == info
    return info["wave"]


@pytest.mark.parametrize("name", SCENES)
def test_every_view_shows_the_results_of_a_scene(name, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("domino_env.envs.rendering.WIDTH", 300)  # smoothing takes most of the time
    scene, rng = SCENES[name], np.random.default_rng(3)
    waves = [scene.uniform().wave]
    # an error of a gap on uneven ground could make dominoes lean against each other
    has_environment = not scene.placement or scene.ground is None or scene.ground.is_even
    for kind in (de.DominoChain, de.DominoLayout) if has_environment else ():
        waves.append(see_steps(kind, scene, rng))
    for wave in waves:
        motion = de.Motion(wave.layout, wave.physics)
        assert np.isfinite(motion.angles(np.linspace(0.0, motion.end, 20))).all()
        assert np.isfinite(energies(motion).kinetic).all()
        assert de.diagnose(wave.layout, wave.physics).outcome == wave.outcome
        assert wave.hit < 2 or len(clicks(wave))
    monkeypatch.chdir(tmp_path)
    designed = [getattr(waves[-1].layout, part) for part in ("spacing", "thickness", "height")]
    count = scene.count
    layout = scene.layout(designed[0][: count - 1], designed[1][1:count], designed[2][1:count])
    layout.to_csv("row.csv")
    Path("row.scene.toml").write_text(scene.to_toml(), "utf-8")
    commands, endings = dict(COMMANDS), {".wav", ".html"}
    if name in de.scene_names():
        commands |= SLOW_COMMANDS
        endings |= {".png", ".gif"}
    if name in PRINTED:
        commands["template"] = ()
        endings.add(".pdf")
    for command, options in commands.items():
        assert main([command, "row.csv", *map(str, options)]) == 0, capsys.readouterr()
    assert {file.suffix for file in tmp_path.iterdir()} >= endings


@pytest.mark.skipif(not numba.config.BOUNDSCHECK, reason="`make bounds` checks indices")
def test_machine_code_checks_its_indices():
    layout = de.Layout.uniform(10, pitch=0.02)
    leans, setting = np.zeros((1, 10)), checked_setting(de.Physics(), 1e-8)
    with pytest.raises(IndexError):
        _lean_stacks(_contacts(layout), np.array([12]), np.zeros(1), leans)
    with pytest.raises(IndexError):
        trace_motion(arrays_from(layout), setting, np.zeros((5, 33), SNAPSHOT))
