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
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

PATIENCE = 4.0  # processor time [s] of each entry point in Python, about as long as its compilation
MOST_NUMBERS = 5_000  # in the arrays of a call

_PACKAGE = __name__.rpartition(".jit.")[0]
_COUNTERPARTS: dict[Any, Callable[..., Any]] = {}  # Python functions, by intrinsic function
_spent: dict[Any, float] = {}  # time in Python [s], by entry point
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
    """Open a context in which every entry point that is called is compiled."""
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
        if _is_allowed(dispatcher, arguments):
            _thread.searching = True
            try:
                return compile_for(*arguments)
            except NotFoundError:
                with contextlib.suppress(Exception):  # machine code raises the same, or does not
                    result = interpret(dispatcher, arguments)
                    return lambda *_: result
            finally:
                _thread.searching = False
        return compile_for(*arguments)

    dispatcher._compile_for_args = first_call


def end_search() -> None:
    """Raise NotFoundError if an entry point without machine code shall not be compiled."""
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
    if time.thread_time() > _thread.deadline:
        raise TimeoutError


def interpret(dispatcher: Any, arguments: tuple[Any, ...]) -> Any:
    """Run an entry point by Python; no array is written if an error is raised."""
    arrays: dict[int, tuple[Any, Any, Any]] = {}  # an array, its copy and what stands for it

    def unpacked(value: Any) -> Any:
        if isinstance(value, tuple):
            parts = map(unpacked, value)
            return value._make(parts) if hasattr(value, "_make") else tuple(parts)
        if not isinstance(value, np.ndarray):
            return value
        copies = value.copy(), _unpack(value.copy())
        return arrays.setdefault(id(value), (value, *copies))[-1]

    start = time.thread_time()
    _thread.deadline = start + PATIENCE - _spent.get(dispatcher, 0.0)
    try:
        with np.errstate(all="ignore"):
            result = _in_python(dispatcher)(*map(unpacked, arguments))
    finally:
        _spent[dispatcher] = _spent.get(dispatcher, 0.0) + time.thread_time() - start
    if not all(isinstance(part, int | float | None) for part in _parts(result)):
        raise TypeError("the result contains an array")
    for original, before, after in arrays.values():
        if original.flags.writeable:
            _write_changes(original, before, _pack(after, original.dtype))
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


def _write_changes(original: Any, before: Any, after: Any) -> None:
    """Write the numbers that differ from those before: other threads write the others."""
    for field in original.dtype.names or (...,):
        old, new = (np.ascontiguousarray(array[field]) for array in (before, after))
        bits = f"u{new.itemsize}"
        changed = old.view(bits) != new.view(bits)
        original[field][changed] = new[changed]


def _zeros(*arguments: Any) -> Any:
    """Return zeros: of one axis as a list, which is faster; kernels write into no slice of it."""
    array = np.zeros(*arguments)
    return array.tolist() if array.ndim == 1 and array.dtype == float else _unpack(array)


_NUMPY = SimpleNamespace(**vars(np) | {"zeros": _zeros, "empty": _zeros})


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
    if value is np:
        return _NUMPY
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
