"""How everything in this folder is compiled.

Left alone, Numba links the machine-independent code of every function into each of its callers and
optimises the whole again, layer by layer, gives each function wrappers for Python and C and a cache
file, and compiles it anew for every literal (`True`, 0) that it is called with: the first wave then
waits three times as long.  Here a function is one of

    part     of its callers: translated once, optimised and turned into machine code only there
    inlined  a part that its callers never call
    apart    machine code of its own, once, which its callers call
    door     what Python calls

Only doors can be called from Python, and only from there.  With NUMBA_DISABLE_JIT=1 all of them are
the Python functions that they are written as.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba.core import types

from domino_env.kernels.jit.arrays import DISABLED, borrowed
from domino_env.kernels.jit.cache import know_apart, use_cache
from domino_env.kernels.jit.libraries import Apart, Door, Library, Part, compiler_into

__all__ = ["apart", "borrowed", "door", "inlined", "keep", "part"]


def door(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls."""
    return _compiled(function, Door)


def part(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, inlined where the compiler thinks best."""
    return _compiled(function, Part)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, always inlined.

    Handing a dozen arrays from function to function costs more than small functions do themselves.
    """
    return _compiled(function, Part, forceinline=True)


def apart(function: Callable[..., Any]) -> Any:
    """Compile a function once, on its own."""
    return _compiled(function, Apart)


def _compiled(function: Callable[..., Any], library: type[Library], **options: bool) -> Any:
    if DISABLED:
        return function
    njit: Any = numba.njit
    dispatcher = njit(
        nogil=True,
        error_model="numpy",
        no_cfunc_wrapper=True,
        no_cpython_wrapper=library is not Door,
        pipeline_class=compiler_into(library),
        **options,
    )(function)
    if library is not Part:
        use_cache(dispatcher)
    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda arguments, names: template(
        tuple(types.unliteral(argument) for argument in arguments), names
    )
    if library is not Door:
        _refuse_python(dispatcher)
    if library is Apart:
        know_apart(dispatcher)
    return dispatcher


def _refuse_python(dispatcher: Any) -> None:
    """A function without a wrapper for Python says so, instead of calling what is not there."""

    def refuse(*arguments: Any, **named: Any) -> None:
        raise TypeError(
            f"{dispatcher.py_func.__qualname__} is called by compiled code only: call a door of "
            "domino_env.kernels, or compile one around it"
        )

    def add_overload(result: Any) -> None:  # known to compiled callers, not to Python's
        dispatcher.overloads[tuple(result.signature.args)] = result

    dispatcher._compile_for_args = refuse
    dispatcher.add_overload = add_overload


@inlined
def keep(array: Any) -> None:
    """Hold an array up to here: what was borrowed from it, and its records, are not counted."""
