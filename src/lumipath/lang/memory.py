"""Reading and writing packed arrays: no bounds checks, no wrap-around, 128-bit loads, small arrays on the stack."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from .intrinsic import FLOAT, INT, LONG, call_llvm, intrinsic
from .maths import is_gpu
from .scalars import f32, i32

ALIGNMENT = 64
"""Bytes; a cache line, and enough for every vector load."""


def aligned_empty(shape: int | tuple[int, ...], dtype: Any) -> np.ndarray:
    """An uninitialised array that starts at a cache line."""
    count = int(np.prod(shape))
    nbytes = count * np.dtype(dtype).itemsize
    buffer = np.empty(nbytes + ALIGNMENT, np.uint8)
    start = -buffer.ctypes.data % ALIGNMENT
    return buffer[start : start + nbytes].view(dtype).reshape(shape)


def aligned(array: np.ndarray) -> np.ndarray:
    """A copy of `array` that starts at a cache line and is at least one element long."""
    source = array if array.size else np.zeros((1, *array.shape[1:]), array.dtype)
    copy = aligned_empty(source.shape, source.dtype)
    copy[...] = source
    return copy


def element_pointer(
    context: Any, builder: ir.IRBuilder, kind: types.Type, array: Any, index: Any, index_type: Any
) -> Any:
    """Address of `array.flat[index]`; `array` is a contiguous array or a stack array."""
    data = array if isinstance(kind, types.CPointer) else context.make_array(kind)(context, builder, array).data
    return builder.gep(data, [context.cast(builder, index, index_type, types.intp)])


@intrinsic(lambda array: _flat(array))
def start_of(array: types.Type) -> Any:
    """Where an array begins: all that `load` and `load4` need of it, for kernels that are called and not inlined."""
    if not isinstance(array, types.Array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return context.make_array(array)(context, builder, arguments[0]).data

    return types.CPointer(array.dtype), emit


def _is_memory(kind: types.Type) -> bool:
    return isinstance(kind, (types.Array, types.CPointer))


def _flat(array: Any) -> Any:
    return array.reshape(-1) if isinstance(array, np.ndarray) else array


@intrinsic(lambda array, i: _flat(array)[i])
def load(array: types.Type, i: types.Type) -> Any:
    """`array.flat[i]`."""
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        value = builder.load(element_pointer(context, builder, array, arguments[0], arguments[1], i))
        if not is_gpu(context):
            value.set_metadata("noalias", _results_scope(builder))
        return value

    return array.dtype, emit


def _results_scope(builder: ir.IRBuilder) -> Any:
    """LLVM's word for all memory that is written by `store_result`."""
    module = builder.module
    scope = module.add_metadata(["results", module.add_metadata(["lumipath"])])
    return module.add_metadata([scope])


def _store_python(array: Any, i: Any, value: Any) -> None:
    _flat(array)[i] = value


@intrinsic(_store_python)
def store(array: types.Type, i: types.Type, value: types.Type) -> Any:
    """`array.flat[i] = value`."""
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> None:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        builder.store(context.cast(builder, arguments[2], value, array.dtype), pointer)

    return types.none, emit


get, put = load, store
"""The same, for arrays on the stack."""


@intrinsic(lambda array, i: _flat(array)[i])
def load_result(array: types.Type, i: types.Type) -> Any:
    """`array.flat[i]` of memory that `store_result` writes."""
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return builder.load(element_pointer(context, builder, array, arguments[0], arguments[1], i))

    return array.dtype, emit


@intrinsic(_store_python)
def store_result(array: types.Type, i: types.Type, value: types.Type) -> Any:
    """`array.flat[i] = value`, in memory that `load` and its relatives never read.

    A loop that only loads and stores results may be compiled for many of its rounds at once: LLVM knows that no round
    reads what another has written.
    """
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> None:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        stored = builder.store(context.cast(builder, arguments[2], value, array.dtype), pointer)
        stored.set_metadata("alias.scope", _results_scope(builder))

    return types.none, emit


@intrinsic(lambda array, i: tuple(_flat(array)[i : i + 4]))
def load4(array: types.Type, i: types.Type) -> Any:
    """Four float32 in one load from `array.flat[i]`, i a multiple of 4; of memory that no kernel writes."""
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        if not is_gpu(context):
            # One after the other: LLVM joins them where that is good, and gathers them where it takes many rounds.
            result = ir.Constant(context.get_value_type(signature.return_type), ir.Undefined)
            for k in range(4):
                value = builder.load(builder.gep(pointer, [ir.Constant(INT, k)]))
                value.set_metadata("invariant.load", builder.module.add_metadata([]))
                value.set_metadata("noalias", _results_scope(builder))
                result = builder.insert_value(result, value, k)
            return result
        vector = builder.load(builder.bitcast(pointer, ir.VectorType(FLOAT, 4).as_pointer()), align=16)
        vector.set_metadata("invariant.load", builder.module.add_metadata([]))
        return _unpacked(context, builder, signature, vector)

    return types.UniTuple(types.float32, 4), emit


@intrinsic(lambda array, i: tuple(_flat(array)[i : i + 4]))
def read4(array: types.Type, i: types.Type) -> Any:
    """Four float32 in one load from `array.flat[i]`, i a multiple of 4; of memory that kernels write, too."""
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        vector = builder.load(builder.bitcast(pointer, ir.VectorType(FLOAT, 4).as_pointer()), align=16)
        return _unpacked(context, builder, signature, vector)

    return types.UniTuple(types.float32, 4), emit


def _write4_python(array: Any, i: int, a: Any, b: Any, c: Any, d: Any) -> None:
    _flat(array)[i : i + 4] = a, b, c, d


@intrinsic(_write4_python)
def write4(array: types.Type, i: types.Type, a: types.Type, b: types.Type, c: types.Type, d: types.Type) -> Any:
    """Four float32 in one store to `array.flat[i]`, i a multiple of 4."""
    if not _is_memory(array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> None:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        vector: ir.Value = ir.Constant(ir.VectorType(FLOAT, 4), ir.Undefined)
        for k, (value, kind) in enumerate(zip(arguments[2:], signature.args[2:])):
            number = context.cast(builder, value, kind, types.float32)
            vector = builder.insert_element(vector, number, ir.Constant(INT, k))
        builder.store(vector, builder.bitcast(pointer, vector.type.as_pointer()), align=16)

    return types.none, emit


def _unpacked(context: Any, builder: ir.IRBuilder, signature: Any, vector: ir.Value) -> ir.Value:
    """A vector of four as the tuple that a kernel sees."""
    result = ir.Constant(context.get_value_type(signature.return_type), ir.Undefined)
    for k in range(4):
        result = builder.insert_value(result, builder.extract_element(vector, ir.Constant(INT, k)), k)
    return result


_ATOMIC = threading.Lock()


def _fetch_add_python(array: np.ndarray, i: int, amount: int) -> int:
    with _ATOMIC:
        before = int(array.flat[i])
        array.flat[i] = before + amount
    return before


@intrinsic(_fetch_add_python)
def fetch_add(array: types.Type, i: types.Type, amount: types.Type) -> Any:
    """Atomic `array.flat[i] += amount` of int64; returns the value before."""
    if not isinstance(array, types.Array) or array.dtype != types.int64:
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        return builder.atomic_rmw("add", pointer, context.cast(builder, arguments[2], amount, types.int64), "monotonic")

    return types.int64, emit


@intrinsic(time.perf_counter_ns)
def read_clock() -> Any:
    """A running count of the processor's cycles, int64."""

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return call_llvm(builder, "llvm.readcyclecounter", LONG, [])

    return types.int64, emit


@intrinsic(lambda array, i: None)
def prefetch(array: types.Type, i: types.Type) -> Any:
    """Ask for the cache line of `array.flat[i]`."""
    if not isinstance(array, types.Array):
        return None

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> None:
        pointer = element_pointer(context, builder, array, arguments[0], arguments[1], i)
        address = builder.bitcast(pointer, ir.IntType(8).as_pointer())
        read, keep, data = (ir.Constant(INT, k) for k in (0, 3, 1))
        call_llvm(builder, "llvm.prefetch.p0", ir.VoidType(), [address, read, keep, data])

    return types.none, emit


def _stack_array(name: str, element: types.Type, llvm: ir.Type, python_type: Any) -> Any:
    def rule(count: types.Type) -> Any:
        if not isinstance(count, types.IntegerLiteral):
            return None

        def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
            with builder.goto_entry_block():
                place = builder.alloca(ir.ArrayType(llvm, count.literal_value))
                place.align = 16 if is_gpu(context) else ALIGNMENT
            return builder.bitcast(place, llvm.as_pointer())

        return types.CPointer(element), emit

    rule.__name__ = rule.__qualname__ = name
    rule.__doc__ = (
        f"`count` {element}, uninitialised, on the stack; `count` is a literal. Read and written by get, put."
    )
    return intrinsic(lambda count: np.zeros(count, python_type))(rule)


stack_floats = _stack_array("stack_floats", types.float32, FLOAT, f32)
stack_ints = _stack_array("stack_ints", types.int32, INT, i32)
