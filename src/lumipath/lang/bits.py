"""Bits of scalars."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from .intrinsic import FLOAT, INT, LONG, call_llvm, intrinsic


@intrinsic(lambda x: np.float32(x).view(np.int32))
def as_int(x: types.Type) -> Any:
    """The bits of a float32 as int32."""
    if x != types.float32:
        return None
    return types.int32, lambda context, builder, signature, arguments: builder.bitcast(arguments[0], INT)


@intrinsic(lambda x: np.float32(x).view(np.uint32))
def as_uint(x: types.Type) -> Any:
    """The bits of a float32 as uint32."""
    if x != types.float32:
        return None
    return types.uint32, lambda context, builder, signature, arguments: builder.bitcast(arguments[0], INT)


@intrinsic(lambda x: np.array(x).astype(np.int32).view(np.float32)[()])
def as_float(x: types.Type) -> Any:
    """The float32 that has the bits of an integer."""
    if not isinstance(x, types.Integer):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return builder.bitcast(context.cast(builder, arguments[0], x, types.int32), FLOAT)

    return types.float32, emit


@intrinsic(lambda x: np.uint32(int(f"{int(x):032b}"[::-1], 2)))
def reverse_bits(x: types.Type) -> Any:
    """A uint32 with its bits in reverse order."""
    if x != types.uint32:
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return call_llvm(builder, "llvm.bitreverse.i32", INT, [arguments[0]])

    return types.uint32, emit


@intrinsic(lambda x: (int(x) & -int(x)).bit_length() - 1)
def lowest_bit(x: types.Type) -> Any:
    """Index of the lowest set bit of an int64 that is not 0."""
    if x != types.int64:
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64, emit


@intrinsic(lambda x: int(x).bit_count())
def count_bits(x: types.Type) -> Any:
    """Number of set bits of an int64."""
    if x != types.int64:
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return call_llvm(builder, "llvm.ctpop.i64", LONG, [arguments[0]])

    return types.int64, emit
