"""Kernels run by Python, for first calls: to compile an entry point takes seconds.

An entry point without machine code, in memory or in the cache, is run by Python as long as its
arrays are small and it has taken less than `PATIENCE`; then it is compiled. No bit of a result
depends on this: numbers of Python and machine code both follow IEEE 754, and both call the
functions of the C library, such as `exp`.

Python works on copies of the arrays; at the end it writes the numbers that have changed. Where it
raises an error, as for 1/0 or the root of a negative number, or because it cannot run an entry
point (one that returns arrays), the entry point is compiled and called instead.
"""

from __future__ import annotations

import contextlib
import logging
import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numba
import numpy as np

PATIENCE = 4.0  # processor time [s] of each entry point in Python, about as long as its compilation
MOST_NUMBERS = 5_000  # in the arrays of a call

_PACKAGE = __name__.rpartition(".jit.")[0]
_COUNTERPARTS: dict[Any, Any] = {}  # what stands for intrinsic functions and for modules
_spent: dict[Any, float] = {}  # processor time of calls without machine code [s], by entry point
_missing: set[tuple[Any, ...]] = set()  # entry points and types without machine code in the cache
logger = logging.getLogger(__name__)
_contexts: list[None] = []  # one entry for each open context `compiled`, of all threads
_thread = threading.local()  # deadline of a call; `searching`: machine code is searched


class NotFoundError(Exception):
    """The cache has no machine code of the entry point."""


def with_counterpart(intrinsic: Any, counterpart: Callable[..., Any]) -> Any:
    """Register the Python function that does what an intrinsic function does; return the latter."""
    _COUNTERPARTS[intrinsic] = counterpart
    return intrinsic


@contextlib.contextmanager
def compiled() -> Iterator[None]:
    """Open a context in which every simulation is run by machine code.

    Outside, Python runs short calls of a process that has no machine code yet, as compiling it
    takes seconds. Results are the same; run times should be measured inside.

    Examples
    --------
    >>> import domino_env as de
    >>> with de.compiled():
    ...     wave = de.simulate(de.Layout.uniform(40, pitch=0.024))
    """
    _contexts.append(None)
    try:
        yield
    finally:
        _contexts.pop()


def postpone_compilation(dispatcher: Any) -> None:
    """Make an entry point run by Python where that is allowed and no machine code is found."""
    compile_for: Callable[..., Any] = dispatcher._compile_for_args

    def first_call(*arguments: Any) -> Any:
        """Return the function that Numba calls with the arguments."""
        if not _is_allowed(dispatcher, arguments):
            return compile_for(*arguments)
        start, spent = time.thread_time(), _spent.get(dispatcher, 0.0)
        _thread.deadline = start + PATIENCE - spent
        try:
            key = dispatcher, *map(numba.typeof, arguments)
            if key not in _missing:
                with contextlib.suppress(NotFoundError), _searching():
                    return compile_for(*arguments)
                _missing.add(key)
            result = interpret(dispatcher, arguments)
        except Exception:  # of whatever kind: machine code decides
            logger.debug("compiling %s", dispatcher.py_func.__name__, exc_info=True)
            return compile_for(*arguments)
        finally:
            _spent[dispatcher] = spent + time.thread_time() - start
            _thread.deadline = math.inf
        return lambda *_: result

    dispatcher._compile_for_args = first_call


@contextlib.contextmanager
def _searching() -> Iterator[None]:
    """Open a context in which machine code is searched in the cache, and nothing is compiled."""
    _thread.searching = True
    try:
        yield
    finally:
        _thread.searching = False


def stop_if_searching() -> None:
    """Raise NotFoundError if machine code is only searched."""
    if getattr(_thread, "searching", False):
        raise NotFoundError


def _is_allowed(dispatcher: Any, arguments: tuple[Any, ...]) -> bool:
    """Return True if Python may run a call of an entry point."""
    if _contexts or _spent.get(dispatcher, 0.0) >= PATIENCE:
        return False
    sizes = (part.size for part in _parts(arguments) if isinstance(part, np.ndarray))
    return sum(sizes) <= MOST_NUMBERS


def check_deadline() -> None:
    """Raise TimeoutError if Python has taken too long."""
    if time.thread_time() > getattr(_thread, "deadline", math.inf):
        raise TimeoutError


def interpret(dispatcher: Any, arguments: tuple[Any, ...]) -> Any:
    """Run an entry point by Python; no array is written if an error is raised."""
    arrays: dict[int, tuple[Any, Any, Any]] = {}  # an array, its copy and what stands for it

    def unpacked(value: Any) -> Any:
        if isinstance(value, tuple):
            parts = map(unpacked, value)
            return value._make(parts) if hasattr(value, "_make") else tuple(parts)
        if isinstance(value, np.void):
            raise TypeError("a record that is no array")
        if not isinstance(value, np.ndarray):
            return value
        if id(value) not in arrays:
            arrays[id(value)] = value, value.copy(), _unpack(value.copy())
        return arrays[id(value)][-1]

    with np.errstate(all="ignore"):
        result = _in_python(dispatcher)(*map(unpacked, arguments))
    if not all(isinstance(part, int | float | None) for part in _parts(result)):
        raise TypeError("the result contains an array")
    changes = [
        change for original, before, after in arrays.values() if original.flags.writeable
        for change in _changes(original, before, _pack(after, original.dtype))
    ]  # fmt: skip
    for target, changed, values in changes:
        target[changed] = values
    return result


class _Table:
    """Array of several axes; a row is a `memoryview`, whose elements are numbers of Python."""

    def __init__(self, array: Any) -> None:
        self.array, self.shape = array, array.shape

    def __len__(self) -> int:
        return len(self.array)

    def __getitem__(self, index: Any) -> Any:
        value = self.array[index]
        return _unpack(value) if isinstance(value, np.ndarray) else value.item()

    def __setitem__(self, index: Any, value: Any) -> None:
        self.array[index] = value


def _unpack(array: Any) -> Any:
    """Return what stands for an array in Python: lists of objects if it has records."""
    names = array.dtype.names
    if names is None:
        return memoryview(array) if array.ndim == 1 else _Table(array)

    def objects(value: Any) -> Any:
        if isinstance(value, tuple):
            return SimpleNamespace(**dict(zip(names, value, strict=True)))
        return list(map(objects, value))

    return objects(array.tolist())


def _pack(value: Any, dtype: Any) -> Any:
    """Return the array for which the result of `_unpack` stands."""
    if not isinstance(value, list):
        return value.array if isinstance(value, _Table) else np.asarray(value)

    def records(value: Any) -> Any:
        return list(map(records, value)) if isinstance(value, list) else tuple(vars(value).values())

    return np.array(records(value), dtype)


def _changes(original: Any, before: Any, after: Any) -> Iterator[tuple[Any, Any, Any]]:
    """Yield array, mask and values of the numbers that have changed: threads write the others."""
    for field in original.dtype.names or (...,):
        old, new = (np.ascontiguousarray(array[field]) for array in (before, after))
        bits = f"u{new.itemsize}"
        changed = old.view(bits) != new.view(bits)
        yield original[field], changed, new[changed]


def _zeros(*arguments: Any) -> Any:
    """Return zeros: of one axis as a list, which is faster, but whose slices are copies."""
    array = np.zeros(*arguments)
    return array.tolist() if array.ndim == 1 and array.dtype == float else _unpack(array)


_COUNTERPARTS[np] = SimpleNamespace(**vars(np) | {"zeros": _zeros, "empty": _zeros})
# that of the C library, which machine code calls; Python has its own
_COUNTERPARTS[math] = SimpleNamespace(**vars(math) | {"hypot": lambda x, y: float(np.hypot(x, y))})


def _parts(value: Any) -> Iterator[Any]:
    """Yield what nested tuples contain."""
    if isinstance(value, tuple):
        for part in value:
            yield from _parts(part)
    else:
        yield value


def _in_python(value: Any) -> Any:
    """Return what stands for a global name of a kernel in Python."""
    if isinstance(value, ModuleType) and value.__name__.startswith(_PACKAGE):
        return SimpleNamespace(**_namespace(value.__name__))
    if hasattr(value, "py_func"):
        function = value.py_func
        return _namespace(function.__module__)[function.__name__]
    if isinstance(value, np.ndarray):  # a table of constants
        if value.ndim == 1:
            return value.tolist()
        return {index: number.item() for index, number in np.ndenumerate(value)}
    with contextlib.suppress(TypeError):  # for a value without a hash
        return _COUNTERPARTS.get(value, value)
    return value


@cache
def _namespace(module: str) -> dict[str, Any]:
    """Return the global names of a module of kernels, with functions that Python runs."""
    names = dict(vars(sys.modules[module]))
    for name, value in names.items():
        if getattr(value, "__module__", "") == module and hasattr(value, "py_func"):
            function = value.py_func
            names[name] = FunctionType(function.__code__, names, function.__name__)
        elif not name.startswith("__"):
            names[name] = _in_python(value)
    return names
