"""Models of documents: an error names the key, its value and what is allowed."""

from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from msgspec import Meta

from domino_env.core.models import Number, Size, Table, read_model


@dataclass(frozen=True)
class Pair:
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError(f"low = {self.low} is more than high = {self.high}")
        if self.high == 99.0:
            raise ValueError("both are strange")


class Inner(Table):
    kind: Literal["a", "b"] = "a"
    part: Annotated[float, Meta(gt=0, le=1, description="of the whole")] = 1.0
    flag: bool = False


class Outer(Table):
    count: Annotated[int, Meta(ge=2)]
    inner: Inner | None = None
    sizes: Annotated[Size | list[Size], Meta(description="of all [m]")] = 1.0
    pair: Pair | None = None
    both: tuple[Number, Number] = (0.0, 1.0)
    label: Annotated[str, Meta(max_length=3)] = ""


@pytest.mark.parametrize(("document", "sentence"), [
    ([], "this is []: give a table of count, inner, sizes, pair, both, label"),
    ({}, "count is missing: give a whole number, at least 2"),
    ({"count": 1}, "count = 1: give a whole number, at least 2"),
    ({"count": 2, "inner": {"knd": 1}},
     "unknown key 'inner.knd': did you mean 'kind'? allowed: kind, part, flag"),
    ({"count": 2, "inner": {"kind": "c"}}, "inner.kind = 'c': choose one of a, b"),
    ({"count": 2, "inner": {"part": 0}},
     "inner.part = 0: give a finite number, more than 0, at most 1 (of the whole)"),
    ({"count": 2, "inner": {"flag": 1}}, "inner.flag = 1: give true or false"),
    ({"count": 2, "sizes": "x"},
     "sizes = 'x': give a finite number from 1e-09 to 1e+09 or a list, each a finite number "
     "from 1e-09 to 1e+09 (of all [m])"),
    ({"count": 2, "sizes": [1.0, float("nan")]},
     "sizes[1] = nan: give a finite number from 1e-09 to 1e+09 (of all [m])"),
    ({"count": 2, "pair": {"low": 2.0, "high": 1.0}},
     "pair.low = 2.0 is more than high = 1.0"),
    ({"count": 2, "pair": {"low": 2.0, "high": 99}}, "pair: both are strange"),
    ({"count": 2, "both": [1.0]}, "both = [1.0]: give a list of 2 numbers"),
    ({"count": 2, "both": [1.0, float("inf")]}, "both[1] = inf: give a finite number"),
    ({"count": 2, "both": [1.0, 10**400]}, "both[1] = 1000"),
    ({"count": 2, "label": "long"}, "label = 'long': give a line of text of at most 3 char"),
])  # fmt: skip
def test_an_error_names_the_key_its_value_and_what_is_allowed(document, sentence):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - compared below
        read_model(Outer, document)
    assert str(caught.value).startswith(sentence)
