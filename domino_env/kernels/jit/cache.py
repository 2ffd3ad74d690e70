"""When cached machine code is still good, and what has to be loaded before it.

Numba caches machine code under the state of the one file that a function stands in.  A kernel
stands on functions and tables of its neighbours, so ours are cached under a stamp of all files of
the folder: whatever is edited, everything that could have read it is compiled anew.
"""

import contextlib
import hashlib
import warnings
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba.core import caching

from domino_env.core.progress import Advice, notice

_FOLDER = Path(__file__).parents[1]
STAMP = hashlib.sha256(
    b"\0".join(path.read_bytes() for path in sorted(_FOLDER.rglob("*.py")))
).digest()

_BY_NAME: dict[str, Any] = {}  # functions that are not inlined
_BY_SYMBOL: dict[str, tuple[str, tuple[Any, ...]]] = {}  # their compiled symbols: name, types


_ADVISED: list[str] = []  # of folders that cannot be written; one line is enough
_NOTICED: list[str] = []


def use_cache(dispatcher: Any) -> None:
    """Cache what is compiled; where no folder can be written, compile in memory and say so."""
    dispatcher._cache = _Cache(dispatcher.py_func)


def register_noinline(dispatcher: Any) -> None:
    """Register the symbols of a function that is not inlined, for its callers."""
    name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
    add = dispatcher.add_overload

    def add_overload(result: Any) -> None:
        add(result)
        _BY_SYMBOL[result.fndesc.llvm_func_name] = name, tuple(result.signature.args)

    dispatcher.add_overload = add_overload
    _BY_NAME[name] = dispatcher


def _provide(symbol: str, name: str, arguments: tuple[Any, ...]) -> None:
    """Define the symbol by which cached callers know a function that is not inlined.

    It has another where it has been compiled anew since.
    """
    if symbol in _BY_SYMBOL:
        return
    dispatcher = _BY_NAME[name]
    dispatcher.compile(arguments)
    found = dispatcher.overloads[arguments]
    engine = found.library._codegen._engine
    llvm.add_symbol(symbol, engine.get_function_address(found.fndesc.llvm_func_name))
    _BY_SYMBOL[symbol] = name, arguments


class _Stamped:
    """Before one of Numba's locators: the stamp of the folder instead of that of a file."""

    def get_source_stamp(self) -> bytes:
        return STAMP


_LOCATORS: Any = [
    type(f"Stamped{locator.__name__}", (_Stamped, locator), {})
    for locator in caching.CompileResultCacheImpl._locator_classes
]


class _ReadOnly(next(one for one in _LOCATORS if "InTree" in one.__name__)):  # type: ignore[misc]
    """The folder of the source, though it cannot be written: what is there already is used.

    In a container, say, whose image was built by another user.
    """

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return cls(py_func, py_file)


class _Implementation(caching.CompileResultCacheImpl):
    """Implementation that keeps with machine code the functions it calls, and loads them first."""

    _locator_classes: Any = [*_LOCATORS, _ReadOnly]  # noqa: RUF012 - Numba's own attribute

    def reduce(self, data: Any) -> Any:
        needs = [
            (function.name, *_BY_SYMBOL[function.name])
            for function in data.library._final_module.functions
            if function.is_declaration and function.name in _BY_SYMBOL
        ]
        return needs, super().reduce(data)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        needs, payload = payload
        for symbol, name, arguments in needs:
            _provide(symbol, name, arguments)
        return super().rebuild(target_context, payload)


class _Cache(caching.FunctionCache):
    _impl_class = _Implementation

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            found = super().load_overload(sig, target_context)
        except OSError:  # somebody else's file, or none where a folder should be
            found = None
        except (AttributeError, ImportError):  # of types that the package no longer has
            found = None
            with contextlib.suppress(OSError):
                self._cache_file.flush()
        if found is None and not _NOTICED:
            _NOTICED.append(self.cache_path)
            notice("compiling the simulator, once: some ten seconds ...")
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:  # what is compiled serves this process all the same
            self.disable()
            if not _ADVISED:
                _ADVISED.append(self.cache_path)
                warnings.warn(
                    f"compiled code cannot be kept in {self.cache_path} ({error.strerror}), so "
                    "every process compiles it anew, which takes a while: set NUMBA_CACHE_DIR to a "
                    "folder that can be written",
                    Advice,
                    stacklevel=2,
                )
