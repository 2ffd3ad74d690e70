"""A layout beside a scene.toml, as in a run folder, is simulated with the physics of that scene."""

import json

import pytest

import domino_env as de
from domino_env.cli.main import main

GAPS = "spacing_mm,thickness_mm\n15,7.5\n16,7.5\n15,7.5\n15,7.5\n,7.5\n"  # has no width


@pytest.fixture
def mars(tmp_path):
    """A layout in the folder of a run on Mars, of dominoes 40 mm wide."""
    physics = de.Physics(gravity=3.71)
    scene = de.load_scene("sprint").replace(name="mars", physics=physics, count=5, width=0.04)
    folder = tmp_path / "mars"
    folder.mkdir()
    (folder / "scene.toml").write_text(scene.to_toml())
    (folder / "layout.csv").write_text(GAPS)
    return folder / "layout.csv"


def test_simulate_takes_the_scene_beside_the_layout_by_default(output_of, mars):
    def answer(*words):
        return json.loads(output_of("simulate", mars, "--json", *words))

    def speed(physics):
        return de.simulate(de.Layout.read(mars), physics).mean_speed

    there = answer()
    assert there["mean_speed"] == speed(de.Physics(gravity=3.71))
    assert there["scene"] == "mars"
    assert there["violations"] == []  # the width is the scene's, though the file lacks it
    assert there["physics_from"] == "of scene 'mars' beside the layout"
    pushed = answer("--push", 12)
    assert pushed["mean_speed"] == speed(de.Physics(gravity=3.71, push=12.0))
    assert pushed["physics_from"] == "of scene 'mars' beside the layout, but for --push"
    assert answer("--scene", "gentle")["mean_speed"] == speed(de.load_scene("gentle").physics)


@pytest.mark.parametrize("command", ["best-known gentle --layout", "evaluate ramp --layout"])
def test_an_exported_layout_keeps_its_scene_and_score(output_of, tmp_path, command):
    (tmp_path / "scene.toml").write_text(de.load_scene("ideal").to_toml())  # of another run
    file = tmp_path / "row.csv"
    exported = output_of(*command.split(), file)
    assert f"the scene to {tmp_path / 'row.scene.toml'}" in exported
    result = json.loads(output_of("simulate", file, "--json"))
    name = "gentle" if "gentle" in command else "sprint"
    assert result["violations"] == []
    layout = de.Layout.read(file)
    assert result["score"] == pytest.approx(de.load_scene(name).score(layout), rel=1e-7)
    assert result["physics_from"] == f"of scene '{name}' beside the layout"
    result = json.loads(output_of("simulate", file, "--json", "--scene", "ideal"))
    assert result["scene"] == "ideal"


@pytest.mark.parametrize("command", [
    "simulate", "verify --no-engine --floor 0.5", "click --wav OUT.wav", "report --html OUT.html",
    "render --gif OUT.gif --width 160 --rate 2 --slow 1",
])  # fmt: skip
def test_every_command_prints_the_physics_that_it_used(capsys, mars, command):
    name, *words = command.replace("OUT", str(mars.parent / "out")).split()
    main([name, str(mars), *words])
    expected = "physics: friction 0.25, gravity 3.71 m/s², push 8 rad/s (of scene 'mars' beside"
    assert expected in capsys.readouterr().out


def test_a_template_has_the_width_of_the_scene_beside_the_layout(mars, monkeypatch):
    drawn = []
    write = "domino_env.view.template.write_template"
    monkeypatch.setattr(write, lambda layout, *_: drawn.append(layout))
    assert main(["template", str(mars)]) == 0
    assert drawn[0].width == 0.04


def test_layouts_that_are_drawn_together_share_a_scene(capsys, error_of, mars, tmp_path):
    row = tmp_path / "row.csv"
    row.write_text(GAPS)
    both = [str(mars), str(row)]
    assert main(["report", *both, "--html", str(tmp_path / "race.html")]) == 0
    notice = "row.csv: no scene beside it: shown in scene 'mars' of the other layouts"
    assert capsys.readouterr().err.count(notice) == 1
    (tmp_path / "scene.toml").write_text(de.load_scene("gentle").to_toml())
    error = error_of("render", *both, "--gif", tmp_path / "race.gif")
    assert "different scenes ('mars' and 'gentle')" in error
