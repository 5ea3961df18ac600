"""Decorators that turn Python functions into machine code."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any

import numba
import numpy as np
from numba.core import errors as numba_errors
from numba.extending import overload

from ..errors import RenderError
from .cache import enable_cache
from .compiler import EntryCompiler, KernelCompiler
from .features import select_by_features
from .scalars import DEBUG_PYTHON
from .whole import taking_whole

# No nnan and no ninf: infinite distances are in use, and NaN must fail every comparison.
_FASTMATH = frozenset({"nsz", "arcp", "contract", "afn", "reassoc"})
_OPTIONS = {"nogil": True, "error_model": "numpy", "boundscheck": False}
# Reference counts on the arrays of a scene cost more than half of the speed, and kernels allocate nothing.
_KERNEL_OPTIONS = _OPTIONS | {"_nrt": False}
# What only Numba's CPU target knows: of functions that compiled code calls, and of those that Python calls.
_INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": KernelCompiler}
_OUTER = {"no_cfunc_wrapper": True, "pipeline_class": EntryCompiler}


class KernelError(RenderError):
    """A kernel does not compile; the message names the kernel, file and line."""


def _single_precision_constants(code: CodeType) -> CodeType:
    """The code with every float constant as float32: Numba takes Python's floats for float64."""

    def convert(constant: Any) -> Any:
        if type(constant) is float:
            return np.float32(constant)
        if type(constant) is tuple:
            return tuple(convert(item) for item in constant)
        if isinstance(constant, CodeType):
            return _single_precision_constants(constant)
        return constant

    return code.replace(co_consts=tuple(convert(constant) for constant in code.co_consts))


def single_precision(function: FunctionType) -> FunctionType:
    """`function` with float32 constants; a float64 among the globals that it names is an error."""
    for name in function.__code__.co_names:
        if type(function.__globals__.get(name)) is float:
            code = function.__code__
            raise KernelError(
                f"kernel {function.__qualname__} ({code.co_filename}:{code.co_firstlineno}) uses the float64 {name}; "
                f"write {name} = f32(...)"
            )
    function.__code__ = _single_precision_constants(function.__code__)
    return function


def kernel(function: Any = None, *, precise: bool = False, needs: int = 0, otherwise: Any = None) -> Any:
    """A device function: inlined into whatever calls it, on every device.

    Args:
        function: plain Python on scalars, structs, Vec3 and packed arrays.
        precise: keep every rounding as written (no contraction to fused multiply-add, no reassociation).
        needs: feature bits; where the first argument's scene lacks them all, `otherwise` is compiled in place of
            `function`, so that what a scene does not use costs nothing, not even compile time.
        otherwise: kernel of the same parameters, used with `needs`.
    """
    if function is None:
        return lambda given: kernel(given, precise=precise, needs=needs, otherwise=otherwise)
    single_precision(function)
    if needs:
        return select_by_features(function, needs, otherwise, _overload_options(precise), _INNER)
    if DEBUG_PYTHON:
        return function
    return numba.njit(**_overload_options(precise), **_INNER)(function)


def _overload_options(precise: bool) -> dict[str, Any]:
    return _KERNEL_OPTIONS | {"forceinline": True, "fastmath": False if precise else set(_FASTMATH)}


def entry(function: Any) -> Callable[..., Any]:
    """A function that worker threads call without holding Python's lock: kept on disk once compiled."""
    inner = kernel(function)
    if DEBUG_PYTHON:
        return function
    dispatcher = numba.njit(**_KERNEL_OPTIONS, **_OUTER, fastmath=set(_FASTMATH))(taking_whole(function, inner))
    enable_cache(dispatcher, function)
    return dispatcher


def compiled(function: Any) -> Callable[..., Any]:
    """Host code that is worth compiling (tree building): exact arithmetic, arrays may be allocated, kept on disk.

    Python calls it, and so do other such functions, which take it in like a kernel. Its `dispatcher` is Numba's.
    """
    if DEBUG_PYTHON:
        return function
    dispatcher = numba.njit(**_OPTIONS, **_OUTER)(function)
    enable_cache(dispatcher, function)

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        return dispatcher(*arguments)

    # Without this, Numba would look through to the function.
    del call.__wrapped__  # type: ignore[attr-defined]
    call.dispatcher = dispatcher  # type: ignore[attr-defined]
    overload(call, jit_options=_OPTIONS | _INNER, strict=False)(lambda *arguments: function)
    return call


def compile_for(function: Callable[..., Any], *arguments: Any) -> None:
    """Compile an `entry` for the types of `arguments`, or load it from the disk.

    Raises:
        KernelError: it does not compile; the message names the innermost kernel, its file and line.
    """
    if DEBUG_PYTHON:
        return
    dispatcher: Any = function
    signature = tuple(numba.typeof(argument) for argument in arguments)
    try:
        dispatcher.compile(signature)
    except numba_errors.NumbaError as error:
        raise KernelError(explain(dispatcher.py_func.__qualname__, str(error))) from error


def explain(name: str, message: str) -> str:
    """One line from Numba's many: the innermost place, which comes first, and the sentence that precedes it."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", message)
    found = re.search(r'^\s*File "([^"]+)", line (\d+):$', plain, re.M)
    before = [line.strip() for line in plain[: found.start() if found else None].splitlines() if line.strip()]
    noise = r"(Failed in|During:|There are|- Of|Overload|With argument|No match|Rejected|>>>)"
    reason = next((line for line in reversed(before) if not re.match(noise, line)), "unknown")
    if not found:
        return f"kernel {name} does not compile: {reason}"
    innermost = re.search(r"^\s*def (\w+)", plain[found.end() :], re.M)
    return f"kernel {innermost[1] if innermost else name} does not compile at {found[1]}:{found[2]}: {reason}"
