"""How Numba compiles kernels and what calls them: kernels stay LLVM code, only what Python calls becomes machine code.

For Numba each function is a library of its own, and whatever it compiles could be called from Python: it is optimized,
made machine code and given wrappers, then inlined into its callers all the same. A kernel is only ever inlined. Its
library holds its code as it was generated, until a caller that is compiled in the end asks for it.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import InlineOverloads, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes, WithLifting

# Kernels have no closures, no expressions of whole arrays and no with statements.
_UNUSED_PASSES = (WithLifting, InlineClosureLikes, InlineOverloads, NopythonRewrites)

# Some tens of megabytes.
_OBJECTS_BETWEEN_COLLECTIONS = 100_000


def _shareable(module: Any) -> Any:
    """A copy of an LLVM module of which any number of programs may hold one."""
    copy = module.clone()
    for function in copy.functions:
        if not function.is_declaration and function.linkage == Linkage.external:
            function.linkage = "linkonce_odr"
    return copy


class KernelLibrary(JITCodeLibrary):
    """The code of one kernel, which callers inline."""

    def add_llvm_module(self, ll_module: Any) -> None:
        """Take generated code as it is."""
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        """End of additions. Code that is only compiled to find a type is never asked for, and costs no more."""
        self._finalized = True

    def _link_called(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._linking_libraries = []

    def generated(self) -> Any:
        """The kernel as it was generated, with what it calls."""
        self._link_called()
        return _shareable(self._final_module)

    def _get_module_for_linking(self) -> Any:
        """The kernel with all that it calls inlined, optimized: callers find small code that does what they need."""
        if self._shared_module is None:
            self._link_called()
            self._optimize_final_module()
            self._shared_module = _shareable(self._final_module)
        return self._shared_module

    def get_pointer_to_function(self, name: str) -> int:
        """0, which is Numba's word for a function that Python cannot call."""
        return 0

    @property
    def codegen(self) -> Any:
        """To whom Numba tells the address of the function's environment, which only exceptions need."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing; see `codegen`."""


class EntryLibrary(JITCodeLibrary):
    """A function that Python calls, with all kernels in it, as machine code."""

    def finalize(self) -> None:
        """Link, optimize and compile."""
        others = []
        for library in dict.fromkeys(self._linking_libraries):
            if isinstance(library, KernelLibrary):
                # It holds nearly everything, and would be optimized here once more.
                self._final_module.link_in(library.generated(), preserve=True)
            else:
                others.append(library)
        self._linking_libraries = others
        super().finalize()


class KernelCompiler(CompilerBase):
    """Numba's compiler for what is called from compiled code only."""

    def define_pipelines(self) -> list[PassManager]:
        """Numba's passes without those that find nothing to do in a kernel."""
        state = self.state
        state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        full = DefaultPassBuilder.define_nopython_pipeline(state)
        passes = PassManager("kernel")
        passes.passes = [item for item in full.passes if item[0] not in _UNUSED_PASSES]
        passes.finalize()
        return [passes]


@contextmanager
def rare_collections() -> Iterator[None]:
    """Let Python look for unreachable objects less often in the block; where it does not look at all, it still won't.

    A compiler makes millions of objects and keeps most of them, so that looking took a sixth of the time.
    """
    before = gc.get_threshold()
    if before[0]:
        gc.set_threshold(max(before[0], _OBJECTS_BETWEEN_COLLECTIONS), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


class EntryCompiler(CompilerBase):
    """Numba's compiler for what Python calls."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a function, and all that it calls."""
        with rare_collections():
            return super().compile_extra(func)

    def define_pipelines(self) -> list[PassManager]:
        """Numba's passes."""
        state = self.state
        state.library = EntryLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        # So that the machine code can be kept on disk.
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]
