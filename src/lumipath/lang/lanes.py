"""SIMD values for the CPU: `Lanes(float32, 8)` is LLVM's <8 x float> as a Numba type.

The vectors are plain LLVM vectors, so one source serves AVX-512, AVX2 and NEON. Operators (+ - * / comparisons & | ^ ~)
take lanes or scalars; a scalar is broadcast. Everything infers its width from its arguments; only `Simd(width)` has to
be told. In plain Python lanes are NumPy arrays.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.datamodel import models
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, register_model

from .intrinsic import FLOAT, INT, LONG, call_llvm, intrinsic
from .memory import element_pointer

_ELEMENTS = {types.float32: FLOAT, types.int32: INT, types.boolean: ir.IntType(1)}
_SCALARS = (types.Float, types.Integer)


class Lanes(types.Type):
    """`width` scalars of the type `element` in one value."""

    def __init__(self, element: types.Type, width: int) -> None:
        self.element, self.width = element, width
        super().__init__(name=f"{element}x{width}")

    @property
    def llvm(self) -> ir.VectorType:
        """The LLVM type."""
        return ir.VectorType(_ELEMENTS[self.element], self.width)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        super().__init__(manager, kind, kind.llvm)


def _indices(values: list[int]) -> ir.Constant:
    return ir.Constant(ir.VectorType(INT, len(values)), values)


def _undefined(kind: ir.Type) -> ir.Constant:
    return ir.Constant(kind, ir.Undefined)


def _widen(context: Any, builder: ir.IRBuilder, value: ir.Value, kind: types.Type, lanes: Lanes) -> ir.Value:
    """`value` as `lanes`: broadcast if it is a scalar."""
    if isinstance(kind, Lanes):
        return value
    scalar = context.cast(builder, value, kind, lanes.element)
    first = builder.insert_element(_undefined(lanes.llvm), scalar, ir.Constant(INT, 0))
    return builder.shuffle_vector(first, _undefined(lanes.llvm), _indices([0] * lanes.width))


def _lanes_among(kinds: tuple[types.Type, ...]) -> Lanes | None:
    """The lanes type if at least one of `kinds` is lanes and all others fit it."""
    lanes = next((kind for kind in kinds if isinstance(kind, Lanes)), None)
    if lanes is None or not all(kind == lanes or isinstance(kind, _SCALARS) for kind in kinds):
        return None
    return lanes


# ---- operators ------------------------------------------------------------------------------------------------------

Emit = Callable[[ir.IRBuilder, bool, ir.Value, ir.Value], ir.Value]


def _operator(
    operation: Any, emit: Emit, *, compares: bool = False, elements: Any = (types.float32, types.int32)
) -> None:
    class Rule(AbstractTemplate):
        key = operation

        def generic(self, arguments: Any, keywords: Any) -> Any:
            lanes = _lanes_among(arguments) if len(arguments) == 2 else None
            if lanes is None or lanes.element not in elements:
                return None
            return signature(Lanes(types.boolean, lanes.width) if compares else lanes, *arguments)

    infer_global(operation, types.Function(Rule))

    def lower(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        lanes = _lanes_among(call.args)
        left, right = (_widen(context, builder, value, kind, lanes) for value, kind in zip(arguments, call.args))
        return emit(builder, lanes.element == types.float32, left, right)

    pairs = [(Lanes, Lanes)] + [pair for scalar in _SCALARS for pair in ((Lanes, scalar), (scalar, Lanes))]
    for pair in pairs:
        lower_builtin(operation, *pair)(lower)


_operator(operator.add, lambda b, is_float, x, y: b.fadd(x, y) if is_float else b.add(x, y))
_operator(operator.sub, lambda b, is_float, x, y: b.fsub(x, y) if is_float else b.sub(x, y))
_operator(operator.mul, lambda b, is_float, x, y: b.fmul(x, y) if is_float else b.mul(x, y))
_operator(operator.truediv, lambda b, is_float, x, y: b.fdiv(x, y), elements=(types.float32,))
_LOGICAL = (types.boolean, types.int32)
_operator(operator.and_, lambda b, is_float, x, y: b.and_(x, y), elements=_LOGICAL)
_operator(operator.or_, lambda b, is_float, x, y: b.or_(x, y), elements=_LOGICAL)
_operator(operator.xor, lambda b, is_float, x, y: b.xor(x, y), elements=_LOGICAL)
for _operation, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _operator(
        _operation,
        lambda b, is_float, x, y, s=_symbol: b.fcmp_ordered(s, x, y) if is_float else b.icmp_signed(s, x, y),  # type: ignore[misc]
        compares=True,
    )


class _Invert(AbstractTemplate):
    key = operator.invert

    def generic(self, arguments: Any, keywords: Any) -> Any:
        return signature(arguments[0], *arguments) if isinstance(arguments[0], Lanes) else None


infer_global(operator.invert, types.Function(_Invert))
lower_builtin(operator.invert, Lanes)(lambda context, builder, call, arguments: builder.not_(arguments[0]))


# ---- functions ------------------------------------------------------------------------------------------------------


def _extreme(name: str, symbol: str, python: Any) -> Any:
    def rule(x: types.Type, y: types.Type) -> Any:
        lanes = _lanes_among((x, y))
        if lanes is None or lanes.element != types.float32:
            return None

        def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
            left, right = (_widen(context, builder, v, k, lanes) for v, k in zip(arguments, call.args))
            # Exactly x86's instruction: the second operand where either is NaN.
            return builder.select(builder.fcmp_ordered(symbol, left, right), left, right)

        return lanes, emit

    rule.__name__ = rule.__qualname__ = name
    rule.__doc__ = f"Lane by lane: x where x {symbol} y, else y."
    return intrinsic(python)(rule)


vmin = _extreme("vmin", "<", lambda x, y: np.where(x < y, x, y).astype(np.float32))
vmax = _extreme("vmax", ">", lambda x, y: np.where(x > y, x, y).astype(np.float32))


def _select_python(mask: Any, x: Any, y: Any) -> Any:
    kind = next(np.asarray(v).dtype for v in (x, y) if np.ndim(v))
    return np.where(mask, x, y).astype(kind)


@intrinsic(_select_python)
def select(mask: types.Type, x: types.Type, y: types.Type) -> Any:
    """Lane by lane: x where mask, else y."""
    lanes = _lanes_among((x, y))
    if lanes is None or not isinstance(mask, Lanes):
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        values = [_widen(context, builder, v, k, lanes) for v, k in zip(arguments[1:], call.args[1:])]
        return builder.select(arguments[0], *values)

    return lanes, emit


@intrinsic(lambda x, y, z: (np.asarray(x, np.float64) * y + z).astype(np.float32))
def fused(x: types.Type, y: types.Type, z: types.Type) -> Any:
    """Lane by lane x * y + z with one rounding, whatever the caller's floating-point mode."""
    lanes = _lanes_among((x, y, z))
    if lanes is None or lanes.element != types.float32:
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        values = [_widen(context, builder, v, k, lanes) for v, k in zip(arguments, call.args)]
        return call_llvm(builder, f"llvm.fma.v{lanes.width}f32", lanes.llvm, values)

    return lanes, emit


@intrinsic(lambda v: v.view(np.int32))
def bits_of_lanes(v: types.Type) -> Any:
    """The bits of float32 lanes as int32 lanes."""
    if not isinstance(v, Lanes):
        return None
    lanes = Lanes(types.int32, v.width)
    return lanes, lambda context, builder, call, arguments: builder.bitcast(arguments[0], lanes.llvm)


@intrinsic(lambda mask: int(sum(1 << k for k, on in enumerate(mask) if on)))
def bits(mask: types.Type) -> Any:
    """A mask as an int64: lane k in bit k."""
    if not isinstance(mask, Lanes) or mask.element != types.boolean:
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        return builder.zext(builder.bitcast(arguments[0], ir.IntType(mask.width)), LONG)

    return types.int64, emit


@intrinsic(lambda v: v.min())
def smallest(v: types.Type) -> Any:
    """The smallest lane."""
    if not isinstance(v, Lanes):
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        value, width = arguments[0], v.width
        while width > 1:
            width //= 2
            halves = [
                builder.shuffle_vector(value, _undefined(value.type), _indices(list(range(start, start + width))))
                for start in (0, width)
            ]
            value = builder.select(builder.fcmp_ordered("<", *halves), *halves)
        return builder.extract_element(value, ir.Constant(INT, 0))

    return v.element, emit


@intrinsic(lambda v, k: v[k])
def lane(v: types.Type, k: types.Type) -> Any:
    """Lane k of v."""
    if not isinstance(v, Lanes):
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        return builder.extract_element(arguments[0], context.cast(builder, arguments[1], k, types.int32))

    return v.element, emit


def _store_python(array: Any, i: int, v: Any) -> None:
    array.reshape(-1)[i : i + len(v)] = v


@intrinsic(_store_python)
def store_lanes(array: types.Type, i: types.Type, v: types.Type) -> Any:
    """`array.flat[i : i + width] = v`, at any alignment."""
    if not isinstance(v, Lanes):
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> None:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        builder.store(arguments[2], builder.bitcast(pointer, v.llvm.as_pointer()), align=4)

    return types.none, emit


@intrinsic(lambda array, index: array.reshape(-1)[index])
def gather(array: types.Type, index: types.Type) -> Any:
    """Lanes `array.flat[index[k]]`; every index must be valid."""
    if not isinstance(index, Lanes):
        return None
    lanes = Lanes(array.dtype, index.width)

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        result = _undefined(lanes.llvm)
        for k in range(index.width):
            position = builder.extract_element(arguments[1], ir.Constant(INT, k))
            pointer = element_pointer(context, builder, array, arguments[0], position, types.int32)
            result = builder.insert_element(result, builder.load(pointer), ir.Constant(INT, k))
        return result

    return lanes, emit


@intrinsic(lambda v, index: v[index])
def permute(v: types.Type, index: types.Type) -> Any:
    """Lane k of the result is v[index[k]]."""
    if not (isinstance(v, Lanes) and isinstance(index, Lanes)):
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        value, order = arguments
        if v.width == 8 and v.element == types.float32 and "+avx2" in context.codegen()._tm_features.split(","):
            return call_llvm(builder, "llvm.x86.avx2.permps", value.type, [value, order])
        result = _undefined(value.type)
        for k in range(v.width):
            source = builder.extract_element(order, ir.Constant(INT, k))
            result = builder.insert_element(result, builder.extract_element(value, source), ir.Constant(INT, k))
        return result

    return v, emit


def _compress_python(v: Any, mask: Any) -> Any:
    result = np.zeros_like(v)
    result[: int(mask.sum())] = v[mask]
    return result


@intrinsic(_compress_python)
def compress(v: types.Type, mask: types.Type) -> Any:
    """The lanes of v where mask, moved to the front; the others are undefined."""
    if not isinstance(v, Lanes):
        return None

    def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
        suffix = "f32" if v.element == types.float32 else "i32"
        name = f"llvm.experimental.vector.compress.v{v.width}{suffix}"
        return call_llvm(builder, name, v.llvm, [*arguments, _undefined(v.llvm)])

    return v, emit


class Simd:
    """The operations that must be told the width: `load(array, i)`, `splat(x)`, `index()`."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.load = self._load()
        self.splat = self._splat()
        self.index = self._index()

    def _load(self) -> Any:
        width = self.width

        @intrinsic(lambda array, i: array.reshape(-1)[i : i + width].copy())
        def load_lanes(array: types.Type, i: types.Type) -> Any:
            """Lanes `array.flat[i : i + width]`, at any alignment."""
            lanes = Lanes(array.dtype, width)

            def emit(context: Any, builder: ir.IRBuilder, call: Any, arguments: Any) -> ir.Value:
                pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
                return builder.load(builder.bitcast(pointer, lanes.llvm.as_pointer()), align=4)

            return lanes, emit

        return load_lanes

    def _splat(self) -> Any:
        width = self.width
        kept = {np.dtype(np.float32), np.dtype(np.int32), np.dtype(bool)}

        def python(x: Any) -> Any:
            kind = np.asarray(x).dtype
            return np.full(width, x, kind if kind in kept else np.int32)

        @intrinsic(python)
        def splat(x: types.Type) -> Any:
            """Lanes that are all x."""
            lanes = Lanes(types.int32 if x == types.int64 else x, width)
            return lanes, lambda context, builder, call, arguments: _widen(context, builder, arguments[0], x, lanes)

        return splat

    def _index(self) -> Any:
        width = self.width

        @intrinsic(lambda: np.arange(width, dtype=np.int32))
        def index() -> Any:
            """0, 1, 2, ... as int32 lanes."""
            return Lanes(types.int32, width), lambda context, builder, call, arguments: _indices(list(range(width)))

        return index
