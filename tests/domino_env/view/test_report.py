"""The report: its numbers in Python, its behaviour in a real browser where there is one."""

import dataclasses
import json

import numpy as np
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.view.comparison import ComparedLayout, comparison_data, headline
from domino_env.view.energy import energies
from domino_env.view.report import read_compared, write_report

PHYSICS = de.Physics(push=8.0)
RNG = np.random.default_rng(2)
COMPARED = [
    ComparedLayout("wild", de.simulate(de.Layout(RNG.uniform(0.004, 0.03, 19), 0.0075), PHYSICS)),
    ComparedLayout("even", de.simulate(de.Layout.uniform(20, pitch=0.024), PHYSICS)),
]


@pytest.mark.parametrize(("layout", "push"), [
    (de.Layout(np.random.default_rng(3).uniform(0.003, 0.03, 39), 0.008), 10.0),
    (uneven_layout(3, 12), 14.0),
], ids=["flat", "hills"])  # fmt: skip
def test_energies_balance_and_small_friction_takes_little_energy(layout, push):
    smooth, hardly, rough = (
        energies(de.Motion(layout, de.Physics(friction=mu, push=push))) for mu in (0.0, 1e-3, 0.25)
    )
    for one in (smooth, hardly, rough):
        spent = one.kinetic + one.hits + one.flushes + one.friction
        np.testing.assert_allclose(one.pushed + one.released, spent, rtol=1e-12)
    if not layout.rise.any():  # the first hit of equal dominoes takes half the energy
        at = int(np.argmax(smooth.hits > 0.0))
        assert smooth.hits[at] == pytest.approx(smooth.kinetic[at - 1] / 2.0, rel=1e-3)
    given = smooth.released[-1]
    assert smooth.flushes[-1] > 0.02 * given  # face impacts take energy from this wave
    # with friction, this loss comes from the recorded face impacts instead
    assert hardly.flushes[-1] == pytest.approx(smooth.flushes[-1], rel=0.02)
    assert hardly.hits[-1] == pytest.approx(smooth.hits[-1], rel=0.005)
    assert 0.0 < hardly.friction[-1] < 0.01 * given < rough.friction[-1]
    assert np.diff(rough.friction).min() > -1e-4 * given


def test_headline_names_the_best_layout_in_any_order():
    fast = max(COMPARED, key=lambda one: one.wave.mean_speed)
    assert headline(COMPARED[::-1]) == headline(COMPARED)
    dead = ComparedLayout("dead", de.simulate(de.Layout([0.02, 0.07], 0.0075), PHYSICS))
    for compared in (COMPARED, [dead, *COMPARED]):
        words = headline(compared)["winner"]
        assert words.startswith(f"{fast.name.capitalize()} is the fastest")
    assert headline([dead])["winner"] == "No layout topples to its end"
    # the best score where scores are no speeds
    (slow,) = (one for one in COMPARED if one is not fast)
    scored = [
        dataclasses.replace(one, score=score, score_text=text, quantity="RMS error [ms]")
        for one, score, text in ((fast, 0.2, "RMS error 4 ms"), (slow, 0.5, "RMS error 1 ms"))
    ]
    assert headline(scored)["winner"] == f"{slow.name.capitalize()} has the best score"
    assert comparison_data(scored)["best"] == 1


def test_a_run_folder_has_scene_and_curve(tmp_path):
    scene = de.load_scene("sprint")
    run = tmp_path / "one"
    run.mkdir()
    (run / "scene.toml").write_text(scene.to_toml())
    scene.uniform().layout.to_csv(run / "layout.csv")
    (run / "trace.csv").write_text("evaluations,seconds,best_score\n1,0.25,0.5\n7,3.5,0.8\n")
    compared, title = read_compared([run])
    assert title == scene.title
    assert [one.name for one in compared] == ["one", "uniform baseline"]
    de.Layout([0.02] * 5, 0.0075).to_csv(tmp_path / "short.csv")  # no layout of the scene
    assert [one.name for one in read_compared([tmp_path / "short.csv"], scene)[0]] == ["short"]
    first, uniform = compared
    assert first.score == pytest.approx(uniform.score) == pytest.approx(scene.uniform().score)
    assert first.trace == ([0.25, 3.5], [0.5, 0.8])
    # under other physics the scene gives no score
    assert read_compared([run], physics=de.Physics(push=9.0))[0][0].score is None
    with pytest.raises(ValueError, match=r"without a layout\.csv"):
        read_compared([tmp_path])
    other = tmp_path / "other"
    other.mkdir()
    (other / "scene.toml").write_text(de.load_scene("ideal").to_toml())
    scene.uniform().layout.to_csv(other / "layout.csv")
    with pytest.raises(ValueError, match="show layouts of one scene"):
        read_compared([run, other / "layout.csv"])


@pytest.mark.parametrize(("name", "shown"), [
    ("sprint", ([1.0, 10.0, 30.0], [-0.1, 0.5, 0.8])),
    ("tempo", ([10.0, 30.0], pytest.approx([1.0, 0.25]))),  # RMS errors [ms]
])  # fmt: skip
def test_a_training_has_its_curve_and_a_shipped_layout_its_verification(tmp_path, name, shown):
    from optimize.experiments.best_known import best_known

    best_known()[name].layout.to_csv(tmp_path / "layout.csv")
    (tmp_path / "progress.csv").write_text("steps,score\n1,-0.1\n10,0.5\n30,0.8\n")
    (entry, _), _ = read_compared([tmp_path], de.load_scene(name))
    assert entry.learning == shown
    assert "AGREES" in entry.verification["verdict"]


BROWSED = (
    dataclasses.replace(COMPARED[0], trace=([1.0, 9.0], [0.5, 0.6])),
    dataclasses.replace(COMPARED[1], learning=([0.0, 3e6], [0.5, 0.6])),
)


@pytest.fixture(scope="module")
def browser(chromium, tmp_path_factory):
    page = tmp_path_factory.mktemp("report") / "page.html"
    write_report(BROWSED, "test", page)
    for log in ("browser", "performance"):  # of pages of other tests
        chromium.get_log(log)
    chromium.get(page.as_uri())
    return chromium


def test_page_loads_without_messages_and_requests(browser):
    assert browser.get_log("browser") == []
    entries = browser.get_log("performance")
    events = [json.loads(entry["message"])["message"] for entry in entries]
    sent = (m["params"] for m in events if m["method"].endswith("WillBeSent"))
    requested = [parameters["request"]["url"] for parameters in sent]
    assert requested
    assert all(url.startswith(("file:", "data:")) for url in requested)
    assert len(browser.find_elements("css selector", ".uplot canvas")) == 6


def test_dominoes_stand_and_lean_on_the_page_as_in_the_model(browser, tmp_path):
    first = browser.current_url
    uneven = de.simulate(uneven_layout(3, 14), de.Physics(push=14.0))
    jammed = de.simulate(de.Layout([0.03, 0.03], 0.02), de.Physics(friction=2.0, push=14.0))
    compared = [*COMPARED, ComparedLayout("hills", uneven), ComparedLayout("jammed", jammed)]
    write_report(compared, "test", tmp_path / "page.html")
    browser.get((tmp_path / "page.html").as_uri())
    for k, one in enumerate(compared):
        motion = de.Motion(one.wave.layout, one.wave.physics)
        for t in np.linspace(0.0, motion.end, 23):
            page = browser.execute_script(f"return comparison.leans(comparison.compared[{k}], {t})")
            np.testing.assert_allclose(page, motion.angles([t])[0], atol=2e-3)
    assert browser.get_log("browser") == []
    browser.get(first)


def wait_for(browser, condition):
    """Wait until a condition holds, and return its value."""
    from selenium.webdriver.support.wait import WebDriverWait

    return WebDriverWait(browser, 60.0).until(lambda _: condition())


def test_page_reacts_to_buttons_slider_and_keyboard(browser):
    from selenium.webdriver.common.keys import Keys

    body = browser.find_element("css selector", "#comparison")
    browser.find_element("id", "play").click()
    playing = "return comparison.playing() && comparison.now() > 0"
    wait_for(browser, lambda: browser.execute_script(playing))
    browser.find_element("id", "play").click()
    stopped = browser.execute_script("return comparison.now()")
    browser.execute_script(
        "const s = document.getElementById('scrub'); s.value = 500; "
        "s.dispatchEvent(new Event('input'))"
    )
    half = browser.execute_script("return comparison.now() / comparison.end")
    assert half == pytest.approx(0.5)
    assert browser.execute_script("return comparison.now()") != stopped
    body.send_keys(Keys.HOME)
    assert browser.execute_script("return comparison.now()") == 0
    body.send_keys(Keys.END)
    assert browser.execute_script("return comparison.now() === comparison.end")


@pytest.mark.usefixtures("phone")
def test_page_fits_a_phone_and_follows_the_leader(browser):
    browser.execute_script("comparison.go(comparison.end)")
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
    scrolled = "const t = document.querySelector('.wide'); t.scrollLeft = 1e6; return t.scrollLeft"
    assert browser.execute_script(scrolled) > 100
    at_end = browser.execute_script("return comparison.view().shift")
    browser.execute_script("comparison.go(0)")
    assert browser.execute_script("return comparison.view().shift") == 0
    assert (at_end > 0) == browser.execute_script("return comparison.view().follows")


def test_numbers_can_be_read_as_tables(browser):
    browser.execute_script("document.getElementById('numbers').open = true")
    table = "#each table:first-child tbody tr"
    lines = wait_for(browser, lambda: browser.find_elements("css selector", table))
    wait_for(browser, lambda: lines[3].text)
    assert len(lines) == 20
    assert lines[3].text.split()[1] == f"{COMPARED[0].wave.layout.spacing[3] * 1e3:.2f}"
    for chart in browser.find_elements("css selector", "figure > div[role=img]"):
        assert ": from " in chart.get_attribute("aria-label")


def test_pointing_at_a_domino_shows_its_numbers(browser):
    from selenium.webdriver import ActionChains

    browser.execute_script("comparison.go(0)")
    canvas = browser.find_element("id", "comparison")
    ActionChains(browser).move_to_element_with_offset(canvas, 0, -30).perform()
    tip = browser.find_element("id", "tip").text
    assert tip.startswith("wild, domino")
    number = int(tip.split("domino ")[1].split()[0])
    gap = COMPARED[0].wave.layout.spacing[number] * 1e3
    assert f"gap in front {gap:.2f} mm" in tip
