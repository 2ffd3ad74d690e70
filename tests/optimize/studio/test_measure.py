"""`measure.js` against `domino_env.measure`: the same constants, numbers and sentences."""

import base64
import re

import numpy as np
import pytest
from page_modules import FOLDER, numbers, run_javascript, sizes
from recordings import record

import domino_env as de
from domino_env.validation import measurement

GAPS = np.append(np.geomspace(0.028, 0.009, 36), [0.002] * 3)
UNEQUAL = de.Layout(GAPS, 0.0075)
UNIFORM = de.load_scene("sprint").uniform().layout
LONG = de.Layout.uniform(60, pitch=0.015)
TIMES = de.simulate(UNEQUAL, de.Physics(friction=0.2, push=9.0)).arrival_times
LATE = de.simulate(LONG).arrival_times + 0.002 * np.sin(np.linspace(0.0, 2.0 * np.pi, 60))
SHORT = {"lead": 0.1, "rest": 0.1}
RATE = 16_000  # of sounds that are rejected
SOUND = record(TIMES, 0, rate=RATE, **SHORT)
MEASURED = [
    (record(TIMES, 1, rate=8000, loudness="alternating", hum=0.3, **SHORT), 8000, UNEQUAL),
    (record(LATE, 3, missing=0.0, double=0.0, **SHORT), 44100, LONG),
]
REJECTED = [
    (SOUND, UNIFORM), (record(TIMES[:23], 2, rate=RATE), UNEQUAL), (np.tile(SOUND, 2), UNEQUAL),
    (SOUND, de.Layout([0.02] * 5, 0.0075)), (np.zeros(90_000), UNEQUAL),
]  # fmt: skip
SCRIPT = """const { measure, CONSTANTS } = await import("FOLDER/measure.js");
const measured = data.recordings.map(({ samples, rate, layout }) => {
  const values = new Float32Array(Uint8Array.from(Buffer.from(samples, "base64")).buffer);
  try {
    return { ...measure(kernels, values, rate, layoutOf(layout), data.physics), rises: null };
  } catch (error) {
    return { sentence: `${error.name}: ${error.message}` };
  }
});
answer({ constants: CONSTANTS, measured });""".replace("FOLDER", FOLDER.as_posix())


@pytest.fixture(scope="module")
def answers():
    """Answers of JavaScript for all recordings."""
    recordings = MEASURED + [(sound, RATE, layout) for sound, layout in REJECTED]
    data = [
        {
            "samples": base64.b64encode(sound.astype("<f4").tobytes()).decode(),
            "rate": rate, "layout": sizes(layout),
        }
        for sound, rate, layout in recordings
    ]  # fmt: skip
    return run_javascript(SCRIPT, {"physics": numbers(de.Physics()), "recordings": data})


def test_constants_are_those_of_python(answers):
    others = "STANDARD", "MIN_RATE", "MAX_RATE"
    names = [name for name in vars(measurement) if re.fullmatch("[A-Z][A-Z_]+", name)]
    assert len(names) > 25
    for name in set(names).difference(others):
        known = getattr(measurement, name)
        np.testing.assert_allclose(answers["constants"][name], known, rtol=1e-14, err_msg=name)


def test_friction_push_and_speed_are_those_of_python(answers):
    """At a low rate; and with more hits than the first fit, where the model is rejected."""
    for (sound, rate, layout), answer in zip(MEASURED, answers["measured"], strict=False):
        known = de.measure(sound.astype(np.float32), rate, layout)
        assert answer["verdict"] == known.verdict
        assert answer["modelRejected"] == known.model_rejected
        for name, javascript in ("friction",) * 2, ("push",) * 2, ("mean_speed", "meanSpeed"):
            error = getattr(known, f"{name}_error")
            assert answer[javascript] == pytest.approx(getattr(known, name), abs=1e-3 * error)
            assert answer[f"{javascript}Error"] == pytest.approx(error, rel=1e-3)
        for name, javascript in ("arrival_times", "arrivalTimes"), ("curve", "curve"):
            np.testing.assert_allclose(answer[javascript], getattr(known, name), atol=1e-6)
    assert [answer["modelRejected"] for answer in answers["measured"][:2]] == [False, True]


def test_other_sounds_are_rejected_with_the_sentences_of_python(answers):
    """Another layout, a stop, two chains, a short layout, and silence."""
    sentences = [answer["sentence"] for answer in answers["measured"][len(MEASURED) :]]
    for (sound, layout), sentence in zip(REJECTED, sentences, strict=True):
        with pytest.raises(ValueError, match=r".") as error:
            de.measure(sound.astype(np.float32), RATE, layout)
        assert sentence == f"RangeError: {error.value}"
    assert len(set(sentences)) == len(REJECTED)
