"""Odd files: what every test of reading them shares."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st

from domino_env.core.progress import Advice

CORPUS = Path(__file__).parent / "data" / "hostile"
EXAMPLES = os.environ.get("FUZZ_EXAMPLES", "60")
FUZZ = settings(
    max_examples=int(EXAMPLES), derandomize="FUZZ_EXAMPLES" not in os.environ, deadline=None
)

TRICKS = [
    b"\0", b"\xff", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b'"', b'"""', b",", b";", b"\t",
    b"=1+1", b"1e400", b"-1", b"nan", b"1e-320", b"true", b"[" * 20, b"#", b"\x1b[2J", b"../x",
]  # fmt: skip
NUMBERS: Any = st.one_of(
    st.floats(),
    st.floats(1e-9, 1e9),
    st.integers(),
    st.sampled_from([10**400, 2**64, 0, -1, 1e308]),
)
ODD: Any = st.one_of(NUMBERS, st.booleans(), st.none(), st.text(max_size=20))
DEEP: Any = st.recursive(
    ODD,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=12,
)


@st.composite
def mutated(draw: Any, data: bytes) -> bytes:
    """Valid bytes with some damage: torn, doubled, with strange signs in them."""
    for _ in range(draw(st.integers(1, 5))):
        at = draw(st.integers(0, len(data)))
        to = min(len(data), at + draw(st.integers(0, 30)))
        kind = draw(st.sampled_from(["bytes", "trick", "cut", "again", "end"]))
        if kind == "bytes":
            data = data[:at] + draw(st.binary(max_size=4)) + data[to:]
        elif kind == "trick":
            data = data[:at] + draw(st.sampled_from(TRICKS)) + data[at:]
        elif kind == "cut":
            data = data[:at] + data[to:]
        elif kind == "again":
            data = data[:to] + data[at:]
        else:
            data = data[:at]
    return data


def entered(door: Callable[[Path], Any], path: Path, *, named: bool = True) -> Any:
    """What a door makes of a file; None where it refuses it as it should.

    Anything but a ValueError or an OSError, a warning, and a message that nobody should print
    fail the test that asks.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", Advice)  # of a length that is read as it stands
        try:
            return door(path)
        except (ValueError, OSError) as error:
            said = str(error)
    wrong = complaint(said, path if named else None)
    assert wrong is None, f"{wrong}: {said!r}"
    return None


def complaint(said: str, path: Path | None) -> str | None:
    """What is wrong with a message."""
    if not said.isprintable():
        return "it cannot be printed in a line"
    if len(said) >= 500 + (len(str(path)) if path else 0):
        return "it is too long"
    if path is not None and str(path) not in said:
        return "it does not name the file"
    return None
