"""The kernel language's scalars, structs, vectors, bits and memory: compiled code does what Python says."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from numba.core.caching import NullCache

from lumipath.lang import (
    KernelError,
    Vec3,
    aligned,
    aligned_empty,
    as_float,
    as_int,
    as_uint,
    count_bits,
    entry,
    f32,
    fetch_add,
    get,
    i32,
    inverse,
    kernel,
    load,
    load4,
    load_result,
    lowest_bit,
    put,
    reverse_bits,
    sqrt,
    stack_floats,
    stack_ints,
    store,
    store_result,
    struct,
    u32,
)
from lumipath.lang.kernel import compile_for

DOUBLE = 0.1
SINGLE = f32(0.1)


@struct
class Inner:
    a: f32
    b: i32


@struct
class Outer:
    inner: Inner
    flag: bool
    v: Vec3
    bits: u32


def run(function, *arguments):
    """Compile an entry for these arguments and call it."""
    dispatcher = entry(function)
    dispatcher._cache = NullCache()
    compile_for(dispatcher, *arguments)
    dispatcher(*arguments)
    return dispatcher


def test_structs_carry_their_fields_through_kernels_and_convert_to_their_types():
    @kernel
    def made(a, b):
        return Outer(Inner(a, b), a > 1.0, Vec3(a, 2, 3.0), b)

    def fields(a, b):
        o = made(a, b)
        return o.inner.a, o.inner.b, 1.0 if o.flag else 0.0, o.v.x + o.v.y + o.v.z, o.bits

    found = looped(fields, outputs=5, dtype=np.float64)(np.float32([0.5, 2.5]), np.int64([7, 9]))
    np.testing.assert_array_equal(found, [[0.5, 2.5], [7, 9], [0, 1], [5.5, 7.5], [7, 9]])


def test_structs_in_plain_python_are_constructed_by_position_compare_and_do_not_change():
    made = Inner(1, 2.9)
    assert (made.a, made.b) == (1.0, 2)
    assert type(made.a) is np.float32
    assert type(made.b) is np.int32
    assert made == Inner(1, 2)
    assert made != Inner(1, 3)
    assert "a=" in repr(made)
    with pytest.raises(TypeError, match="a, b"):
        Inner(1)
    with pytest.raises(TypeError):
        hash(made)


def test_a_struct_field_of_an_unknown_type_is_an_error():
    with pytest.raises(TypeError, match="f32"):

        @struct
        class Wrong:
            a: float


def test_vectors_have_the_arithmetic_of_numpy():
    def arithmetic(a, b, c, x, y, z, s):
        v, w = Vec3(a, b, c), Vec3(x, y, z)
        r = (v + w) * s - v * w / 2.0 + s * (-w) + v / w
        r += v
        r -= w * 3
        r *= 0.5
        return r.x, r.y, r.z

    v, w = np.random.default_rng(1).uniform(0.5, 2, (2, 3, 1000)).astype(np.float32)
    s = np.float32(1.5)
    a, b = v.astype(float), w.astype(float)
    expected = ((a + b) * s - a * b / 2 - s * b + a / b + a - b * 3) * 0.5
    np.testing.assert_allclose(looped(arithmetic, outputs=3)(*v, *w, s), expected, atol=1e-5)
    plain = arithmetic(*v[:, 0], *w[:, 0], s)
    np.testing.assert_allclose(plain, expected[:, 0], atol=1e-5)


def test_float_literals_are_single_precision():
    def third(x):
        return 1.0 / 3.0 + x * 0.0

    found = looped(third, dtype=np.float64)(np.float32([1]))
    assert found[0] == np.float64(np.float32(1) / np.float32(3))

    def in_a_tuple(x):
        return (0.1, 0.2)[1] + x * 0.0

    assert looped(in_a_tuple, dtype=np.float64)(np.float32([1]))[0] == np.float64(np.float32(0.2))


def test_a_double_among_the_globals_is_an_error_that_names_it():
    with pytest.raises(KernelError, match=r"DOUBLE.*f32"):

        @kernel
        def wrong(x):
            return x * DOUBLE

    @kernel
    def right(x):
        return x * SINGLE

    found = looped(lambda x: right(x), dtype=np.float64)(np.float32([1]))
    assert found[0] == np.float64(np.float32(0.1))


def test_an_error_of_compilation_names_the_innermost_kernel_its_file_and_line():
    @kernel
    def broken(x):
        return x.nothing

    @kernel
    def between(x):
        return broken(x) + 1.0

    def caller(x, out):
        store(out, 0, between(x))

    with pytest.raises(KernelError) as caught:
        run(caller, np.float32(1), np.zeros(1, np.float32))
    line = broken.py_func.__code__.co_firstlineno + 2
    assert f"test_lang_values.py:{line}" in str(caught.value)
    assert "broken does not compile" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_wrong_call_of_an_intrinsic_is_an_error_of_compilation():
    def wrong(out):
        store(out, 0, as_int(i32(3)))

    with pytest.raises(KernelError, match="as_int"):
        run(wrong, np.zeros(1, np.float32))


def test_bits_of_scalars_are_those_of_numpy():
    x = np.random.default_rng(2).integers(0, 2**32, 1000, dtype=np.uint32)
    reals = np.float32([0.0, -0.0, 1.5, np.inf, -1e-40, 3e38])
    np.testing.assert_array_equal(looped(lambda v: as_int(v), dtype=np.int32)(reals), reals.view(np.int32))
    np.testing.assert_array_equal(looped(lambda v: as_uint(v), dtype=np.uint32)(reals), reals.view(np.uint32))
    np.testing.assert_array_equal(looped(lambda v: as_float(v))(reals.view(np.int32)), reals)
    backwards = [int(f"{int(v):032b}"[::-1], 2) for v in x]
    np.testing.assert_array_equal(looped(lambda v: reverse_bits(v), dtype=np.uint32)(x), backwards)
    np.testing.assert_array_equal([reverse_bits(v) for v in x], backwards)
    wide = x.astype(np.int64) | 1 << 40
    lowest = [(int(v) & -int(v)).bit_length() - 1 for v in wide]
    np.testing.assert_array_equal(looped(lambda v: lowest_bit(v), dtype=np.int64)(wide), lowest)
    np.testing.assert_array_equal(
        looped(lambda v: count_bits(v), dtype=np.int64)(wide), [int(v).bit_count() for v in wide]
    )


def test_words_wrap_around():
    u = looped(lambda x: u32(u32(x * u32(0x9E3779B9)) + u32(0xFFFFFFFF)), dtype=np.uint32)
    x = np.arange(5, dtype=np.uint32)
    np.testing.assert_array_equal(u(x), x * np.uint32(0x9E3779B9) - np.uint32(1))


def test_roots_and_reciprocals_are_exact_on_the_cpu_and_nan_below_0():
    x = np.float32([4, 2, 0, 1e-30, -1])
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(looped(lambda v: sqrt(v))(x), np.sqrt(x))
    np.testing.assert_array_equal(looped(lambda v: inverse(v))(x[:4] + 1), 1 / (x[:4] + 1))


def test_memory_is_read_and_written_where_it_should():
    def work(source, floats, ints, results):
        a, b, c, d = load4(source, 4)
        store(floats, 0, a + 10.0 * b + 100.0 * c + 1000.0 * d)
        store(floats, 5, load(source, 11))
        store(ints, 3, 7)
        local = stack_floats(8)
        counts = stack_ints(4)
        for k in range(8):
            put(local, k, k * 0.5)
        for k in range(4):
            put(counts, k, k)
        store(floats, 1, get(local, 7))
        store(ints, 0, get(counts, 2))
        store_result(results, 1, 5.0)
        store(floats, 2, load_result(results, 1))

    source = aligned(np.arange(12, dtype=np.float32).reshape(3, 4))
    floats, ints = np.zeros((2, 3), np.float32), np.zeros(4, np.int32)
    run(work, source, floats, ints, np.zeros(2, np.float32))
    np.testing.assert_array_equal(floats, [[7654, 3.5, 5], [0, 0, 11]])
    np.testing.assert_array_equal(ints, [2, 0, 0, 7])
    again = np.zeros_like(floats), np.zeros_like(ints)
    work(source, *again, np.zeros(2, np.float32))
    np.testing.assert_array_equal(again[0], floats)
    np.testing.assert_array_equal(again[1], ints)


def test_fetch_add_returns_what_was_there():
    def work(counter, before):
        store(before, 0, fetch_add(counter, 1, 5))
        store(before, 1, fetch_add(counter, 1, -2))

    counter, before = np.int64([1, 10]), np.zeros(2, np.int64)
    run(work, counter, before)
    assert counter.tolist() == [1, 13]
    assert before.tolist() == [10, 15]


def test_aligned_arrays_start_at_a_cache_line_and_are_never_empty():
    for shape in ((0, 4), (1,), (7, 3), (1000,)):
        made = aligned(np.ones(shape, np.float32))
        assert made.ctypes.data % 64 == 0
        assert made.shape[1:] == shape[1:]
        assert len(made) == max(1, shape[0])
    assert aligned_empty((3, 5), np.int32).ctypes.data % 64 == 0
