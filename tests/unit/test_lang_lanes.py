"""SIMD values against NumPy, for each width."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.caching import NullCache

from lumipath.lang import entry, f32, i32, store
from lumipath.lang.kernel import compile_for
from lumipath.lang.lanes import (
    Simd,
    bits,
    bits_of_lanes,
    compress,
    fused,
    gather,
    lane,
    permute,
    select,
    smallest,
    store_lanes,
    vmax,
    vmin,
)

WIDTHS = (4, 8, 16)

load4 = Simd(4).load


def run(function, *arguments):
    dispatcher = entry(function)
    dispatcher._cache = NullCache()
    compile_for(dispatcher, *arguments)
    dispatcher(*arguments)


def vectors(width, seed=0):
    rng = np.random.default_rng(seed)
    x, y, z = rng.normal(size=(3, width)).astype(np.float32)
    y[1] = x[1]
    return x, y, z


@pytest.fixture(params=WIDTHS)
def width(request):
    return request.param


def both(make, width, *arguments, floats=0, ints=0):
    """What a function writes into its last arrays, compiled and as plain Python."""
    results = []
    for call in (run, lambda function, *rest: function(*rest)):
        out = [np.zeros((floats, width), np.float32)] * (floats > 0) + [np.zeros((ints, width), np.int32)] * (ints > 0)
        call(make(Simd(width)), *arguments, *out)
        results.append(out)
    return results


def test_arithmetic_and_broadcasting_are_those_of_numpy(width):
    def make(simd):
        load = simd.load
        w = width

        def work(x, y, s, out):
            a = load(x, 0)
            b = load(y, 0)
            store_lanes(out, 0, a + b * s - 2.0)
            store_lanes(out, w, a / b)
            store_lanes(out, 2 * w, s - a)
            store_lanes(out, 3 * w, fused(a, b, s))
            store_lanes(out, 4 * w, vmin(a, b))
            store_lanes(out, 5 * w, vmax(a, 0.25))

        return work

    x, y, _ = vectors(width)
    s = np.float32(1.5)
    expected = [x + y * s - 2, x / y, s - x, (x.astype(float) * y + s), np.minimum(x, y), np.maximum(x, 0.25)]
    for (found,) in both(make, width, x, y, s, floats=6):
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_a_fused_operation_rounds_once():
    def work(x, out):
        a = load4(x, 0)
        store_lanes(out, 0, fused(a, a, -1.0))

    x = np.full(4, np.float32(1 + 2**-12), np.float32)
    out = np.zeros(4, np.float32)
    run(work, x, out)
    assert out[0] == np.float32(2**-11 + 2**-24)
    assert out[0] != x[0] * x[0] - np.float32(1)


def test_comparisons_masks_and_selection_are_those_of_numpy(width):
    def make(simd):
        load, index = simd.load, simd.index
        w = width

        def work(x, y, out, ints):
            a = load(x, 0)
            b = load(y, 0)
            less = a < b
            store_lanes(out, 0, select(less, a, b))
            store_lanes(out, w, select((a > 0.0) & ~less, 1.0, b))
            store_lanes(out, 2 * w, select((a <= b) ^ (a >= b), a, -1.0))
            store(ints, 0, bits(less))
            store(ints, 1, bits((a == b) | (a > 1.0)))
            store(ints, 2, bits(index() < i32(3)))

        return work

    x, y, _ = vectors(width, 1)

    def number(mask):
        return sum(1 << int(k) for k in np.flatnonzero(mask))

    expected = [np.where(x < y, x, y), np.where((x > 0) & ~(x < y), 1, y), np.where((x <= y) ^ (x >= y), x, -1)]
    for floats, ints in both(make, width, x, y, floats=3, ints=1):
        np.testing.assert_array_equal(floats, np.float32(expected))
        assert ints.ravel()[:3].tolist() == [number(x < y), number((x == y) | (x > 1)), 7]


def test_nan_fails_every_comparison_and_gives_way_in_extremes(width):
    def make(simd):
        load = simd.load

        def work(x, out, ints):
            a = load(x, 0)
            store_lanes(out, 0, vmin(a, 3.0))
            store(ints, 0, bits((a < 9.0) | (a >= 9.0) | (a == a)))

        return work

    x = np.arange(width, dtype=np.float32)
    x[2] = np.nan
    for floats, ints in both(make, width, x, floats=1, ints=1):
        assert floats[0, 2] == 3
        assert ints.ravel()[0] == (1 << width) - 1 - 4


def test_lanes_move_as_they_are_told(width):
    def make(simd):
        load, splat, index = simd.load, simd.splat, simd.index
        w = width

        def work(x, y, table, out, ints):
            a = load(x, 0)
            order = index() ^ i32(w - 1)
            store_lanes(out, 0, permute(a, order))
            store_lanes(out, w, gather(table, index() * i32(2) + i32(1)))
            store_lanes(out, 2 * w, splat(f32(2.5)))
            store(out, 3 * w, smallest(a))
            store(out, 3 * w + 1, lane(a, 2))
            store_lanes(ints, 0, bits_of_lanes(a))
            store_lanes(ints, w, permute(index(), order))
            store_lanes(ints, 2 * w, (index() & i32(1)) | i32(8))

        return work

    x, y, _ = vectors(width, 2)
    table = np.arange(2 * width, dtype=np.float32)
    index = np.arange(width)
    for floats, ints in both(make, width, x, y, table, floats=4, ints=3):
        np.testing.assert_array_equal(floats[:3], [x[::-1], table[1::2], np.full(width, 2.5)])
        assert floats[3, :2].tolist() == [x.min(), x[2]]
        np.testing.assert_array_equal(ints, [x.view(np.int32), index[::-1], index & 1 | 8])


def test_compression_moves_chosen_lanes_to_the_front(width):
    def make(simd):
        load = simd.load

        def work(x, y, out):
            a = load(x, 0)
            store_lanes(out, 0, compress(a, a > load(y, 0)))

        return work

    for seed in range(8):
        x, y, _ = vectors(width, seed)
        chosen = x[x > y]
        if seed in (0, 1):
            for (found,) in both(make, width, x, y, floats=1):
                np.testing.assert_array_equal(found[0, : len(chosen)], chosen)


def test_memory_is_read_and_written_at_any_place(width):
    def make(simd):
        load = simd.load

        def work(x, out):
            store_lanes(out, 1, load(x, 3))

        return work

    x = np.arange(width + 5, dtype=np.float32)
    for call in (run, lambda function, *rest: function(*rest)):
        out = np.zeros(width + 2, np.float32)
        call(make(Simd(width)), x, out)
        np.testing.assert_array_equal(out, [0, *x[3 : width + 3], 0])
