"""`kernels.js`, `ground.js` and `chain.wasm` against Python: waves, motion, ground, sentences."""

import math

import numpy as np
import pytest
from golden_layouts import equal_layouts, odd_layouts, usual_layouts
from page_modules import numbers, run_javascript, sizes
from uneven_layouts import POINTS, uneven_layout

import domino_env as de
from domino_env.physics.motion import Motion
from domino_env.rigid.simulation import simulate_standing
from optimize.studio.wasm.build import MODULE, stamp_section

FIELDS = {
    "arrivalTimes": "arrival_times", "releaseVelocity": "release_velocity",
    "impactVelocity": "impact_velocity", "stallMargin": "stall_margin",
    "meanSpeed": "mean_speed", "localSpeed": "local_speed", "hit": "hit", "toppled": "toppled",
    "reach": "reach", "errorEstimate": "error_estimate", "converged": "converged",
    "flushes": "flushes", "releases": "releases", "largestFlushLoss": "largest_flush_loss",
    "lowestStallMargin": "lowest_stall_margin", "propagated": "propagated",
}  # fmt: skip
LAYOUTS = [
    (de.Layout.uniform(12, pitch=0.02), de.Physics()),
    (de.Layout([0.018, 0.012, 0.06, 0.01], 0.0075), de.Physics()),
    (de.Layout.uniform(8, pitch=0.02), de.Physics(push=0.5)),
    (de.Layout.uniform(8, pitch=0.009, thickness=0.0085), de.Physics(friction=0.9)),
    (de.Layout([0.02, 0.024], [0.007, 0.008, 0.009], [0.048, 0.06, 0.07]), de.Physics()),
    (uneven_layout(3, 9, True), de.Physics(push=14.0)),
]
CASES = [(sizes(layout), numbers(physics)) for layout, physics in LAYOUTS]
PARTS = [-0.1, 0.0, 0.21, 0.5, 0.77, 1.0, 1.5]  # of the duration of a motion


def test_the_module_is_made_from_the_kernels_of_this_version():
    assert MODULE.read_bytes().endswith(stamp_section()), "chain.wasm is old: run make wasm"


def random_layouts():
    """Return 500 pairs of layout and physics, of all kinds."""
    rng = np.random.default_rng(60)
    blocks = [
        *(odd_layouts(rng, 10, None if k % 2 else 0.0) for k in range(12)),
        *(usual_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[k % 4]) for k in range(12)),
        *(equal_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[k % 4]) for k in range(8)),
    ]
    pairs = [(layout, physics) for _, physics, block in blocks for layout in block]
    for seed in range(180):
        physics = de.Physics(friction=rng.choice([0.0, 0.2, 0.5]), push=rng.uniform(2.0, 16.0))
        pairs.append((uneven_layout(seed, int(rng.integers(2, 30)), seed % 3 == 0), physics))
    return pairs


def test_waves_and_gradients_of_random_layouts_equal_those_of_python():
    cases, outcomes = [], set()
    for layout, physics in random_layouts():
        wave = de.simulate(layout, physics, gradient=True)
        bar = np.where(np.isfinite(wave.arrival_times), np.linspace(0.5, 1.0, layout.count), 0.0)
        cases.append((wave, bar))
        outcomes.add(wave.outcome)
    assert (len(cases), len(outcomes) >= 4) == (500, True)
    answers = run_javascript(
        """answer(data.map(([sizes, physics, bar]) => {
          const { wave, ...bars } = kernels.gradient(layoutOf(sizes), physics, bar);
          return { ...wave, bars };
        }));""",
        [(sizes(w.layout), numbers(w.physics), bar.tolist()) for w, bar in cases],
    )
    for (wave, bar), answer in zip(cases, answers, strict=True):
        assert answer["outcome"] == wave.outcome.name
        for name in ("hit", "toppled", "flushes", "releases"):
            assert answer[name] == getattr(wave, name)
        for name in ("arrivalTimes", "releaseVelocity", "impactVelocity"):
            np.testing.assert_allclose(answer[name], getattr(wave, FIELDS[name]), rtol=1e-12)
        margin = answer["stallMargin"]
        np.testing.assert_allclose(margin, wave.stall_margin, rtol=1e-9, atol=1e-12)
        expected = vars(wave.pullback(bar))
        for name, values in answer["bars"].items():
            known = expected[name]
            slack = 1e-12 + 1e-9 * np.max(np.abs(known), initial=0.0)
            np.testing.assert_allclose(values, known, rtol=1e-9, atol=slack)


def test_waves_and_positions_have_the_values_and_sentences_of_python():
    """Propagated, out of reach, stalled at the push, stalled or jammed; growing and on ground."""
    answers = run_javascript(
        """answer(data.map(([sizes, physics]) => {
          const wave = kernels.simulate(layoutOf(sizes), physics), { layout } = wave;
          const { meanSpeed, localSpeed, converged, propagated, explanation } = wave;
          return { ...wave, meanSpeed, localSpeed, converged, propagated, explanation,
            positions: kernel.positions(layout), pivots: kernel.pivots(layout) };
        }));""",
        CASES,
    )
    outcomes = set()
    for (layout, physics), answer in zip(LAYOUTS, answers, strict=True):
        wave = de.simulate(layout, physics)
        outcomes.add(answer["outcome"])
        assert answer["outcome"] == wave.outcome.name
        assert answer["explanation"] == wave.explanation
        for name, known in FIELDS.items():
            value = np.asarray(getattr(wave, known), float)
            np.testing.assert_allclose(answer[name], value, rtol=1e-9, err_msg=name)
        np.testing.assert_allclose(answer["positions"], layout.positions, rtol=1e-14)
        np.testing.assert_allclose(answer["pivots"], layout.pivots, rtol=1e-14)
    assert len(outcomes) >= 3


def test_leans_at_any_time_equal_those_of_python():
    answers = run_javascript(
        """answer(data.map(([sizes, physics]) => {
          const motion = kernels.motion(kernels.simulate(layoutOf(sizes), physics));
          return { end: motion.end, leans: PARTS.map((part) => motion.leans(part * motion.end)) };
        }));""".replace("PARTS", str(PARTS)),
        CASES,
    )
    for (layout, physics), answer in zip(LAYOUTS, answers, strict=True):
        motion = Motion(layout, physics)
        assert answer["end"] == pytest.approx(motion.end, rel=1e-12)
        times = motion.end * np.array(PARTS)
        np.testing.assert_allclose(answer["leans"], motion.angles(times), rtol=1e-9, atol=1e-12)


def test_free_standing_dominoes_are_those_of_python():
    """On two floors and fixed pivots, on flat and uneven ground, and with too small a push."""
    cases = [
        (LAYOUTS[0][0], de.Physics(), 0.5),
        (LAYOUTS[0][0], de.Physics(), None),
        (uneven_layout(3, 6), de.Physics(push=14.0), 0.4),
        (uneven_layout(3, 6), de.Physics(push=14.0), None),
        (LAYOUTS[2][0], de.Physics(push=0.5), 0.3),
    ]  # fmt: skip
    answers = run_javascript(
        """answer(data.map(([sizes, physics, floor]) =>
          kernels.standing(layoutOf(sizes), physics, floor, { rtol: 0.1 })));""",
        [(sizes(layout), numbers(physics), floor) for layout, physics, floor in cases],
    )
    for (layout, physics, floor), answer in zip(cases, answers, strict=True):
        wave = simulate_standing(layout, physics, floor, rtol=0.1)
        for name in ("hit", "toppled", "propagated", "converged"):
            assert answer[name] == getattr(wave, name)
        assert answer["topples"] == wave.topples.tolist()
        np.testing.assert_allclose(answer["arrivalTimes"], wave.arrival_times, rtol=1e-12)
        np.testing.assert_allclose(answer["lean"], wave.lean, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(answer["slid"], wave.slid, rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(answer["opened"], wave.opened, rtol=1e-5, atol=1e-9)
        assert answer["meanSpeed"] == pytest.approx(wave.mean_speed, rel=1e-9)
        assert answer["errorEstimate"] == pytest.approx(wave.error_estimate, rel=1e-4)


@pytest.mark.parametrize("ground", [{"slope": 4.0}, {"profile": POINTS}])
def test_ground_places_dominoes_and_bends_gradients_as_in_python(ground):
    rng = np.random.default_rng(1)
    gaps, thick = rng.uniform(0.012, 0.02, 20).tolist(), rng.uniform(0.006, 0.008, 21).tolist()
    places = [-0.2, 0.0, 0.1, 0.5]
    answer = run_javascript(
        """const ground = new Ground(kernels, data.ground), layout = layoutOf(data.sizes);
        Object.assign(layout, { height: layout.thickness.map(() => 0.048), density: 1040 });
        Object.assign(layout, ground.riseAndTilt(layout));
        const bar = (wave) => wave.arrivalTimes.map((t) => (t < Infinity ? 1 : 0));
        const physics = { friction: 0.25, gravity: 9.81, push: 12 };
        const along = ground.along(kernels.gradient(layout, physics, bar), layout);
        answer({ ...layout, along, heights: data.places.map((x) => ground.height(x)) });""",
        {"ground": ground, "sizes": {"spacing": gaps, "thickness": thick}, "places": places},
    )
    known = de.Ground(**ground)
    layout = known.layout(gaps, thick)
    np.testing.assert_allclose(answer["rise"], layout.rise, rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(answer["tilt"], layout.tilt, rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(answer["heights"], known.height(places), atol=1e-15)
    wave = de.simulate(layout, de.Physics(push=12.0), gradient=True)
    gradient = wave.pullback(np.where(np.isfinite(wave.arrival_times), 1.0, 0.0))
    expected = known.along_ground(gradient, layout)
    np.testing.assert_allclose(answer["along"]["spacing"], expected.spacing, rtol=1e-7)
    np.testing.assert_allclose(
        answer["along"]["thickness"], expected.thickness, rtol=1e-7, atol=1e-9
    )


FLAT = {
    "spacing": [0.01, 0.02], "thickness": [0.0075] * 3, "height": [0.048] * 3,
    "density": [1e3] * 3, "width": 0.02,
}  # fmt: skip
REJECTED_LAYOUTS = [
    {"spacing": [0.01, -0.01]}, {"thickness": [0.0075, 0.0, 0.0075]}, {"thickness": [0.0075] * 2},
    {"height": [0.048, 0.02, 0.048]}, {"density": [0.0, 1.0, 1.0]}, {"width": -0.5},
    {"rise": [0.0, 0.0], "tilt": [0.0, 0.2, 0.0]}, {"rise": [0.0, 0.0], "tilt": [0.15, -0.15, 0.0]},
    {"rise": [0.0, 0.03], "tilt": [0.0] * 3},
]  # fmt: skip
REJECTED_PHYSICS = [{"friction": -0.5}, {"gravity": 0}, {"push": 10000000000}]


def test_sentences_about_layouts_physics_and_ground_are_those_of_python():
    profiles = [[0.0, 0.0], [0.1, 0.3], [0.2, 0.1]], [[0.0, 0.0], [-0.1, 0.3]]
    grounds = [{"slope": 50}, *({"profile": points} for points in profiles)]
    data = {"layouts": REJECTED_LAYOUTS, "physics": REJECTED_PHYSICS, "grounds": grounds}
    answers = run_javascript(
        """const physics = { friction: 0.25, gravity: 9.81, push: 8 }, flat = layoutOf(data.flat);
        const tell = (layout, changes) => message(
          () => kernels.simulate({ ...flat, ...layoutOf(layout) }, { ...physics, ...changes }));
        answer({
          layouts: data.layouts.map((changes) => tell(changes, {})),
          physics: data.physics.map((changes) => tell({}, changes)),
          grounds: data.grounds.map((ground) => message(() => new Ground(kernels, ground))),
        });""",
        {"flat": FLAT} | data,
    )
    makers = {
        "layouts": lambda changes: de.Layout(**FLAT | changes),
        "physics": lambda changes: de.Physics(**changes),
        "grounds": lambda changes: de.Ground(**changes),
    }
    for kind, make in makers.items():
        for changes, answer in zip(data[kind], answers[kind], strict=True):
            with pytest.raises(ValueError, match=r".") as error:
                make(changes)
            assert answer == f"RangeError: {error.value}"


def test_numbers_are_written_as_in_python():
    values = [0.0, 1.0, -0.25, 1e-5, 123456.0, 1234567.0, 0.1 + 0.2, 1e16, 1e22, 2.5e-7]
    script = "answer(data.map((x) => [kernel.general(x), kernel.general(x, 3), kernel.repr(x)]));"
    expected = [[f"{x:g}", f"{x:.3g}", repr(x)] for x in values]
    assert run_javascript(script, values) == expected
    infinite = run_javascript("answer([kernel.general(-Infinity), kernel.general(NaN)]);", None)
    assert infinite == [f"{-math.inf:g}", f"{math.nan:g}"]
