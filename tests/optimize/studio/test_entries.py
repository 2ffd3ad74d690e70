"""Python and the page write the same links and strips, and commands read the links."""

import json

import numpy as np
import pytest
from page_modules import FOLDER, run_javascript, sizes

import domino_env as de
from domino_env.scenes.io.link import make_link, read_link
from domino_env.view.slots import safety_gaps, strip_svg
from optimize.experiments.best_known import best_known

UNEVEN = de.Layout(np.random.default_rng(4).uniform(0.004, 0.03, 49), np.linspace(0.005, 0.009, 50))


def javascript(module: str, call: str, data: object) -> object:
    """Return what `answer` is called with after an import of all names of a module."""
    return run_javascript(f'const page = await import("{FOLDER}/{module}");\n{call}', data)


@pytest.mark.parametrize("name", ["sprint", "hills", "magnify", "stock"])
def test_links_of_page_and_python_are_the_same(name: str) -> None:
    scene, layout = de.load_scene(name), best_known()[name].layout
    link = make_link(scene, layout)
    data = {"document": scene.document(), "layout": sizes(layout), "link": link}
    call = (
        "const { document, layout } = await page.readLink(data.link);"
        "answer([document, layout, await page.makeLink(data.document, layoutOf(data.layout))])"
    )
    document, read, written = javascript("files.js", call, data)  # type: ignore[misc]
    assert de.Scene.from_document(document) == scene
    assert de.Layout(**read) == layout
    assert read_link(f"https://a.example/studio.html#{written}") == (scene, layout)


def test_commands_read_links_and_name_damaged_ones(tmp_path, monkeypatch, output_of, error_of):
    monkeypatch.chdir(tmp_path)
    scene, layout = de.load_scene("sprint"), best_known()["sprint"].layout
    link = f"file:///a/studio.html#{make_link(scene, layout)}"
    printed = json.loads(output_of("simulate", link, "--json"))
    assert printed["mean_speed"] == pytest.approx(scene.simulate(layout).mean_speed, rel=1e-9)
    assert "of scene 'sprint'" in printed["physics_from"]
    assert "SVG" not in output_of("template", link, "--format", "svg")
    assert (tmp_path / "link.svg").read_text("utf-8") == strip_svg(scene.row(layout))
    for command in ("simulate", "template", "verify", "render"):
        more = ["--png", tmp_path / "a.png"] if command == "render" else []
        assert "the row in the link: it was cut" in error_of(command, link[:-40], *more)


@pytest.mark.parametrize("options", [{}, {"tolerance": 0.5, "piece": 120.0, "safety": 200.0}])
@pytest.mark.parametrize("layout", [UNEVEN, best_known()["hills"].layout], ids=["sizes", "hills"])
def test_strips_of_page_and_python_are_the_same(
    layout: de.Layout, options: dict[str, float]
) -> None:
    call = "answer(page.stripSvg(layoutOf(data[0]), data[1]))"
    svg = strip_svg(layout, **options)
    assert javascript("print.js", call, [sizes(layout), options]) == svg
    assert svg.count('class="slot"') == layout.count


def test_safety_gaps_are_three_dominoes_at_intervals():
    late = sorted(safety_gaps(UNEVEN, 200.0))
    assert len(late) >= 9
    front = 1e3 * UNEVEN.positions
    for first, following in zip(late[::3], late[3::3], strict=False):
        assert {first + 1, first + 2} <= set(late)
        assert (
            front[following - 1] - front[first + 3] < 200.0 <= front[following] - front[first + 3]
        )
    assert not safety_gaps(UNEVEN, 0.0)


@pytest.mark.parametrize(("options", "words"), [
    ({"tolerance": 9.0}, r"gap \d+ is .* mm wide: .*give a smaller tolerance or a wider gap"),
    ({"piece": 12.0}, "pieces of 12 mm: give at least"),
    ({"tolerance": -1.0}, "tolerance"),
    ({"safety": float("nan")}, "safety"),
])  # fmt: skip
def test_impossible_strips_are_rejected(options, words):
    with pytest.raises(ValueError, match=words):
        strip_svg(UNEVEN, **options)
