"""Kernels over arrays: they can be called from compiled code only, so a loop around them is compiled here."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core.caching import NullCache

from lumipath.lang import entry, kernel
from lumipath.lang.kernel import compile_for


def looped(function: Any, *, outputs: int = 1, dtype: Any = np.float32, scene: bool = False) -> Any:
    """`function` of scalars as a function of arrays.

    Args:
        function: on one element of each array, by position; returns one number, or a tuple of `outputs` numbers.
        outputs: how many numbers the function returns.
        dtype: of the results.
        scene: whether a packed scene (or another thing that is not an array of numbers) comes first.

    Returns:
        A function of the scene, where there is one, and of arrays or numbers, which are broadcast. It returns an array
        of the dtype and of the shape (outputs, N), or (N,) for one output.
    """
    names = [f"x{k}" for k in range(function.__code__.co_argcount - scene)]
    head = ["scene"] if scene else []
    call = f"inner({', '.join(head + [f'{name}[i]' for name in names])})"
    store = ["out[0, i] = found"] if outputs == 1 else [f"out[{k}, i] = found[{k}]" for k in range(outputs)]
    lines = [f"def loop({', '.join(head + names + ['out'])}):", "    for i in range(out.shape[1]):"]
    lines += [f"        {line}" for line in [f"found = {call}", *store]]
    namespace = {"inner": kernel(function)}
    exec("\n".join(lines), namespace)
    dispatcher = entry(namespace["loop"])
    # The disk cache does not know the sources of tests.
    dispatcher._cache = NullCache()

    def run(*arguments: Any) -> np.ndarray:
        arrays = [_single(argument) for argument in arguments[scene:]]
        size = max((len(array) for array in arrays), default=1)
        arrays = [np.ascontiguousarray(np.broadcast_to(array, (size,))) for array in arrays]
        out = np.zeros((outputs, size), dtype)
        everything = [*arguments[:scene], *arrays, out]
        compile_for(dispatcher, *everything)
        dispatcher(*everything)
        return out[0] if outputs == 1 else out

    return run


def _single(argument: Any) -> np.ndarray:
    """At least one-dimensional, and float32 where it is float64."""
    array = np.atleast_1d(argument)
    return array.astype(np.float32) if array.dtype == np.float64 else array
