"""Samplers of directions and points: they draw with the density that they claim (chi-square tests)."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from scipy import stats

from lumipath.kernels.bsdf.lambert import lambert_direction, lambert_eval, lambert_pdf, lambert_weight
from lumipath.kernels.warps import (
    cosine_hemisphere,
    cosine_hemisphere_pdf,
    uniform_disc,
    uniform_hemisphere,
    uniform_hemisphere_pdf,
    uniform_polygon,
    uniform_sphere,
    uniform_triangle,
)
from lumipath.lang import Features
from lumipath.pack.layout import UNIFORM_HEMISPHERE
from lumipath.pack.scene import pack_scene
from lumipath.scene import Scene, Sphere

COUNT = 400_000
ALPHA = 1e-4


def numbers(seed, count=COUNT):
    u = np.random.default_rng(seed).random((2, count), np.float32)
    return np.minimum(u, np.float32(1 - 2**-24))


def chi_square(observed, expected):
    """p-value; cells that expect little are pooled."""
    observed, expected = np.ravel(observed).astype(float), np.ravel(expected) * (np.sum(observed) / np.sum(expected))
    few = expected < 10
    if few.any():
        observed = np.append(observed[~few], observed[few].sum())
        expected = np.append(expected[~few], expected[few].sum())
    keep = expected > 0
    assert observed[~keep].sum() == 0, "points where the density is 0"
    return stats.chisquare(observed[keep], expected[keep]).pvalue


def sphere_cells(v, rows=16, columns=24):
    """Counts of directions by cell of z and angle; all cells have the same solid angle."""
    assert np.abs(np.linalg.norm(v, axis=0) - 1).max() < 1e-6
    angle = np.arctan2(v[1], v[0])
    return np.histogram2d(v[2], angle, (rows, columns), ((-1, 1), (-np.pi, np.pi)))[0]


def expected_cells(density_of_z, rows=16, columns=24):
    """Probability of each cell, by integrating the density over z."""
    z = (np.arange(rows * 64) + 0.5) / (rows * 64) * 2 - 1
    by_row = density_of_z(z).reshape(rows, 64).mean(axis=1) * (2 / rows) * 2 * np.pi
    return np.repeat(by_row[:, None] / columns, columns, axis=1)


def _vector(name, function):
    namespace = {"function": function}
    exec(f"def {name}(u, v):\n    d = function(u, v)\n    return d.x, d.y, d.z", namespace)
    return looped(namespace[name], outputs=3)


DIRECTIONS = {
    "cosine_hemisphere": (cosine_hemisphere, lambda z: np.maximum(z, 0) / np.pi),
    "uniform_hemisphere": (uniform_hemisphere, lambda z: (z > 0) / (2 * np.pi)),
    "uniform_sphere": (uniform_sphere, lambda z: np.full_like(z, 1 / (4 * np.pi))),
}


@pytest.mark.parametrize("name", DIRECTIONS)
def test_directions_have_their_density(name):
    function, density = DIRECTIONS[name]
    cells = sphere_cells(_vector(name, function)(*numbers(1)))
    expected = expected_cells(density)
    assert expected.sum() == pytest.approx(1, abs=1e-3)
    assert chi_square(cells, expected) > ALPHA


def test_the_chi_square_test_tells_a_cosine_from_a_uniform_density():
    cells = sphere_cells(_vector("cosine_hemisphere", cosine_hemisphere)(*numbers(1)))
    assert chi_square(cells[8:], expected_cells(DIRECTIONS["uniform_hemisphere"][1])[8:]) < ALPHA


def test_densities_of_hemispheres_are_as_documented():
    z = np.linspace(-1, 1, 101, dtype=np.float32)
    cosine = looped(lambda c: cosine_hemisphere_pdf(c))(z)
    np.testing.assert_allclose(cosine, np.maximum(z, 0) / np.pi, rtol=1e-6)
    uniform = looped(lambda c: uniform_hemisphere_pdf(c))(z)
    np.testing.assert_allclose(uniform, (z >= 0) / (2 * np.pi), rtol=1e-6)


def test_points_of_the_disc_are_uniform():
    x, y = looped(lambda u, v: uniform_disc(u, v), outputs=2)(*numbers(2))
    r2, angle = x.astype(float) ** 2 + y.astype(float) ** 2, np.arctan2(y, x)
    assert r2.max() <= 1 + 1e-6
    cells = np.histogram2d(r2, angle, (16, 24), ((0, 1 + 1e-6), (-np.pi, np.pi)))[0]
    assert chi_square(cells, np.ones_like(cells)) > ALPHA


def test_points_of_the_triangle_are_uniform():
    a, b = looped(lambda u, v: uniform_triangle(u, v), outputs=2)(*numbers(3))
    assert min(a.min(), b.min()) >= 0
    assert (a + b).max() <= 1
    # The map from the triangle back to the square by its conditional distributions keeps uniform points uniform.
    a, b = a.astype(float), b.astype(float)
    first, second = (1 - a) ** 2, b / np.maximum(1 - a, 1e-12)
    cells = np.histogram2d(first, second, (20, 20), ((0, 1), (0, 1)))[0]
    assert chi_square(cells, np.ones_like(cells)) > ALPHA


def inside_polygon(sides, turn, x, y):
    """How far points lie within the regular polygon in the unit circle, as a fraction of what is possible."""
    middles = 2 * np.pi * (turn + (np.arange(sides) + 0.5) / sides)
    across = np.cos(middles)[:, None] * np.ravel(x) + np.sin(middles)[:, None] * np.ravel(y)
    return (1 - across.max(axis=0) / np.cos(np.pi / sides)).reshape(np.shape(x))


@pytest.mark.parametrize(("sides", "turn"), [(3, 0.25), (4, 0.0), (5, 0.9), (6, 0.3), (32, 0.99)])
def test_points_of_the_polygon_are_uniform(sides, turn):
    count = np.full(COUNT, sides, np.int32)
    x, y = looped(lambda n, turn, u, v: uniform_polygon(n, turn, u, v), outputs=2)(count, turn, *numbers(5))
    assert inside_polygon(sides, turn, x.astype(float), y.astype(float)).min() > -2e-6
    # The share of each cell of a grid that lies in the polygon, by points 80 times as fine.
    fine = (np.arange(1280) + 0.5) / 640 - 1
    covered = inside_polygon(sides, turn, *np.meshgrid(fine, fine, indexing="ij")) > 0
    expected = covered.reshape(16, 80, 16, 80).sum(axis=(1, 3))
    cells = np.histogram2d(x, y, (16, 16), ((-1, 1), (-1, 1)))[0]
    assert chi_square(cells, expected) > ALPHA


def test_the_ends_of_the_square_stay_in_the_polygon():
    sides = np.arange(3, 33).repeat(4).astype(np.int32)
    u, v = (np.tile(np.float32(values), 30) for values in ([0, 1 - 2**-24] * 2, [0, 0, 1 - 2**-24, 1 - 2**-24]))
    x, y = looped(lambda n, turn, u, v: uniform_polygon(n, turn, u, v), outputs=2)(sides, 0.0, u, v)
    assert np.hypot(x, y).max() <= 1 + 1e-6
    for n, a, b in zip(sides, x, y):
        assert inside_polygon(n, 0.0, a, b) > -2e-6


@pytest.mark.parametrize("corner", [(0, 0), (0, 1 - 2**-24), (1 - 2**-24, 0), (1 - 2**-24, 1 - 2**-24), (0.5, 0.5)])
def test_the_corners_of_the_square_give_finite_points_of_the_right_kind(corner):
    u, v = (np.float32([c]) for c in corner)
    for name, (function, _) in DIRECTIONS.items():
        d = _vector(name, function)(u, v)
        assert np.linalg.norm(d) == pytest.approx(1, abs=1e-6)
        if name != "uniform_sphere":
            # A direction in the surface itself would have the density 0.
            assert d[2, 0] > 0
    a, b = looped(lambda u, v: uniform_triangle(u, v), outputs=2)(u, v)
    assert min(a[0], b[0]) >= 0
    assert a[0] + b[0] <= 1


@pytest.mark.parametrize("uniform", [False, True])
def test_lambert_samples_its_density_and_weighs_by_what_is_left(uniform):
    scene = pack_scene(Scene(shapes=[Sphere()])).scene
    scene = scene._replace(features=Features(UNIFORM_HEMISPHERE if uniform else 0))

    def sample(scene, u, v):
        wi = lambert_direction(scene, u, v)
        return wi.x, wi.y, wi.z, lambert_pdf(scene, wi.z), lambert_weight(scene, wi.z), lambert_eval(wi.z)

    x, y, z, pdf, weight, value = looped(sample, outputs=6, scene=True)(scene, *numbers(4))
    density = DIRECTIONS["uniform_hemisphere" if uniform else "cosine_hemisphere"][1]
    np.testing.assert_allclose(pdf, density(z.astype(float)), rtol=1e-5)
    np.testing.assert_allclose(weight, value / pdf, rtol=1e-5)
    # The albedo is 1.
    assert weight.mean(dtype=float) == pytest.approx(1, abs=0.005)
    assert chi_square(sphere_cells(np.stack([x, y, z])), expected_cells(density)) > ALPHA
