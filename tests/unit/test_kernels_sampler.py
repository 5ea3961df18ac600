"""Random numbers: nets in base 2, independent between keys, uniform, and what the published algorithms say."""

from __future__ import annotations

import functools
import itertools
import operator

import numpy as np
import pytest
from kernel_calls import looped
from scipy import ndimage, stats

from lumipath.kernels.sampler import (
    camera_numbers,
    choice_numbers,
    dielectric_number,
    direction_numbers,
    hash32,
    laine_karras,
    later_pair,
    pcg4d,
    sample_number,
    sobol_pair,
    sobol_second,
    sobol_single,
    sobol_third_and_fourth,
    unit_float,
)
from lumipath.lang import Features, i32, reverse_bits, u32
from lumipath.pack.layout import BLUE_NOISE, INDEPENDENT_SAMPLER
from lumipath.pack.scene import pack_scene, pack_view
from lumipath.scene import Camera, Scene, Sphere
from lumipath.settings import RenderSettings

U = np.uint32
ALPHA = 1e-4


def _pair(sample, key):
    p = sobol_pair(reverse_bits(sample), key)
    return p.a, p.b


pair = looped(_pair, outputs=2)


def _later(sample, key):
    p = later_pair(reverse_bits(sample), key)
    return p.a, p.b


later = looped(_later, outputs=2)


def _third_and_fourth(i):
    third, fourth = sobol_third_and_fourth(i)
    return reverse_bits(third), reverse_bits(fourth)


third_and_fourth = looped(_third_and_fourth, outputs=2, dtype=U)
single = looped(lambda sample, key: sobol_single(reverse_bits(sample), key))
hashed = looped(lambda x: hash32(x), dtype=U)


def scene(mask):
    return pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(mask))


def _all_numbers(scene, pixel, sample, seed, depth):
    c = camera_numbers(scene, pixel, sample, seed)
    d = direction_numbers(scene, pixel, sample, seed, i32(depth))
    e = choice_numbers(scene, pixel, sample, seed, i32(depth))
    f = dielectric_number(scene, pixel, sample, seed, i32(depth))
    return c.a, c.b, c.c, c.d, d.a, d.b, d.c, d.d, e.a, e.b, e.c, f


all_numbers = looped(_all_numbers, outputs=12, scene=True)
# Those of the first two dimensions, which are nets, and those of the third and fourth.
PAIRS = [(2, 3), (6, 7)]
LATER_PAIRS = [(0, 1), (4, 5)]
SINGLES = [8, 9, 11]
KEYS = [0, 1, 12345, 0xDEADBEEF, 0xFFFFFFFF]


def is_net(x, y, m):
    """Whether 2^m points have exactly one in each of the elementary intervals of every shape (Sobol 1967)."""
    for k in range(m + 1):
        column = np.floor(x.astype(float) * 2**k).astype(int)
        row = np.floor(y.astype(float) * 2 ** (m - k)).astype(int)
        if (np.bincount(column * 2 ** (m - k) + row, minlength=2**m) != 1).any():
            return False
    return True


def is_spread(dimensions, m, t):
    """Whether of 2^m points exactly 2^t are in each elementary interval of the volume 2^(t - m): a (t, m, s)-net."""
    for split in itertools.product(range(m - t + 1), repeat=len(dimensions)):
        if sum(split) == m - t:
            cell = np.zeros(len(dimensions[0]), int)
            for x, k in zip(dimensions, split, strict=True):
                cell = (cell << k) | np.floor(x.astype(float) * 2**k).astype(int)
            if (np.bincount(cell, minlength=2 ** (m - t)) != 2**t).any():
                return False
    return True


def test_the_third_and_fourth_dimension_are_those_of_sobol():
    # Their generator matrices, from the recurrences as published (Joe and Kuo 2008, primitive polynomials 3 and 4).
    def columns(degree, coefficients, first):
        m = list(first)
        while len(m) < 16:
            new = m[-degree] ^ (m[-degree] << degree)
            for k in range(1, degree):
                new ^= ((coefficients >> (degree - 1 - k)) & 1) * (m[-k] << k)
            m.append(new)
        return [number << (31 - k) for k, number in enumerate(m)]

    points = np.concatenate([2 ** np.arange(16, dtype=U), U([0, 3, 77, 12345, 65535])])
    expectations = columns(2, 1, [1, 3]), columns(3, 1, [1, 3, 1])
    for found, expected in zip(third_and_fourth(points), expectations, strict=True):
        for i, x in zip(points, found, strict=True):
            assert x == functools.reduce(operator.xor, (expected[k] for k in range(16) if i >> k & 1), 0)


@pytest.mark.parametrize("key", KEYS)
def test_the_four_dimensions_of_a_key_are_spread_together(key):
    for m, start in ((6, 0), (6, 2**6), (6, 2**20), (10, 0), (10, 5 * 2**10)):
        samples = np.arange(start, start + 2**m, dtype=U)
        (a, b), (c, d) = pair(samples, U(key)), later(samples, U(key))
        assert is_spread((c, d), m, 1)
        assert is_spread((a, b, c, d), m, 2)


def test_points_of_the_later_dimensions_never_come_again():
    c, d = later(np.arange(2**18, dtype=U), U(5))
    assert len(np.unique(np.stack([c, d]), axis=1).T) > 2**18 - 2
    # What follows on 65,536 points falls between them.
    assert is_spread((c,), 18, 2)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("m", [1, 2, 4, 6, 8, 10])
def test_each_aligned_run_of_points_is_a_net(key, m):
    # That is what makes it a (0, 2)-sequence.
    for start in (0, 2**m, 5 * 2**m, 2**20):
        a, b = pair(np.arange(start, start + 2**m, dtype=U), U(key))
        assert is_net(a, b, m)


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("m", [1, 3, 6, 10])
def test_each_aligned_run_of_a_single_sequence_has_one_point_in_each_interval(key, m):
    for start in (0, 2**m, 7 * 2**m):
        x = single(np.arange(start, start + 2**m, dtype=U), U(key))
        assert (np.bincount((x.astype(float) * 2**m).astype(int), minlength=2**m) == 1).all()


def test_without_scrambling_the_dimensions_are_those_of_sobol():
    i = np.arange(1024, dtype=U)
    first = looped(lambda i: reverse_bits(i), dtype=U)(i) / 2.0**32
    second = looped(lambda i: reverse_bits(sobol_second(reverse_bits(reverse_bits(i)))), dtype=U)(i) / 2.0**32
    points = stats.qmc.Sobol(2, scramble=False).random(1024)
    # SciPy steps in the order of Gray's code, which permutes the points.
    gray = i ^ (i >> U(1))
    np.testing.assert_array_equal(np.stack([first, second], 1)[gray], points)


def test_owen_scrambling_keeps_which_numbers_share_their_leading_digits():
    # In a scrambled number a digit depends on itself and on those before it only (Owen 1995).
    scramble = looped(lambda x, seed: reverse_bits(laine_karras(reverse_bits(x), seed)), dtype=U)
    rng = np.random.default_rng(1)
    x = rng.integers(0, 2**32, 20_000, dtype=U)
    for digits in (1, 5, 13, 24, 31):
        other = x ^ rng.integers(0, 2 ** (32 - digits), 20_000, dtype=U)
        a, b = scramble(x, U(99)), scramble(other, U(99))
        np.testing.assert_array_equal(a >> U(32 - digits), b >> U(32 - digits))
        flipped = scramble(x ^ U(1 << (32 - digits)), U(99))
        np.testing.assert_array_equal((a ^ flipped) >> U(32 - digits), 1)


def test_scrambling_is_a_permutation_that_depends_on_the_key():
    scramble = looped(lambda x, seed: laine_karras(x, seed), dtype=U)
    x = np.unique(np.random.default_rng(3).integers(0, 2**32, 1 << 16, dtype=U))
    results = [scramble(x, U(seed)) for seed in (0, 1, 2, 0x80000000)]
    assert all(len(np.unique(r)) == len(x) for r in results)
    assert all((a != b).mean() > 0.9 for k, a in enumerate(results) for b in results[:k])


def test_hashes_are_uniform_and_change_half_of_their_bits_with_any_bit_of_the_input():
    x = np.random.default_rng(2).integers(0, 2**32, 40_000, dtype=U)
    h = hashed(x)
    assert stats.chisquare(np.bincount(h >> U(22), minlength=1024)).pvalue > ALPHA
    assert stats.chisquare(np.bincount(hashed(np.arange(1 << 17, dtype=U)) >> U(22), minlength=1024)).pvalue > ALPHA
    for bit in range(32):
        changed = np.unpackbits((h ^ hashed(x ^ U(1 << bit))).view(np.uint8)).reshape(-1, 32).mean(axis=0)
        assert np.abs(changed - 0.5).max() < 0.06


def test_a_hash_is_a_permutation():
    x = np.arange(1 << 20, dtype=U)
    assert len(np.unique(hashed(x))) == len(x)
    assert len(np.unique(hashed(x * U(4096)))) == len(x)


def test_pcg4d_is_uniform_in_four_dimensions():
    def four(x, y):
        n = pcg4d(x, y, u32(7), u32(9))
        return n.a, n.b, n.c, n.d

    x, y = np.meshgrid(np.arange(400, dtype=U), np.arange(400, dtype=U))
    n = looped(four, outputs=4)(x.ravel(), y.ravel())
    cells = (n * 6).astype(int)
    index = ((cells[0] * 6 + cells[1]) * 6 + cells[2]) * 6 + cells[3]
    assert stats.chisquare(np.bincount(index, minlength=1296)).pvalue > ALPHA


def test_words_become_numbers_from_0_to_less_than_1():
    f = looped(lambda x: unit_float(x))(U([0, 255, 256, 2**31, 2**32 - 1]))
    np.testing.assert_array_equal(f, [0, 0, 2**-24, 0.5, 1 - 2**-24])


@pytest.mark.parametrize("mask", [0, BLUE_NOISE, INDEPENDENT_SAMPLER], ids=["sobol", "blue-noise", "independent"])
def test_all_numbers_of_a_path_are_from_0_to_less_than_1_and_uniform(mask):
    pixel, sample = np.meshgrid(np.arange(500, dtype=U), np.arange(40, dtype=U))
    for depth in (0, 1, 7):
        n = all_numbers(scene(mask), pixel.ravel(), sample.ravel(), U(3), np.int32(depth))
        assert n.min() >= 0
        assert n.max() < 1
        for k in range(12):
            counts = np.bincount((n[k] * 64).astype(int), minlength=64)
            assert stats.chisquare(counts).pvalue > ALPHA


def test_every_pair_of_a_path_is_a_net_over_the_samples_of_a_pixel():
    sample = np.arange(256, dtype=U)
    for pixel, seed, depth in ((0, 0, 0), (77, 0, 1), (77, 5, 3), (262143, 123456789, 11)):
        n = all_numbers(scene(0), U(pixel), sample, U(seed), np.int32(depth))
        for a, b in PAIRS:
            assert is_net(n[a], n[b], 8)
        for a, b in LATER_PAIRS:
            assert (np.bincount((n[a] * 256).astype(int), minlength=256) == 1).all()
            assert is_spread((n[a], n[b]), 8, 1)
        for k in SINGLES:
            assert (np.bincount((n[k] * 256).astype(int), minlength=256) == 1).all()


@pytest.mark.parametrize("mask", [0, INDEPENDENT_SAMPLER], ids=["sobol", "independent"])
def test_numbers_are_uncorrelated_between_dimensions_pixels_seeds_and_depths(mask):
    def numbers(pixel, sample, seed, depth):
        return all_numbers(scene(mask), pixel, sample, U(seed), np.int32(depth)) - 0.5

    count = 40_000
    limit = 5.5 / np.sqrt(count) / (1 / 12)
    pixel = np.arange(count, dtype=U)
    base = numbers(pixel, U(0), 0, 2)
    # The first sample of many pixels.
    others = {
        "the next pixel": numbers(pixel + U(1), U(0), 0, 2),
        "the pixel below": numbers(pixel + U(512), U(0), 0, 2),
        "the next sample": numbers(pixel, U(1), 0, 2),
        "the next seed": numbers(pixel, U(0), 1, 2),
        "the next depth": numbers(pixel, U(0), 0, 3),
    }
    for name, other in others.items():
        if mask == 0 and name == "the next sample":
            # Samples of a pixel repel each other by design.
            continue
        first = slice(4, None) if name == "the next depth" else slice(None)
        products = (base[first] @ other[first].T) / count
        assert np.abs(products).max() < limit / 12, name
    within = (base @ base.T) / count
    assert np.abs(within - np.diag(np.diag(within))).max() < limit / 12
    np.testing.assert_allclose(np.diag(within), 1 / 12, rtol=0.05)


def test_two_pairs_of_a_pixel_are_not_correlated_over_its_samples():
    # Padded dimensions with equal shuffling would lie on a few lines.
    sample = np.arange(4096, dtype=U)
    n = all_numbers(scene(0), U(5), sample, U(0), np.int32(0))
    for a in range(12):
        for b in range(a):
            cells = np.histogram2d(n[a], n[b], (16, 16), ((0, 1), (0, 1)))[0]
            # Nets are more even than chance, so only a large statistic is a fault.
            assert ((cells - 16) ** 2 / 16).sum() < stats.chi2.isf(1e-6, 255)


# ---- blue noise ------------------------------------------------------------------------------------------------------


def _number(pair, column, row, sample):
    scene, view = pair
    n = sample_number(scene, view, column, row, sample)
    return n.pixel, n.sample


sample_numbers = looped(_number, outputs=2, dtype=U, scene=True)


def numbers_of_image(width, height, spp, samples, mask=BLUE_NOISE, seed=0):
    """(12, pixels, samples): all numbers of an image that is to have `spp` samples; and the numbers of its samples."""
    view = pack_view(Camera(), RenderSettings(width=width, height=height, spp=spp))
    row, column, sample = (a.ravel() for a in np.meshgrid(*map(np.arange, (height, width, samples)), indexing="ij"))
    made = scene(mask)
    pixel, index = sample_numbers((made, view), column.astype(np.int32), row.astype(np.int32), sample.astype(U))
    n = all_numbers(made, pixel, index, U(seed), np.int32(0))
    return n.reshape(12, height * width, samples), pixel, index


def test_no_two_samples_of_an_image_have_one_number():
    for width, height, spp, samples in ((16, 8, 4, 4), (7, 5, 1, 1), (8, 8, 4, 11), (5, 9, 6, 6)):
        _, pixel, index = numbers_of_image(width, height, spp, samples)
        assert len(set(zip(pixel, index, strict=True))) == width * height * samples


def test_an_image_too_large_for_one_sequence_takes_several():
    made, view = scene(BLUE_NOISE), pack_view(Camera(), RenderSettings(width=60_000, height=3, spp=1 << 14))
    column = np.arange(0, 60_000, 7, dtype=np.int32)
    pixel, index = sample_numbers((made, view), column, np.int32(0), U(0))
    assert len(set(zip(pixel, index, strict=True))) == len(column)
    # And with one sample a pixel there is nothing to shift out.
    pixel, _ = sample_numbers((made, view._replace(sample_bits=U(0))), column, np.int32(0), U(0))
    assert len(set(pixel)) == 1


def test_with_blue_noise_squares_of_pixels_share_a_net():
    # Squares of 4 x 4 pixels with 4 samples each, wherever they lie: 64 points.
    n, _, _ = numbers_of_image(16, 16, 4, 4)
    squares = n.reshape(12, 4, 4, 4, 4, 4).transpose(1, 3, 0, 2, 4, 5).reshape(16, 12, 64)
    for square in squares:
        for a, b in PAIRS:
            assert is_net(square[a], square[b], 6)
        for k in SINGLES:
            assert (np.bincount((square[k] * 64).astype(int), minlength=64) == 1).all()


def test_with_blue_noise_the_samples_of_a_pixel_are_a_net():
    n, _, _ = numbers_of_image(9, 7, 32, 32)
    for pixel in range(63):
        for a, b in PAIRS:
            assert is_net(n[a, pixel], n[b, pixel], 5)


@pytest.mark.parametrize("spp", [1, 4, 16])
def test_blue_noise_has_little_of_low_frequencies(spp):
    # The error of a smooth integral, blurred: what is left where neighbours do not make up for each other.
    def blurred_error(mask, seed):
        n, _, _ = numbers_of_image(64, 64, spp, spp, mask, seed)
        error = (n[2] * n[3] - 0.25).mean(axis=1).reshape(64, 64)
        return np.mean(ndimage.uniform_filter(error, 4, mode="wrap") ** 2), np.mean(error**2)

    blue, white = (np.mean([blurred_error(mask, seed) for seed in range(4)], axis=0) for mask in (BLUE_NOISE, 0))
    assert blue[0] < 0.5 * white[0]
    assert blue[1] == pytest.approx(white[1], rel=0.2)
