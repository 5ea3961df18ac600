"""Vec3: three float32 with componentwise arithmetic."""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types

from .scalars import f32
from .struct import struct
from .targets import Target, on_each_target

FLOAT = ir.FloatType()


@struct
class Vec3:
    """A point, a direction or a colour."""

    x: f32
    y: f32
    z: f32

    def __add__(self, other: Vec3) -> Vec3:
        return Vec3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vec3) -> Vec3:
        return Vec3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, other: Any) -> Vec3:
        if isinstance(other, Vec3):
            return Vec3(self.x * other.x, self.y * other.y, self.z * other.z)
        return Vec3(self.x * other, self.y * other, self.z * other)

    def __rmul__(self, other: Any) -> Vec3:
        return self * other

    def __truediv__(self, other: Any) -> Vec3:
        if isinstance(other, Vec3):
            return Vec3(self.x / other.x, self.y / other.y, self.z / other.z)
        return Vec3(self.x / other, self.y / other, self.z / other)

    def __neg__(self) -> Vec3:
        return Vec3(-self.x, -self.y, -self.z)


VEC3 = Vec3.numba_type
_SCALARS = (types.float32, types.int64, types.int32)


def _install_operator(target: Target, operation: Any, instruction: str, pairs: list[tuple[Any, Any]]) -> None:
    signature = target.templates.signature
    cases = [signature(VEC3, *pair) for pair in pairs]
    target.templates.infer_global(operation)(
        type(f"Vec3_{operation.__name__}", (target.templates.ConcreteTemplate,), {"cases": cases})
    )

    def lower(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        def component(position: int, axis: int) -> ir.Value:
            if call.args[position] == VEC3:
                return builder.extract_value(arguments[position], axis)
            return context.cast(builder, arguments[position], call.args[position], types.float32)

        result = ir.Constant(context.get_value_type(VEC3), ir.Undefined)
        for axis in range(3):
            value = getattr(builder, instruction)(component(0, axis), component(1, axis))
            result = builder.insert_value(result, value, axis)
        return result

    for pair in pairs:
        target.extending.lower_builtin(operation, *pair)(lower)


@on_each_target
def _install_arithmetic(target: Target) -> None:
    alike = [(VEC3, VEC3)]
    mixed = [pair for scalar in _SCALARS for pair in ((VEC3, scalar), (scalar, VEC3))]
    scaled = [(VEC3, scalar) for scalar in _SCALARS]
    _install_operator(target, operator.add, "fadd", alike)
    _install_operator(target, operator.sub, "fsub", alike)
    _install_operator(target, operator.mul, "fmul", alike + mixed)
    _install_operator(target, operator.truediv, "fdiv", alike + scaled)
    _install_operator(target, operator.iadd, "fadd", alike)
    _install_operator(target, operator.isub, "fsub", alike)
    _install_operator(target, operator.imul, "fmul", alike + scaled)

    class Negate(target.templates.ConcreteTemplate):
        cases = (target.templates.signature(VEC3, VEC3),)

    target.templates.infer_global(operator.neg)(Negate)

    @target.extending.lower_builtin(operator.neg, VEC3)
    def negate(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        result = ir.Constant(context.get_value_type(VEC3), ir.Undefined)
        for axis in range(3):
            # Not fneg: NVVM's dialect for older GPUs has no such instruction.
            value = builder.fsub(ir.Constant(FLOAT, -0.0), builder.extract_value(arguments[0], axis))
            result = builder.insert_value(result, value, axis)
        return result
