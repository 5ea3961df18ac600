"""Compiling for CUDA: PTX by Numba, machine code by the driver, both kept on disk.

Nothing here needs a GPU until a kernel is launched; `compile_ptx` works on any machine that has numba-cuda.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
from contextlib import contextmanager, suppress
from types import FunctionType
from typing import Any, NamedTuple

import numba

from .cache import announce_compiling, cache_folder
from .compiler import rare_collections
from .kernel import KernelError, explain, kernel
from .scalars import DEBUG_PYTHON
from .targets import enable_cuda
from .whole import taking_whole


class _TargetDevice:
    """Stands for a device while code for its compute capability is generated."""

    def __init__(self, capability: tuple[int, int]) -> None:
        self.compute_capability = capability


@contextmanager
def _compiling_for(capability: tuple[int, int]) -> Any:
    """Make numba-cuda believe that the current device has this compute capability."""
    from numba.cuda import dispatcher

    before = dispatcher.get_current_device
    dispatcher.get_current_device = lambda: _TargetDevice(capability)
    try:
        yield
    finally:
        dispatcher.get_current_device = before


def compile_ptx(function: FunctionType, signature: tuple[Any, ...], capability: tuple[int, int]) -> str:
    """PTX of a CUDA kernel for argument types and a compute capability such as (9, 0).

    Raises:
        KernelError: it does not compile; the message names the innermost kernel, its file and line.
    """
    enable_cuda()
    from numba import cuda
    from numba.cuda.core.errors import NumbaError

    try:
        with _compiling_for(capability), rare_collections():
            ptx, _ = cuda.compile_ptx(function, signature, cc=capability, fastmath=True)
    except (NumbaError, numba.core.errors.NumbaError) as error:
        raise KernelError(explain(function.__qualname__, str(error))) from error
    return ptx


def link_cubin(ptx: str, capability: tuple[int, int], max_registers: int) -> tuple[bytes, str]:
    """Machine code for PTX, and the assembler's report of registers, stack and spills.

    Raises:
        KernelError: the assembler refuses it.
    """
    from cuda.bindings import nvjitlink

    options = [f"-arch=sm_{capability[0]}{capability[1]}", "-verbose"]
    if max_registers:
        options.append(f"-maxrregcount={max_registers}")
    code = ptx.encode()
    try:
        handle = nvjitlink.create(len(options), options)
    except nvjitlink.nvJitLinkError as error:
        raise KernelError(
            f"this version of CUDA knows no GPU of compute capability {capability[0]}.{capability[1]} ({error}); "
            "install a newer one: pip install -U 'lumipath[cuda]'"
        ) from None
    try:
        nvjitlink.add_data(handle, nvjitlink.InputType.PTX, code, len(code), "kernel")
        nvjitlink.complete(handle)
        cubin = bytearray(nvjitlink.get_linked_cubin_size(handle))
        nvjitlink.get_linked_cubin(handle, cubin)
        report = bytearray(max(1, nvjitlink.get_info_log_size(handle)))
        nvjitlink.get_info_log(handle, report)
    except nvjitlink.nvJitLinkError as error:
        log = bytearray(max(1, nvjitlink.get_error_log_size(handle)))
        nvjitlink.get_error_log(handle, log)
        reason = " ".join(log.decode(errors="replace").split()) or str(error)
        raise KernelError(f"a kernel for sm_{capability[0]}{capability[1]} does not assemble: {reason[:300]}") from None
    finally:
        nvjitlink.destroy(handle)
    return bytes(cubin), report.decode(errors="replace").strip("\0 \n")


class Compiled(NamedTuple):
    """Machine code of a kernel, its name in it, and the assembler's report."""

    cubin: bytes
    name: str
    report: str


def _captured(function: Any) -> tuple[Any, ...]:
    """What a function, and the kernels that it calls by closure, take from where they were made."""
    python = getattr(function, "py_func", function)
    values = [cell.cell_contents for cell in python.__closure__ or ()]
    return tuple((value.__qualname__, _captured(value)) if callable(value) else repr(value) for value in values)


def compile_cubin(
    function: FunctionType, signature: tuple[Any, ...], capability: tuple[int, int], max_registers: int = 0
) -> Compiled:
    """Machine code of a CUDA kernel, from the disk if it was compiled before.

    Args:
        function: made by `cuda_entry`.
        signature: Numba types of the arguments.
        capability: as (9, 0).
        max_registers: per thread; 0: as many as the assembler likes.
    """
    from importlib.metadata import version

    from cuda.bindings import nvjitlink

    names = (
        function.__qualname__,
        _captured(function),
        str(signature),
        capability,
        max_registers,
        version("numba-cuda"),
        nvjitlink.version(),
    )
    key = hashlib.sha256(repr(names).encode()).hexdigest()[:32]
    path = cache_folder() / f"{function.__name__}-{key}.cubin"
    try:
        return Compiled(*pickle.loads(path.read_bytes()))
    except (OSError, pickle.UnpicklingError, EOFError, TypeError):
        pass
    announce_compiling()
    ptx = compile_ptx(function, signature, capability)
    found = re.search(r"\.entry\s+([\w$]+)", ptx)
    assert found, "PTX without an entry"
    cubin, report = link_cubin(ptx, capability, max_registers)
    made = Compiled(cubin, found.group(1), report)
    temporary = path.with_suffix(f".{os.getpid()}")
    # What cannot be kept is compiled anew next time.
    with suppress(OSError):
        temporary.write_bytes(pickle.dumps(tuple(made)))
        temporary.replace(path)
    return made


def cuda_entry(function: FunctionType) -> FunctionType:
    """A kernel that is launched on a GPU: float32 constants, compiled by `compile_ptx`."""
    inner = kernel(function)
    return function if DEBUG_PYTHON else taking_whole(function, inner)
