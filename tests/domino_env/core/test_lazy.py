"""Values whose fields are computed when one of them is first read."""

import copy
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

import domino_env as de

LAYOUT = de.Layout([0.012, 0.014], 0.0075)


def test_a_field_is_computed_once_when_it_is_read():
    calls = []
    layout = de.Layout.later(lambda: calls.append(1) or LAYOUT)
    assert not hasattr(layout, "gaps")
    with pytest.raises(AttributeError, match="'Layout' object has no attribute 'gaps'"):
        _ = layout.gaps
    assert calls == []
    assert (layout.count, layout, repr(layout)) == (3, LAYOUT, repr(LAYOUT))
    assert calls == [1]
    assert vars(layout).keys() == vars(LAYOUT).keys()


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda v: pickle.loads(pickle.dumps(v))]
)
@pytest.mark.parametrize("value", [LAYOUT, de.simulate(LAYOUT)])
def test_a_copy_is_computed(copied, value):
    later = type(value).later(lambda: value)
    twin = copied(later)
    assert "_call" not in vars(twin) | vars(later)
    assert (type(twin), twin, hash(twin)) == (type(value), value, hash(value))


@pytest.mark.parametrize("name", ["layout", "rtol"])
def test_threads_may_read_a_value_at_the_same_time(name):
    both, wave = threading.Barrier(2), de.simulate(LAYOUT)

    def compute():
        both.wait(timeout=60.0)
        return wave

    later = de.Wave.later(compute)
    with ThreadPoolExecutor(2) as pool:
        reads = [pool.submit(getattr, later, name) for _ in range(2)]
    assert all(read.result() is getattr(wave, name) for read in reads)
