"""What becomes of a function's code, once Numba has translated it.

This rests on the inside of Numba, `numba.core.codegen`: pyproject.toml allows the versions that it
was tried with.
"""

from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen, compiler

Library = codegen.JITCodeLibrary


class Internal(Library):
    """Code that is only ever linked into others: neither optimised nor emitted."""

    def finalize(self) -> None:
        """Offer the code to those who link it."""
        self._raise_if_finalized()
        # Numba writes into this variable of each function; the rest is left to those who link it
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
        """There is no machine code."""
        self._ensure_finalized()
        return 0


class EntryPoint(Library):
    """Machine code, with all internal functions below it inside."""

    def add_linking_library(self, library: Any) -> None:
        """Add a library, and where it is internal, those that it links."""
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        if isinstance(library, Internal):
            for beneath in library._linking_libraries:
                self.add_linking_library(beneath)

    def finalize(self) -> None:
        """Link, optimise and emit."""
        self._own = {f.name for f in self._final_module.functions if not f.is_declaration}
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:  # who sees all callers may inline more
            if not function.is_declaration and function.name not in self._own:
                function.linkage = "internal"
        super()._optimize_final_module()


class NoInline(EntryPoint):
    """Machine code that callers find by its symbol: they link an empty module."""

    def _get_module_for_linking(self) -> Any:
        self._ensure_finalized()
        shared: Any = self._shared_module
        if shared is None:
            empty = self._codegen._create_empty_module(self.name)
            shared = self._shared_module = llvm.parse_assembly(str(empty))
        return shared


@cache
def compiler_into(library: type) -> type:
    """Numba's compiler, putting its code into a library of ours."""

    class Compiler(compiler.Compiler):
        def compile_extra(self, func: Any) -> Any:
            context = self.state.targetctx
            self.state.library = library(context.codegen(), func.__qualname__)
            self.state.library.enable_object_caching()
            return super().compile_extra(func)

    return Compiler
