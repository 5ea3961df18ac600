"""Arithmetic for which a device has its own instruction."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from .intrinsic import FLOAT, INT, call_llvm, intrinsic


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
    """Square root of a float32, NaN below 0: one instruction, where Numba's own calls the C library to set errno.

    On the GPU within 1 ulp, and denormals become 0.
    """
    if not isinstance(x, (types.Float, types.Integer)):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        value = context.cast(builder, arguments[0], x, types.float32)
        if is_gpu(context):
            kind = ir.FunctionType(FLOAT, [FLOAT])
            return builder.call(ir.InlineAsm(kind, "sqrt.approx.ftz.f32 $0, $1;", "=f,f", False), [value])
        return call_llvm(builder, "llvm.sqrt.f32", FLOAT, [value])

    return types.float32, emit


def _exact(name: str, python: Any, instruction: str, ptx: str, symbol: str) -> Any:
    def rule(x: types.Type, y: types.Type) -> Any:
        def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
            values = [context.cast(builder, v, k, types.float32) for v, k in zip(arguments, signature.args)]
            if is_gpu(context):
                # With its rounding written out, PTX is never fused.
                kind = ir.FunctionType(FLOAT, [FLOAT, FLOAT])
                return builder.call(ir.InlineAsm(kind, f"{ptx} $0, $1, $2;", "=f,f,f", False), values)
            return getattr(builder, instruction)(*values)

        return types.float32, emit

    rule.__name__ = rule.__qualname__ = name
    rule.__doc__ = (
        f"x {symbol} y, rounded once and never fused or reordered, whatever the caller's floating-point mode."
    )
    return intrinsic(python)(rule)


exact_add = _exact("exact_add", lambda x, y: np.float32(x) + np.float32(y), "fadd", "add.rn.f32", "+")
exact_sub = _exact("exact_sub", lambda x, y: np.float32(x) - np.float32(y), "fsub", "sub.rn.f32", "-")
exact_mul = _exact("exact_mul", lambda x, y: np.float32(x) * np.float32(y), "fmul", "mul.rn.f32", "times")


def _byte_lane(j: int) -> Any:
    def rule(word: types.Type) -> Any:
        def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
            one = ir.Constant(INT, 0x3F800000)
            if is_gpu(context):
                # One byte permutation puts the byte into the mantissa of 1.
                kind = ir.FunctionType(INT, [INT, INT])
                code = f"prmt.b32 $0, $1, $2, {0x7604 | (j << 4)};"
                bits = builder.call(ir.InlineAsm(kind, code, "=r,r,r", False), [arguments[0], one])
            else:
                byte = builder.and_(builder.lshr(arguments[0], ir.Constant(INT, 8 * j)), ir.Constant(INT, 255))
                bits = builder.or_(builder.shl(byte, ir.Constant(INT, 8)), one)
            return builder.bitcast(bits, FLOAT)

        return types.float32, emit

    rule.__name__ = rule.__qualname__ = f"byte{j}"
    rule.__doc__ = f"1 + b / 32768 as float32, b being byte {j} of a 32-bit word."
    return intrinsic(lambda word: np.float32(1 + ((int(word) >> (8 * j)) & 255) / 32768))(rule)


byte0, byte1, byte2, byte3 = (_byte_lane(j) for j in range(4))
