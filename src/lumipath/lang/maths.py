"""Arithmetic for which a device has its own instruction."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from .intrinsic import FLOAT, call_llvm, intrinsic


def is_gpu(context: Any) -> bool:
    """Whether code is being generated for CUDA."""
    return type(context).__name__ == "CUDATargetContext"


@intrinsic(lambda x: np.float32(1) / np.float32(x))
def approximate_reciprocal(x: types.Type) -> Any:
    """1 / x: exact on the CPU, within 1 ulp and one instruction on the GPU (denormals become 0)."""
    if not isinstance(x, (types.Float, types.Integer)):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        value = context.cast(builder, arguments[0], x, types.float32)
        if is_gpu(context):
            kind = ir.FunctionType(FLOAT, [FLOAT])
            return builder.call(ir.InlineAsm(kind, "rcp.approx.ftz.f32 $0, $1;", "=f,f", False), [value])
        return builder.fdiv(ir.Constant(FLOAT, 1.0), value)

    return types.float32, emit


inverse = approximate_reciprocal


@intrinsic(lambda x: np.sqrt(np.float32(x)))
def sqrt(x: types.Type) -> Any:
    """Square root of a float32, NaN below 0: one instruction, where Numba's own calls the C library to set errno."""
    if not isinstance(x, (types.Float, types.Integer)):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        value = context.cast(builder, arguments[0], x, types.float32)
        return call_llvm(builder, "llvm.sqrt.f32", FLOAT, [value])

    return types.float32, emit
