"""Kernels that are called, not inlined."""

from __future__ import annotations

from typing import Any

from numba import types

from .intrinsic import intrinsic


@intrinsic(lambda: None)
def called_not_inlined() -> Any:
    """As the first statement of a kernel: one copy of its code serves all places that need it.

    For long kernels which many places need: a GPU whose instructions do not fit into their cache waits for them most of
    the time.
    """

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        attributes = builder.function.attributes
        attributes.discard("alwaysinline")
        attributes.add("noinline")

    return types.none, emit
