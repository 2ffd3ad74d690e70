"""Range checks: what is accepted passes, everything else is one sentence."""

import re

import numpy as np
import pytest

from domino_env.core.checks import require, require_choice


@pytest.mark.parametrize(
    ("value", "bounds"),
    [
        (0.0, {"low": 0.0}), (1, {"low": 0.0, "high": 1.0}), (np.float32(0.5), {"above": 0.0}),
        (np.int64(3), {"low": 1, "whole": True}), (np.array([0.1, 2.0]), {"above": 0.0}),
        (np.zeros((0, 3)), {"above": 0.0}),
    ],
)  # fmt: skip
def test_accepted(value, bounds):
    require("x", value, **bounds)


@pytest.mark.parametrize(
    ("value", "bounds", "sentence"),
    [
        (0.0, {"above": 0.0, "unit": "m", "hint": "18 mm is 0.018"},
         "x = 0.0 m: give a finite number, more than 0 (18 mm is 0.018)"),
        (float("nan"), {}, "x = nan: give a finite number"),
        (float("inf"), {"low": 0.0}, "x = inf: give a finite number, at least 0"),
        (2, {"low": 0, "high": 1}, "x = 2: give a finite number from 0 to 1"),
        (1.0, {"low": 0.0, "below": 1.0}, "x = 1.0: give a finite number, at least 0, less than 1"),
        (2.5, {"low": 1, "high": 1_000_000, "whole": True},
         "x = 2.5: give a whole number from 1 to 1000000"),
        ("2", {}, "x = '2': give a finite number"),
        (True, {"low": 0, "whole": True}, "x = True: give a whole number, at least 0"),
        (None, {}, "x = None: give a finite number"),
        (np.array([[1.0, 2.0], [1.0, np.nan]]), {"above": 0.0, "unit": "m"},
         "x[1, 1] = nan m: give a finite number, more than 0"),
    ],
)  # fmt: skip
def test_rejected_with_a_sentence(value, bounds, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        require("x", value, **bounds)


def test_choices():
    require_choice("method", "cma", ["auto", "cma"])
    with pytest.raises(ValueError, match=r"method = 'cam': did you mean 'cma'\? choose one of"):
        require_choice("method", "cam", ["auto", "cma"])
