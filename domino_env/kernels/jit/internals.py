"""Fast compilation and its cache, by parts of Numba that are not public.

This depends on `numba.core.codegen`, `compiler` and `caching`, and on how `types.BaseFunction`
finds the signature of an operation. With an untested version of Numba, `plain` compiles instead.

Numba caches machine code with a stamp of the file that contains the function.  A kernel depends on
functions and tables of other files, so kernels are cached with a stamp of all files of the folder
`kernels`: after an edit of any of them, all are compiled anew.
"""

from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import caching, codegen, compiler, types

from domino_env.kernels.jit import interpreted
from domino_env.kernels.jit.plain import STAMP
from domino_env.kernels.jit.storage import Cache
from domino_env.kernels.jit.waiting import take_turn

_DISPATCHERS: dict[str, Any] = {}  # functions that are not inlined, by name
_SYMBOLS: dict[str, tuple[str, tuple[Any, ...]]] = {}  # their symbols: name and argument types


def register_noinline(dispatcher: Any) -> None:
    """Register the symbols of a function that is not inlined, for its callers."""
    name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
    add = dispatcher.add_overload

    def add_overload(result: Any) -> None:
        add(result)
        _SYMBOLS[result.fndesc.llvm_func_name] = name, tuple(result.signature.args)

    dispatcher.add_overload = add_overload
    _DISPATCHERS[name] = dispatcher


def _define_symbol(symbol: str, name: str, arguments: tuple[Any, ...]) -> None:
    """Define the symbol by which cached callers call a function that is not inlined.

    The function has another symbol if it was compiled again after its caller was cached.
    """
    if symbol in _SYMBOLS:
        return
    dispatcher = _DISPATCHERS[name]
    dispatcher.compile(arguments)
    result = dispatcher.overloads[arguments]
    engine = result.library._codegen._engine
    llvm.add_symbol(symbol, engine.get_function_address(result.fndesc.llvm_func_name))
    _SYMBOLS[symbol] = name, arguments


class _FolderStamp:
    """Mixin for Numba's locators: the stamp of the folder instead of that of a file."""

    def get_source_stamp(self) -> bytes:
        return STAMP


_LOCATORS: Any = [
    type(f"Stamped{locator.__name__}", (_FolderStamp, locator), {})
    for locator in caching.CompileResultCacheImpl._locator_classes
]


class _ReadOnly(next(c for c in _LOCATORS if "InTree" in c.__name__)):  # type: ignore[misc]
    """Locator of machine code in the folder of the source, for one that is read-only.

    An example is a container whose image another user built.
    """

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return cls(py_func, py_file)


class _Implementation(caching.CompileResultCacheImpl):
    """Storage of machine code with the functions that it calls, which are loaded first."""

    _locator_classes: Any = [*_LOCATORS, _ReadOnly]  # noqa: RUF012 - Numba's own attribute

    def reduce(self, data: Any) -> Any:
        callees = [
            (function.name, *_SYMBOLS[function.name])
            for function in data.library._final_module.functions
            if function.is_declaration and function.name in _SYMBOLS
        ]
        return callees, super().reduce(data)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        callees, payload = payload
        for symbol, name, arguments in callees:
            _define_symbol(symbol, name, arguments)
        return super().rebuild(target_context, payload)


class _Cache(Cache):
    """Cache of machine code, into which one process at a time compiles."""

    _impl_class = _Implementation

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        result = super().load_overload(sig, target_context)
        if result is None:
            interpreted.stop_if_searching()
            if take_turn(self.cache_path):  # another process may have compiled it
                return self.load_overload(sig, target_context)
        return result


# --- Libraries of compiled code

Library = codegen.JITCodeLibrary


class Internal(Library):
    """Code that is only linked into other libraries: neither optimised nor made machine code."""

    def finalize(self) -> None:
        """Declare the variables of the code."""
        # Numba writes into this variable of each function; the code itself is linked later
        variables = [
            str(variable)
            for variable in self._final_module.global_variables
            if variable.name.startswith("_ZN08NumbaEnv")
        ]
        self._codegen._add_module(llvm.parse_assembly("\n".join(variables)))
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        return self._final_module.clone()

    def get_pointer_to_function(self, name: str) -> int:
        """Return a null pointer: there is no machine code."""
        if not self._finalized:
            self.finalize()
        return 0


class EntryPoint(Library):
    """Machine code that contains all internal functions below it."""

    def add_linking_library(self, library: Any) -> None:
        """Add a library and, if it is internal, those that it links."""
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        if isinstance(library, Internal):
            for beneath in library._linking_libraries:
                self.add_linking_library(beneath)

    def finalize(self) -> None:
        """Link and optimise the code, and make machine code of it."""
        self._own = {f.name for f in self._final_module.functions if not f.is_declaration}
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:  # internal linkage permits more inlining
            if not function.is_declaration and function.name not in self._own:
                function.linkage = "internal"
        super()._optimize_final_module()


class NoInline(EntryPoint):
    """Machine code that callers call by its symbol; they link an empty module."""

    def _get_module_for_linking(self) -> Any:
        return self.empty

    @cached_property
    def empty(self) -> Any:
        """Module without code."""
        return llvm.parse_assembly(str(self._codegen._create_empty_module(self.name)))


# --- The compiler

# Passes for what kernels do not contain: closures, context managers, array expressions and so on
UNUSED_PASSES = {
    "WithLifting", "InlineClosureLikes", "RewriteDynamicRaises", "MakeFunctionToJitFunction",
    "InlineInlinables", "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass",
    "InlineOverloads", "NopythonRewrites", "NoPythonSupportedFeatureValidation",
}  # fmt: skip

_SIGNATURES: dict[Any, Any] = {}  # of builtin operations, by operation and types of its arguments
_operations: Any = types.BaseFunction
_resolve: Callable[..., Any] = _operations.get_call_type


def _get_call_type(operation: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature of an operation; type inference and lowering ask for each many times."""
    key = operation, tuple(args)  # all constructors of named tuples have one typing key
    if key not in _SIGNATURES or kws:
        signature = _resolve(operation, context, args, kws)
        # the code of an overload depends on options of its caller
        if kws or operation.get_impl_key(signature) is not operation.typing_key:
            return signature
        _SIGNATURES[key] = signature
    return _SIGNATURES[key]


@cache
def compiler_into(library: type) -> type:
    """Return Numba's compiler, with a library of this module for its code."""

    class Compiler(compiler.Compiler):
        def compile_extra(self, func: Any) -> Any:
            context = self.state.targetctx
            self.state.library = library(context.codegen(), func.__qualname__)
            self.state.library.enable_object_caching()
            before, _operations.get_call_type = _operations.get_call_type, _get_call_type
            try:
                return super().compile_extra(func)
            finally:
                _operations.get_call_type = before

        def define_pipelines(self) -> Any:
            pipelines = super().define_pipelines()
            for pipeline in pipelines:
                pipeline.passes = [p for p in pipeline.passes if p[0].__name__ not in UNUSED_PASSES]
                pipeline.finalize()
            return pipelines

    return Compiler


def compile_fast(function: Callable[..., Any], library: type[Library], **options: Any) -> Any:
    """Compile a function into a library of this module."""
    njit: Any = numba.njit
    dispatcher = njit(
        nogil=True,
        error_model="numpy",
        no_cfunc_wrapper=True,
        no_cpython_wrapper=library is not EntryPoint,
        pipeline_class=compiler_into(library),
        **options,
    )(function)
    if library is not Internal:
        dispatcher._cache = _Cache(dispatcher.py_func)
    resolve = dispatcher.get_call_template
    template = cache(lambda arguments, names: resolve(arguments, dict(names)))
    # one compilation serves all literals of a type; type inference asks for each call many times
    dispatcher.get_call_template = lambda arguments, names: template(
        tuple(types.unliteral(argument) for argument in arguments), tuple(names.items())
    )
    if library is not EntryPoint:
        _forbid_python(dispatcher)
    if library is NoInline:
        register_noinline(dispatcher)
    return dispatcher


def _forbid_python(dispatcher: Any) -> None:
    """Make a function without a wrapper for Python raise when Python calls it."""

    def raise_error(*arguments: Any, **options: Any) -> None:
        raise TypeError(
            f"{dispatcher.py_func.__qualname__} can be called by compiled code only: call an entry "
            "point of domino_env.kernels, or compile one around it"
        )

    def add_overload(result: Any) -> None:  # for compiled callers only
        dispatcher.overloads[tuple(result.signature.args)] = result

    dispatcher._compile_for_args = raise_error
    dispatcher.add_overload = add_overload
