"""How everything in this folder is compiled.

Left alone, Numba links the machine-independent code of every function into each of its callers and
optimises the whole again, layer by layer, gives each function wrappers for Python and C and a cache
file, and compiles it anew for every literal (`True`, 0) that it is called with: the first wave then
waits three times as long.  Here a function is one of

    part     of its callers: translated once, optimised and turned into machine code only there
    inlined  a part that its callers never call
    apart    machine code of its own, once, which its callers call
    door     what Python calls

A part that `varies` has a second one for rows over hills, made known by `on_hills`.  Which of them
is called, the types of the arguments say: rows, links and shapes over hills have fields `rise…`. So
what flat ground runs knows nothing of hills, and who stays there does not wait for their machine
code.

Only doors can be called from Python, and only from there.  With NUMBA_DISABLE_JIT=1 all of them are
the Python functions that they are written as.
"""

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any

import numba
from numba.core import types

from domino_env.kernels.jit.arrays import DISABLED, borrowed
from domino_env.kernels.jit.cache import know_apart, use_cache
from domino_env.kernels.jit.libraries import Apart, Door, Library, Part, compiler_into

__all__ = ["apart", "borrowed", "door", "inlined", "keep", "on_hills", "part", "varies"]


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


def varies(flat: Any) -> Any:
    """Let `on_hills` replace a part where its arguments are of a row over hills."""
    if DISABLED:

        @wraps(flat)
        def either(*arguments: Any) -> Any:
            over = any(_knows_hills(argument) for argument in arguments)
            return (either.hills if over else flat)(*arguments)  # type: ignore[attr-defined]

        return either
    template, overload = flat.get_call_template, flat.get_overload

    def choose(arguments: Iterable[Any]) -> bool:
        return any(_knows_hills(argument) for argument in arguments)

    flat.get_call_template = lambda arguments, names: (
        flat.hills.get_call_template if choose(arguments) else template
    )(arguments, names)
    flat.get_overload = lambda arguments: (
        flat.hills.get_overload if choose(arguments) else overload
    )(arguments)
    return flat


def on_hills(flat: Any) -> Callable[[Any], Any]:
    """Make known what a part that varies is replaced by, over hills."""

    def register(hills: Any) -> Any:
        flat.hills = hills
        return hills

    return register


def _knows_hills(value: Any) -> bool:
    """Whether a value, or a type of Numba's, has a field of hills."""
    for owner in (value, getattr(value, "dtype", None)):
        for names in ("_fields", "fields", "names"):
            if any(name.startswith("rise") for name in getattr(owner, names, None) or ()):
                return True
    return False


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
