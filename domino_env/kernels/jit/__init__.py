"""Compilation of the kernels.

By default, Numba links the machine-independent code of every function into each of its callers and
optimises the result again at every level, gives each function wrappers for Python and C and a cache
file, and compiles it anew for every literal (`True`, 0) among its arguments: the first simulation
then takes three times as long.  Here a function is one of

    internal       translated once, optimised and turned into machine code only in its callers
    always_inline  an internal function that is always inlined
    noinline       compiled to machine code once, and called
    leaf           an internal function of arithmetic only, without terms that are constant zeros
    entry_point    a function that Python calls

Flat ground is uneven ground whose rise and turn are zeros known at compile time: `optional_field`
reads fields that its records do not have, and arrays that its layouts do not have are None.  So
machine code for flat ground contains no terms of uneven ground.

Python calls entry points only, and kernels do not call them.

What keeps first calls short, and what a change should not undo:

- `borrow` gives read-only arrays the type of others, so that simulations, gradients and
  environments share one compilation of each function that reads a layout.
- Passes of Numba for closures and comprehensions, which kernels do not contain, are left out, and
  the signature of an operation is looked up once per process.
- No kernel assigns an array to an array: the message for unequal shapes alone takes 2 s to compile.
  Each use of `np.zeros`, `max` or `min` with other types takes 0.03 to 0.1 s.
- Integers of records are as wide as those of kernels: a function is compiled again for others.
- Two entry points that contain the same code optimise it twice: one serves both (`step_batch`), or
  the code is `noinline` where a call takes no time beside it (`solve`). In the loops of a fall a
  call does: `add_domino` and `affine_map` on their own make simulations some 5 % slower.
- Arrays made by Python instead of `np.zeros` save 0.5 s, but a simulation of 40 dominoes takes 10 %
  longer.
- To optimise internal functions less before they are linked gains nothing.

A call that compiles for more than two seconds says so; of several processes one compiles
(`waiting`).

The compilation depends on parts of Numba that are not public (`internals`).  If Numba is newer than
`NEWEST_TESTED` or does not have one of them, functions are compiled as usual (`plain`).  If one of
them fails later, while an entry point is compiled, all functions are replaced by plain ones.
"""

import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numba
from numba.core import types

from domino_env.core.progress import advise
from domino_env.kernels.jit.interpreted import (
    NotFoundError,
    check_deadline,
    postpone_compilation,
    with_counterpart,
)
from domino_env.kernels.jit.plain import compile_plainly
from domino_env.kernels.jit.waiting import announce

NEWEST_TESTED = (0, 68)  # newest version of Numba with which the tests pass


def _internals() -> Any:
    """Import the fast compilation; return None, with advice, if this Numba may not support it."""
    if tuple(numba.version_info[:2]) <= NEWEST_TESTED:
        try:
            from domino_env.kernels.jit import internals
        except Exception as error:  # whatever a changed Numba raises
            _advise_plain(error)
            return None
        return internals
    _advise_plain(f"newer than {NEWEST_TESTED[0]}.{NEWEST_TESTED[1]}, the newest tested")
    return None


def _advise_plain(reason: str | Exception) -> None:
    """Tell the user once why public functions of Numba compile."""
    if isinstance(reason, Exception):
        reason = f"not as expected ({type(reason).__name__}: {reason})"
    advise(
        f"Numba {numba.__version__} is {reason}: the simulator is compiled by its public "
        "functions; results are the same, first calls take longer"
    )


_FAST = _internals()
_fast: dict[Any, Callable[[], Any]] = {}  # functions that compile plainly, by fast dispatcher
_plain: dict[Any, Any] = {}  # plain dispatchers, by the fast ones that they replace
_replacing = threading.Lock()


def entry_point(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls."""
    return _compile(function, "EntryPoint")


def internal(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, inlined if the optimiser decides so."""
    return _compile(function, "Internal")


def always_inline(function: Callable[..., Any]) -> Any:
    """Compile a function into its callers, always inlined.

    Passing a dozen arrays costs more than a small function itself.
    """
    return _compile(function, "Internal", forceinline=True)


def leaf(function: Callable[..., Any]) -> Any:
    """Compile a function of arithmetic only into its callers.

    The compiler replaces 0.0 times x by 0.0, and x plus 0.0 by x, so the function must not rely on
    NaN or on the sign of zero.
    """
    return _compile(function, "Internal", fastmath={"nnan", "nsz"})


def noinline(function: Callable[..., Any]) -> Any:
    """Compile a function once, on its own, for calls from compiled code.

    Its first statement should `borrow` its arrays, which the callers keep alive.
    """
    return _compile(function, "NoInline")


def compile_alone(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls and that shares no code with the kernels."""
    dispatcher = compile_plainly(function, cache=True)
    announce(dispatcher)
    return dispatcher


def _compile(function: Callable[..., Any], library: str, **options: Any) -> Any:
    is_entry = library == "EntryPoint"

    def plainly() -> Any:
        dispatcher = compile_plainly(function, cache=is_entry, **options)
        if is_entry:
            announce(dispatcher)
        return dispatcher

    if _FAST is None or _plain:
        return plainly()
    dispatcher = _FAST.compile_fast(function, getattr(_FAST, library), **options)
    _fast[dispatcher] = plainly
    if is_entry:
        announce(dispatcher)
        _replace_after_error(dispatcher)
        postpone_compilation(dispatcher)
    return dispatcher


def _replace_after_error(dispatcher: Any) -> None:
    """Make a plain dispatcher take the place of an entry point whose compilation fails."""
    compile_for: Callable[..., Any] = dispatcher._compile_for_args

    def compile_or_replace(*arguments: Any, **options: Any) -> Any:
        """Return the function that Numba calls with the arguments."""
        if not _plain:
            try:
                return compile_for(*arguments, **options)
            except NotFoundError:
                raise
            except Exception as error:  # whatever a changed Numba raises
                _replace_all(error)
        return _plain[dispatcher]

    dispatcher._compile_for_args = compile_or_replace


def _replace_all(error: Exception) -> None:
    """Replace all functions by plain ones, in the modules that refer to them."""
    with _replacing:
        if _plain:
            return
        plain = {dispatcher: plainly() for dispatcher, plainly in _fast.items()}
        modules = [vars(m) for name, m in [*sys.modules.items()] if name.startswith("domino_env.")]
        for names in (*modules, *(dispatcher.py_func.__globals__ for dispatcher in plain)):
            for name, value in [*names.items()]:
                if getattr(value, "py_func", None) and value in plain:
                    names[name] = plain[value]
        _plain.update(plain)
    _advise_plain(error)


def _borrow_in_python(value: Any) -> Any:
    check_deadline()  # here, as every fall borrows its arrays
    return value


@partial(with_counterpart, counterpart=_borrow_in_python)
@numba.extending.intrinsic
def borrow(_: Any, value: Any) -> Any:
    """Return an array or tuple of arrays without reference counts; the owners must outlive it.

    Atomic reference counting takes an eighth of the time of a step, and 5 % of that of a
    simulation. Read-only arrays get the type of those that can be written, so that one compilation
    of the functions below serves both: these must not write into arrays of a layout.
    """

    def borrowed(kind: Any) -> Any:
        if isinstance(kind, types.NamedTuple):
            return types.NamedTuple([borrowed(part) for part in kind.types], kind.instance_class)
        if isinstance(kind, types.Tuple | types.UniTuple):
            return types.Tuple([borrowed(part) for part in kind.types])
        return kind.copy(readonly=False) if isinstance(kind, types.Array) else kind

    def without_owner(context: Any, builder: Any, kind: Any, data: Any) -> Any:
        kinds: Any = kind
        if isinstance(kind, types.BaseTuple):
            parts = [
                without_owner(context, builder, part, builder.extract_value(data, i))
                for i, part in enumerate(kinds)
            ]
            return context.make_tuple(builder, kind, parts)
        if not isinstance(kind, types.Array):
            return data
        view = context.make_array(kind)(context, builder, data)
        view.meminfo = view.meminfo.type(None)
        return view._getvalue()

    def generate(context: Any, builder: Any, _: Any, args: Any) -> Any:
        return without_owner(context, builder, value, args[0])

    return borrowed(value)(value), generate


def optional_field(name: str) -> Any:
    """Return a function that reads a field of a record; 0.0 if the record has none."""

    @numba.extending.intrinsic
    def field(_: Any, record: Any) -> Any:
        def read(context: Any, builder: Any, _: Any, args: Any) -> Any:
            if name not in record.fields:
                return context.get_constant(types.float64, 0.0)
            return context.get_getattr(record, name)(context, builder, record, args[0], name)

        return types.float64(record), read

    return with_counterpart(field, lambda record: getattr(record, name, 0.0))


def has_field(name: str) -> Any:
    """Return a function that tests at compile time whether a record has a field."""

    @numba.extending.intrinsic
    def has(_: Any, record: Any) -> Any:
        def read(context: Any, *_: Any) -> Any:
            return context.get_constant(types.boolean, name in record.fields)

        return types.boolean(record), read

    return with_counterpart(has, lambda record: hasattr(record, name))


def select(array: Any, index: Any) -> Any:
    """Return array[index]; None if the array is None."""
    return None if array is None else array[index]


@numba.extending.overload(select, strict=False)
def _(array: Any, index: Any) -> Any:
    if isinstance(array, types.NoneType):
        return lambda array, index: None
    return lambda array, index: array[index]


@always_inline
def keep_alive(array: Any) -> None:
    """Keep an array alive up to this call, as borrowed views and records do not own it."""
