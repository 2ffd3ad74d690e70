"""The search in JavaScript: its results, its end, and the worker of the page."""

import pytest
from page_modules import FOLDER, run_javascript, sizes

import domino_env as de
from optimize import search
from optimize.experiments.best_known import best_known

SHORT = [
    {"count": 6, "length": 0.12, "thickness": (0.004, 0.012)}, {"count": 2, "length": None},
    {"count": 7, "length": None, "spacing": (0.018, 0.018), "thickness": (0.004, 0.012)},
    {"count": 5, "length": None, "physics": de.Physics(push=0.5)},
]  # fmt: skip


def test_searches_of_short_rows_end_by_themselves_with_the_optimum():
    """With a length that the layout keeps, one gap, free thickness alone, and waves that stop."""
    scenes = [de.load_scene("course").replace(**changes) for changes in SHORT]
    answers = run_javascript(
        """const results = [];
        for (const document of data) {
          const scene = new Scene(kernels, document);
          const result = await search(scene, { seconds: 1e6, seed: 1 });
          results.push({ ...result, violations: scene.violations(result.layout) });
        }
        answer(results);""",
        [scene.document() for scene in scenes],
    )
    for scene, answer in zip(scenes, answers, strict=True):
        known = search(scene, method="auto", budget=600, seed=0).score
        assert "independent searches agree" in answer["reason"]
        assert answer["violations"] == []
        assert answer["score"] >= known - 2e-4 * abs(known)


@pytest.mark.parametrize(("name", "shortfall"), [("sprint", 2e-4), ("gentle", 2e-4)])
def test_the_search_comes_near_the_best_known_score(name, shortfall):
    """It is stopped when it has: every better layout is reported."""
    scene, target = de.load_scene(name), best_known()[name].score * (1.0 - shortfall)
    answer = run_javascript(
        """let best = -1;
        const scene = new Scene(kernels, data.document), rising = [];
        const onBetter = ({ layout, score }) => { rising.push(score - best); best = score; };
        const shouldStop = () => best > data.target;
        const result = await search(scene, { seconds: 300, onBetter, shouldStop });
        answer({ ...result, rising, again: scene.score(result.layout).score });""",
        {"document": scene.document(), "target": target},
    )
    assert answer["reason"] == "stopped"
    assert answer["score"] == answer["again"] > target
    assert min(answer["rising"]) > -1e-6  # tolerance of the arrival times in the search


def test_a_search_that_ends_before_its_first_score_has_the_best_equal_gaps():
    """A long row begins with the search of a short one."""
    scene = de.load_scene("sprint").replace(count=520)
    answer = run_javascript(
        """const scene = new Scene(kernels, data), { score } = scene.uniform();
        answer({ expected: score, ...await search(scene, { seconds: 0 }) });""",
        scene.document(),
    )
    assert answer["score"] == answer["expected"] > 0.0
    assert "stopped after 0 s" in answer["reason"]


def test_the_search_begins_with_a_given_layout():
    scene = de.load_scene("sprint")
    answer = run_javascript(
        """const scene = new Scene(kernels, data.document), start = layoutOf(data.start);
        answer(await search(scene, { seconds: 300, start, shouldStop: () => true }));""",
        {"document": scene.document(), "start": sizes(best_known()["sprint"].layout)},
    )
    assert answer["score"] == pytest.approx(best_known()["sprint"].score, rel=1e-6)


def test_the_worker_answers_messages_while_it_searches():
    """A search is stopped and keeps its best layout; errors are sentences."""
    sprint, stock = (de.load_scene(name).document() for name in ("sprint", "stock"))
    answers = run_javascript(
        """const { port1, port2 } = new MessageChannel(), answers = [];
        serve(port2);
        port1.on("message", (message) => {
          answers.push(message);
          if (message.type === "better") port1.postMessage({ type: "stop" });
          const types = answers.map(({ type }) => type);
          if (types.includes("error") && types.includes("done")) {
            answer(answers);
            port1.close();
          }
        });
        port1.postMessage({ type: "load", bytes: fs.readFileSync(data.module) });
        port1.postMessage({ id: 1, type: "uniform", document: data.sprint });
        port1.postMessage({ id: 2, type: "search", document: data.sprint, seconds: 300, seed: 0 });
        port1.postMessage({ id: 3, type: "search", document: data.stock });""",
        {"module": (FOLDER / "chain.wasm").as_posix(), "sprint": sprint, "stock": stock},
    )
    by_type = {answer["type"]: answer for answer in answers}
    assert by_type["uniform"]["score"] == pytest.approx(0.802996849, rel=1e-6)
    assert by_type["done"]["id"] == 2
    assert by_type["done"]["reason"] == "stopped"
    assert by_type["error"]["id"] == 3
    assert "domino optimize stock" in by_type["error"]["message"]
