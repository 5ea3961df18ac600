"""How Numba compiles kernels and what calls them: kernels stop at LLVM code, entries bring it all together once.

For Numba each function is a library of its own: it is optimized with all that it calls inlined, becomes machine code,
and the same begins again for its caller. A kernel is only ever inlined, so that all of this but the entry's turn is
thrown away. Here a kernel's library holds its code as it was generated, and the optimizer sees the whole program once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import InlineOverloads, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes, WithLifting

# Kernels have no closures, no expressions of whole arrays and no with statements.
_UNUSED_PASSES = (WithLifting, InlineClosureLikes, InlineOverloads, NopythonRewrites)


def _parts(library: JITCodeLibrary) -> Iterator[CodeLibrary]:
    """What `library` calls: kernels, what these call in their turn, and other libraries, each of which is complete."""
    for called in library._linking_libraries:
        yield called
        if isinstance(called, KernelLibrary):
            yield from _parts(called)


def _link_kernels(module: Any, library: JITCodeLibrary) -> list[CodeLibrary]:
    """Add the code of all kernels that `library` calls to `module`; returns the other libraries."""
    others = []
    for part in dict.fromkeys(_parts(library)):
        if isinstance(part, KernelLibrary):
            module.link_in(part._final_module, preserve=True)
        else:
            others.append(part)
    return others


class KernelLibrary(JITCodeLibrary):
    """The code of one kernel as it was generated: not optimized, without what it calls, never made machine code."""

    def add_llvm_module(self, ll_module: Any) -> None:
        """Take generated code as it is."""
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        """End of additions."""
        for function in self._final_module.functions:
            if not function.is_declaration:
                # Any number of entries may hold a copy.
                function.linkage = "linkonce_odr"
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """The kernel with all that it calls, for a caller that is no entry of ours."""
        if self._shared_module is None:
            whole = self._final_module.clone()
            for other in _link_kernels(whole, self):
                whole.link_in(other._get_module_for_linking(), preserve=True)
            self._shared_module = whole
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
    """A function that Python calls, and all kernels that it calls: optimized once, then made machine code."""

    def finalize(self) -> None:
        """Link, optimize and compile."""
        self._linking_libraries = _link_kernels(self._final_module, self)
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


class EntryCompiler(CompilerBase):
    """Numba's compiler for what Python calls."""

    def define_pipelines(self) -> list[PassManager]:
        """Numba's passes."""
        state = self.state
        state.library = EntryLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        # So that the machine code can be kept on disk.
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]
