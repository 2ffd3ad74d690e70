"""Scenes in JavaScript against those in Python: scores, gradients, rules, best equal gaps."""

import copy
from typing import Any

import numpy as np
import pytest
from golden_layouts import scene_layout
from page_modules import run_javascript, sizes

import domino_env as de
from domino_env.scenes.pool import load_test_set
from optimize.experiments.best_known import best_known

SEARCHED = (
    "course", "downhill", "gentle", "hills", "ideal", "relay", "sprint", "sprint-thickness",
    "tempo", "uphill",
)  # fmt: skip
NAMES = (*SEARCHED, "marathon", "magnify", "stock")
NOT_SEARCHED = ("draw", "jitter", "magnify", "stock", "table", "tempo-noise")


@pytest.fixture(scope="module")
def scenes() -> dict[str, de.Scene]:
    return {name: de.load_scene(name) for name in NAMES}


def test_scores_texts_and_gradients_equal_those_of_python(scenes):
    """Of the baseline, the best known layout and a random one of every scene."""
    rng, cases = np.random.default_rng(3), []
    for name, scene in scenes.items():
        layouts = [scene.uniform().layout, best_known()[name].layout]
        layouts += [scene_layout(rng, scene)] if name != "marathon" else []
        cases += [(scene, layout) for layout in layouts]
    answers = run_javascript(
        """answer(data.map(([document, sizes]) => {
          const scene = new Scene(kernels, document), layout = layoutOf(sizes);
          const { score, violations, text } = scene.score(layout);
          return { ...scene.gradient(layout), wave: null, score, violations, text };
        }));""",
        [(scene.document(), sizes(layout)) for scene, layout in cases],
    )
    assert sum(answer["score"] <= 0.0 for answer in answers) >= 2
    for (scene, layout), answer in zip(cases, answers, strict=True):
        wave = scene.simulate(layout)
        score = scene.score(wave)
        assert answer["violations"] == scene.violations(layout)
        assert answer["score"] == pytest.approx(score, rel=1e-9), scene.name
        assert answer["text"] == scene.format_score(score, wave)
        others = layout.thickness[None, 1:], layout.height[None, 1:]
        batch = scene.batch(layout.spacing[None], *others, rtol=1e-10)
        expected = scene.evaluate(batch, gradient=True).gradient
        if score > 0.999 and scene.tempo:
            continue  # errors of the size of rounding have no direction
        for name in ("spacing", "thickness", "height"):
            if score > 0.0:
                values = getattr(expected, name)[0]
                tolerance = {"rtol": 1e-7, "atol": 1e-7 * np.abs(values).max() + 1e-12}
                np.testing.assert_allclose(answer[name], values, **tolerance, err_msg=scene.name)
            else:
                assert answer[name] is None


def uniform_scores(scenes: list[de.Scene]) -> list[float]:
    """Return the scores of the best equal gaps by JavaScript."""
    script = "answer(data.map((document) => new Scene(kernels, document).uniform().score));"
    scores: list[float] = run_javascript(script, [scene.document() for scene in scenes])
    return scores


def test_the_best_equal_gaps_of_shipped_scenes_are_those_of_python(scenes):
    expected = [scene.uniform().score for scene in scenes.values()]
    assert uniform_scores(list(scenes.values())) == pytest.approx(expected, rel=1e-5)


def test_a_released_domino_has_the_push_of_python():
    scenes = [de.load_scene("course-released")]
    scenes += [scenes[0].replace(ground=de.Ground(slope=3.0), length=None)]
    documents = [scene.document() for scene in scenes]
    for document in documents:
        document["physics"]["push"] = "released"
    pushes = [de.Scene.from_document(document).physics.push for document in documents]
    script = "answer(data.map((document) => new Scene(kernels, document).physics.push));"
    assert run_javascript(script, documents) == pytest.approx(pushes, rel=1e-12)


def test_the_best_equal_gaps_of_sampled_scenes_are_those_of_python():
    sampled = load_test_set("varied")[:100:4]
    expected = [scene.uniform().score for scene in sampled]
    assert uniform_scores(sampled) == pytest.approx(expected, rel=1e-5)


def test_a_scene_that_is_not_searched_says_which_command_searches_it():
    documents = [de.load_scene(name).document() for name in (*NAMES, *NOT_SEARCHED)]
    script = "answer(data.map((document) => new Scene(kernels, document).whyNotSearched));"
    for document, reason in zip(documents, run_javascript(script, documents), strict=True):
        expected = f"domino optimize {document['name']}" if document["name"] in NOT_SEARCHED else ""
        assert expected in reason
        assert bool(reason) == bool(expected)


def changed(name: str, **tables: dict[str, Any]) -> dict[str, Any]:
    """Return the document of a shipped scene with other values; None leaves a key out."""
    document = copy.deepcopy(de.load_scene(name).document())
    for table, changes in tables.items():
        document[table] = document.get(table, {}) | changes
        document[table] = {k: v for k, v in document[table].items() if v is not None}
    return document


def test_rules_that_a_layout_violates_are_told_as_in_python(scenes):
    """Too wide and too narrow gaps, thickness, first domino, height, density, length, ground."""
    cases: list[tuple[de.Scene, de.Layout]] = []
    for name in ("course", "gentle", "uphill", "stock", "magnify"):
        scene = scenes[name]
        layout = scene.uniform().layout
        parts = sizes(layout)
        for changes in (
            {"spacing": [0.05, 0.06, *parts["spacing"][2:]]},
            {"thickness": [0.0081, 0.02, *parts["thickness"][2:]]},
            {"density": [900.0] * layout.count},
        ):
            cases.append((scene, de.Layout(**parts | changes)))
    cases.append((scenes["sprint"], scenes["uphill"].uniform().layout))
    cases.append((scenes["sprint"], scenes["course"].uniform().layout))
    answers = run_javascript(
        """answer(data.map(([document, sizes]) =>
          new Scene(kernels, document).violations(layoutOf(sizes))));""",
        [(scene.document(), sizes(layout)) for scene, layout in cases],
    )
    assert answers == [scene.violations(layout) for scene, layout in cases]
    assert all(answers)


REJECTED = [  # with the same sentence or not
    (True, changed("sprint", row={"count": 1})),
    (True, changed("sprint", row={"count": 40.5})),
    (True, changed("sprint", row={"height": -0.048})),
    (True, changed("sprint", physics={"friction": -0.25})),
    (True, changed("sprint", physics={"floor_friction": -0.25})),
    (True, changed("gentle", limits={"stall_margin": 1.5})),
    (True, changed("relay", run_out={"count": 0})),
    (True, changed("tempo", tempo={"from": -1.5})),
    (True, changed("jitter", placement={"deviation": -1.5})),
    (True, changed("sprint", spacing={"min": None})),
    (True, changed("course", row={"length": 12.0})),
    (True, changed("gentle", row={"first_thickness": None})),
    (True, changed("tempo", physics={"floor_friction": 0.5})),
    (True, changed("relay", run_out={"spacing": 0.05})),
    (True, changed("magnify", growth={"min": 1.9})),
    (False, changed("sprint", row={"gap": 1.0})),
    (False, changed("sprint", spacing={"min": 0.05})),
    (False, changed("sprint", spacing={"min": 0.05, "max": 0.06})),
    (False, changed("jitter", placement={"draws": 0, "quantile": 0.1})),
    (False, changed("stock", stock={"thickness": 0.0075})),
    (False, changed("hills", ground={"profile": 5.0})),
    (False, changed("tempo", tempo={"to": None})),
    (False, changed("hills", ground={"slope": 1.0})),
    (False, changed("stock", stock={"count": [1, 2, 3]})),
    (False, changed("sprint", limits={"stall_margin": 0.1}, physics={"floor_friction": 0.4})),
]  # fmt: skip


def test_documents_that_python_rejects_are_rejected():
    """With the same sentence for values out of range."""
    script = "answer(data.map((document) => message(() => new Scene(kernels, document))));"
    answers = run_javascript(script, [document for _, document in REJECTED])
    for (same, document), answer in zip(REJECTED, answers, strict=True):
        with pytest.raises(ValueError, match=r".") as error:
            de.Scene.from_document(document)
        assert answer.startswith("RangeError: ")
        if same:
            assert str(error.value).endswith(answer.removeprefix("RangeError: "))
