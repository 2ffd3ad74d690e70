"""The report: its numbers in Python, its behaviour in a real browser where there is one."""

import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.look.race_data import Racer, energies, headline, race_data
from domino_env.look.report import read_racers, write_report
from domino_env.motion import Motion

PHYSICS = de.Physics(push=8.0)
RNG = np.random.default_rng(2)
ROWS = [
    Racer("wild", de.simulate(de.Layout(RNG.uniform(0.004, 0.03, 19), 0.0075), PHYSICS)),
    Racer("even", de.simulate(de.Layout.uniform(20, pitch=0.024), PHYSICS)),
]


def test_energy_is_kept_without_friction_but_for_hits() -> None:
    wave = de.simulate(de.Layout.uniform(12, pitch=0.024), de.Physics(friction=0.0, push=8.0))
    energy = energies(Motion(wave.layout, wave.physics), wave)
    rubbed, given = np.array(energy["rubbed"]), max(energy["released"])
    assert np.abs(rubbed).max() < 1e-4 * given
    assert np.all(np.diff(energy["hits"]) >= 0.0)


def test_first_hit_of_equal_dominoes_takes_half() -> None:
    wave = de.simulate(de.Layout.uniform(3, pitch=0.024), de.Physics(friction=0.0, push=8.0))
    energy = energies(Motion(wave.layout, wave.physics), wave)
    lost = np.array(energy["hits"])
    at = int(np.argmax(lost > 0.0))
    assert lost[at] == pytest.approx(energy["kinetic"][at - 1] / 2.0, rel=1e-3)


def test_headline_names_the_faster_row_in_any_order() -> None:
    fast = max(ROWS, key=lambda one: one.wave.mean_speed)
    assert headline(ROWS)["who"].startswith(f"{fast.name} wins")
    assert headline(ROWS[::-1]) == headline(ROWS)
    dead = Racer("dead", de.simulate(de.Layout([0.02, 0.07], 0.0075), PHYSICS))
    assert headline([dead, *ROWS])["who"].startswith(f"{fast.name} wins")
    assert headline([dead])["who"] == "No row topples to its end"


def test_page_of_a_hundred_dominoes_is_small(tmp_path: Path) -> None:
    layout = de.Layout(np.random.default_rng(0).uniform(0.01, 0.02, 99), 0.0075)
    rows = [Racer(str(k), de.simulate(layout, PHYSICS)) for k in range(3)]
    assert write_report(rows, "</script><b>&", tmp_path / "page.html") < 2_000_000
    text = (tmp_path / "page.html").read_text("utf-8")
    assert "<title>&lt;/script&gt;" in text
    assert "src=" not in text.replace("{{", "")


def test_row_that_dies_and_names_that_break_scripts(tmp_path: Path) -> None:
    dead = Racer("</script>", de.simulate(de.Layout([0.02, 0.07], 0.0075), PHYSICS))
    write_report([dead], "t", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text("utf-8")
    inside = text.split('id="data">')[1].split("</script>")[0]
    assert json.loads(inside)["rows"][0]["arrivals"][-1] is None


def test_run_folder_brings_scene_curve_and_check(tmp_path: Path) -> None:
    scene = de.load_scene("sprint")
    run = tmp_path / "one"
    run.mkdir()
    (run / "scene.toml").write_text(scene.to_toml())
    scene.uniform().layout.to_csv(run / "layout.csv")
    (run / "trace.csv").write_text("evaluations,best_score\n1,0.5\n7,0.8\n")
    (run / "verification.json").write_text('{"engine": "pymunk", "verdict": "AGREES"}')
    racers, title = read_racers([run])
    assert title == "sprint"
    assert [one.name for one in racers] == ["one", "best uniform pitch"]
    assert racers[0].trace == ([1.0, 7.0], [0.5, 0.8])
    assert racers[0].verification is not None
    with pytest.raises(ValueError, match=r"no layout\.csv"):
        read_racers([tmp_path])
    with pytest.raises(ValueError, match="race one scene"):
        read_racers([run], de.load_scene("ideal"))
    with pytest.raises(ValueError, match="nothing to race"):
        race_data([])


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[object]:
    webdriver = pytest.importorskip("selenium.webdriver")
    binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("no Chromium here")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in ("headless=new", "no-sandbox", "disable-gpu", "window-size=1100,900"):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    page = tmp_path_factory.mktemp("report") / "page.html"
    write_report(ROWS, "test", page)
    window.get(page.as_uri())
    yield window
    window.quit()


def test_page_loads_in_silence_and_asks_nobody(browser) -> None:
    assert browser.get_log("browser") == []
    told = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [m["params"]["request"]["url"] for m in told if m["method"].endswith("WillBeSent")]
    assert asked
    assert all(url.startswith(("file:", "data:")) for url in asked)
    assert len(browser.find_elements("css selector", ".uplot canvas")) == 4


def test_dominoes_lean_on_the_page_as_in_the_model(browser) -> None:
    for k, one in enumerate(ROWS):
        motion = Motion(one.wave.layout, one.wave.physics)
        for t in np.linspace(0.0, motion.end, 23):
            page = browser.execute_script(f"return race.leans(race.rows[{k}], {float(t)!r})")
            np.testing.assert_allclose(page, motion.angles([t])[0], atol=2e-3)


def test_page_plays_scrubs_and_obeys_the_keyboard(browser) -> None:
    from selenium.webdriver.common.keys import Keys

    body = browser.find_element("css selector", "#race")
    browser.find_element("id", "play").click()
    time.sleep(0.3)
    assert browser.execute_script("return race.playing() && race.now() > 0")
    browser.find_element("id", "play").click()
    stopped = browser.execute_script("return race.now()")
    browser.execute_script(
        "const s = document.getElementById('scrub'); s.value = 500; "
        "s.dispatchEvent(new Event('input'))"
    )
    half = browser.execute_script("return race.now() / race.end")
    assert half == pytest.approx(0.5)
    assert browser.execute_script("return race.now()") != stopped
    body.send_keys(Keys.HOME)
    assert browser.execute_script("return race.now()") == 0
    body.send_keys(Keys.END)
    assert browser.execute_script("return race.now() === race.end")
    assert "★ fastest" not in browser.find_element("id", "who").text


def test_pointing_at_a_domino_tells_its_numbers(browser) -> None:
    from selenium.webdriver import ActionChains

    browser.execute_script("race.go(0)")
    canvas = browser.find_element("id", "race")
    ActionChains(browser).move_to_element_with_offset(canvas, 0, -30).perform()
    tip = browser.find_element("id", "tip").text
    assert tip.startswith("wild, domino")
    number = int(tip.split("domino ")[1].split()[0])
    gap = ROWS[0].wave.layout.spacing[number] * 1e3
    assert f"gap in front {gap:.2f} mm" in tip
