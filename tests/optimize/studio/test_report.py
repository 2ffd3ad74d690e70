"""The report: its numbers and sentences, and the page in a real browser where there is one."""

import json

import numpy as np
import pytest

import domino_env as de
from domino_env.view.compared import ComparedLayout, read_compared
from optimize.experiments.best_known import best_known
from optimize.studio.report import headline, write_report

PHYSICS = de.Physics(push=8.0)
RNG = np.random.default_rng(2)
COMPARED = [
    ComparedLayout("wild", de.simulate(de.Layout(RNG.uniform(0.004, 0.03, 19), 0.0075), PHYSICS)),
    ComparedLayout("even", de.simulate(de.Layout.uniform(20, pitch=0.024), PHYSICS)),
]
DEAD = ComparedLayout("dead", de.simulate(de.Layout([0.02, 0.07], 0.0075), PHYSICS))


def data_of(path):
    """Return the data on a page."""
    text = path.read_text("utf-8").split('id="data">')[1].split("</script>")[0]
    return json.loads(text), text


def run_folder(folder, name, layout=None, **files):
    """Return a run folder with a layout of a shipped scene, and files by their stems."""
    scene = de.load_scene(name)
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(scene.to_toml())
    (layout or scene.uniform().layout).to_csv(folder / "layout.csv")
    for stem, text in files.items():
        (folder / f"{stem}.csv").write_text(text)
    return folder


def test_headline_names_the_best_layout_in_any_order():
    fast, slow = sorted(COMPARED, key=lambda one: -one.wave.mean_speed)
    assert headline(COMPARED[::-1]) == headline(COMPARED)
    for compared in (COMPARED, [DEAD, *COMPARED]):
        assert headline(compared).startswith(f"{fast.name.capitalize()} is the fastest: ")
    assert f"faster than {slow.name}" in headline(COMPARED)
    assert headline([DEAD]).startswith("No layout topples to its end: dead: ")
    # the best score where scores are no speeds
    scene = de.load_scene("tempo")
    best, layout = best_known()["tempo"].layout, scene.uniform().layout
    compared = [
        ComparedLayout(name, scene.simulate(one), one, scene, scene.score(scene.simulate(one)))
        for name, one in (("equal", layout), ("best", best))
    ]
    assert headline(compared).startswith("Best has the best score: best: RMS error ")


def test_a_run_folder_has_scene_and_curve(tmp_path):
    scene = de.load_scene("sprint")
    trace = "evaluations,seconds,best_score\n1,0.25,0.5\n7,3.5,0.8\n"
    run = run_folder(tmp_path / "one", "sprint", trace=trace)
    compared = read_compared([run])
    assert [one.name for one in compared] == ["one", "uniform baseline"]
    de.Layout([0.02] * 5, 0.0075).to_csv(tmp_path / "short.csv")  # no layout of the scene
    assert [one.name for one in read_compared([tmp_path / "short.csv"], scene)] == ["short"]
    first, uniform = compared
    assert first.score == pytest.approx(uniform.score) == pytest.approx(scene.uniform().score)
    write_report(compared, tmp_path / "page.html")
    data, _ = data_of(tmp_path / "page.html")
    assert data["rows"][0]["search"] == [[0.25, 3.5], [0.5, 0.8]]
    assert data["headline"] == headline(compared)
    # under other physics the scene gives no score
    assert read_compared([run], physics=de.Physics(push=9.0))[0].score is None
    with pytest.raises(ValueError, match=r"without a layout\.csv"):
        read_compared([tmp_path])
    other = run_folder(tmp_path / "other", "ideal")
    with pytest.raises(ValueError, match="show layouts of one scene"):
        read_compared([run, other / "layout.csv"])


@pytest.mark.parametrize(("name", "shown"), [
    ("sprint", [[1.0, 10.0, 30.0], [-0.1, 0.5, 0.8]]),
    ("tempo", [[10.0, 30.0], pytest.approx([1.0, 0.25])]),  # RMS errors [ms]
])  # fmt: skip
def test_a_training_has_its_curve_and_a_shipped_layout_its_verification(tmp_path, name, shown):
    progress = "steps,score\n1,-0.1\n10,0.5\n30,0.8\n"
    run = run_folder(tmp_path / "run", name, best_known()[name].layout, progress=progress)
    write_report(read_compared([run]), tmp_path / "page.html")
    (row, _), first = (data_of(tmp_path / "page.html")[0][key] for key in ("rows", "first"))
    assert row["training"] == shown
    assert "AGREES" in row["verification"]["verdict"]
    assert first["layout"] == row["layout"]


def test_names_on_a_page_are_escaped(tmp_path):
    evil = "</script><!--<script>{{page}}{{title}}<img src=x onerror=alert(1)>"
    pages = []
    for name in (evil, "x"):
        write_report([ComparedLayout(name, COMPARED[0].wave)], tmp_path / "page.html")
        pages.append((tmp_path / "page.html").read_text("utf-8"))
        data, text = data_of(tmp_path / "page.html")
        assert data["rows"][0]["name"] == name
        assert "<" not in text
    for sign in ("<script", "</script", "<!--", "<img"):
        assert pages[0].count(sign) == pages[1].count(sign)


@pytest.fixture(scope="module")
def browser(chromium, tmp_path_factory):
    """The page of two runs, and of layouts that fit no scene."""
    folder = tmp_path_factory.mktemp("report")
    trace = "evaluations,seconds,best_score\n1,0.05,0.5\n7,30,0.8\n"
    best = best_known()["sprint"].layout
    runs = [
        run_folder(folder / "searched", "sprint", best, trace=trace),
        run_folder(folder / "trained", "sprint", progress="steps,score\n1,0.5\n30000,0.8\n"),
    ]
    write_report([*read_compared(runs), *COMPARED, DEAD], folder / "page.html")
    chromium.get_log("browser")
    chromium.get((folder / "page.html").as_uri())
    chromium.execute_async_script("const done = arguments[0]; domino.ready.then(() => done())")
    return chromium


def test_the_page_has_results_curves_and_verification(browser):
    text = browser.find_element("id", "runs").text
    assert "Searched is the fastest: " in text
    assert "AGREES" in text
    lines = browser.find_elements("css selector", "#runs tr")
    assert len(lines) == 7
    speed = de.load_scene("sprint").simulate(best_known()["sprint"].layout).mean_speed
    assert f"searched {speed:.5f} m/s" in lines[1].text
    assert "NaN" not in text
    assert f"{COMPARED[0].wave.mean_speed:.5f} m/s" in lines[4].text
    assert "never" in lines[6].text
    labels = [
        canvas.get_attribute("aria-label")
        for canvas in browser.find_elements("css selector", "#runs canvas")
    ]
    assert labels[4:] == [
        "Best row of the search: score [m/s], over time [s]",
        "Policy in training: score [m/s], over dominoes placed",
    ]
    assert browser.get_log("browser") == []


def test_rows_of_the_report_are_raced_and_opened(browser):
    browser.execute_script(
        "const e = document.getElementById('against'); e.value = 'wild';"
        "e.dispatchEvent(new Event('change'))"
    )
    assert browser.execute_script("return domino.state.row.state.other") == "wild"
    (line,) = (e for e in browser.find_elements("css selector", "#runs td a") if e.text == "even")
    browser.execute_script("arguments[0].click()", line)
    count = "domino.state.draft.layout.thickness.length"
    browser.execute_async_script(
        "const done = arguments[0], look = () => "
        f"({count} === 20 ? done() : setTimeout(look, 20)); look()"
    )


@pytest.mark.usefixtures("phone")
def test_the_report_fits_a_phone(browser):
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
    scrolled = "const t = document.querySelector('.wide'); t.scrollLeft = 1e6; return t.scrollLeft"
    assert browser.execute_script(scrolled) > 100
