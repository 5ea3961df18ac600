"""The principled material: sampling against density, energy, reciprocity, and the materials that it contains."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_calls import at_angle, numbers
from principled_calls import MATERIALS, NAMES, PrincipledScene
from scipy import stats

COSINES = (0.05, 0.2, 0.4, 0.6, 0.8, 1.0)
SMOOTH = ["smooth plastic", "clear glass", "window", "varnished metal"]
SOLID_GLASS = ["frosted glass", "tinted glass", "clear glass", "milk glass"]
SIDES = [(name, True) for name in NAMES] + [(name, False) for name in SOLID_GLASS]


@pytest.fixture(scope="module")
def scene():
    return PrincipledScene(MATERIALS)


def stratified(side=48, choices=24, seed=0):
    """(3, N) float32: well spread random numbers."""
    rng = np.random.default_rng(seed)
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side), np.arange(choices), indexing="ij")).reshape(3, -1)
    drawn = (cells + rng.random(cells.shape)) / np.array([[side], [side], [choices]])
    return np.minimum(drawn, 1 - 2**-24).astype(np.float32)


def albedo(scene, name, cosine, front=True):
    """(3,): what comes back of white light from everywhere."""
    _, weight, _ = scene.samples(name, at_angle(cosine, 0.1), stratified(), front)
    return weight.mean(axis=1)


@pytest.mark.parametrize(("name", "front"), SIDES)
def test_directions_are_drawn_with_the_density_that_is_told(scene, name, front):
    rows, columns, fine = 24, 24, 24
    for cosine in (0.25, 0.85):
        wo = at_angle(cosine, 0.1)
        wi, _, pdf = scene.samples(name, wo, numbers(3, 300_000, 3), front)
        alive = pdf > 0
        cells = np.histogram2d(
            wi[2][alive], np.arctan2(wi[1], wi[0])[alive], (rows, columns), ((-1, 1), (-np.pi, np.pi))
        )[0]
        z, turn = ((np.arange(n * fine) + 0.5) / (n * fine) for n in (rows, columns))
        z, turn = (grid.ravel() for grid in np.meshgrid(2 * z - 1, turn - 0.5, indexing="ij"))
        _, density = scene.values(name, wo, at_angle(z, turn), front)
        expected = (
            density.reshape(rows, fine, columns, fine).mean(axis=(1, 3)) * (4 * np.pi / rows / columns) * len(pdf)
        )
        # What no cell has: smooth lobes, and directions on the wrong side of the surface.
        observed = np.append(cells.ravel(), len(pdf) - alive.sum())
        expected = np.append(expected.ravel(), len(pdf) - expected.sum())
        few = expected < 20
        observed, expected = (np.append(x[~few], x[few].sum()) for x in (observed, expected))
        # The integral over cells has a small error of its own.
        spread = expected + (0.004 * expected) ** 2 + 4
        p = stats.chi2.sf(((observed - expected) ** 2 / spread).sum(), len(expected) - 1)
        assert p > 1e-4, (cosine, p)


@pytest.mark.parametrize(("name", "front"), SIDES)
def test_weights_are_values_over_densities(scene, name, front):
    for cosine in COSINES:
        wo = at_angle(cosine, 0.3)
        wi, weight, pdf = scene.samples(name, wo, numbers(1, 4000, 3), front)
        rough = pdf > 0
        assert rough.any() == (name not in ("clear glass", "window"))
        if not rough.any():
            continue
        f, density = scene.values(name, wo, wi[:, rough], front)
        np.testing.assert_allclose(density, pdf[rough], rtol=2e-3, atol=1e-5)
        np.testing.assert_allclose(f, (weight * pdf)[:, rough], rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize(("name", "front"), SIDES)
def test_no_more_light_leaves_than_arrives(scene, name, front):
    for cosine in COSINES:
        assert albedo(scene, name, cosine, front).max() < 1.004, cosine


@pytest.mark.parametrize("name", ["white metal", "white plastic", "white lacquer", "clear glass", "window"])
def test_white_surfaces_reflect_everything(scene, name):
    found = [albedo(scene, name, cosine) for cosine in COSINES]
    np.testing.assert_allclose(found, 1, atol=0.006)


RECIPROCAL = ["plastic", "white plastic", "rubber", "pearl", "lacquer", "velvet", "white velvet", "tracing paper"]


@pytest.mark.parametrize("name", RECIPROCAL)
def test_viewer_and_light_may_change_places(scene, name):
    a, b = (
        at_angle(np.random.default_rng(k).uniform(0.02, 1, 2000), np.random.default_rng(k + 9).random(2000))
        for k in (0, 1)
    )
    there, _ = scene.values(name, a, b)
    back, _ = scene.values(name, b, a)
    np.testing.assert_allclose(there / b[2], back / a[2], rtol=3e-3, atol=1e-5)


@pytest.mark.parametrize("name", ["frosted glass", "tinted glass", "milk glass"])
def test_light_through_glass_is_reciprocal_but_for_the_indices(scene, name):
    above, below = (
        at_angle(np.random.default_rng(k).uniform(0.3, 1, 2000), np.random.default_rng(k + 9).random(2000))
        for k in (0, 1)
    )
    into, _ = scene.values(name, above, -below)
    # Seen from within, the surface is turned over.
    flip = np.array([[1.0], [-1.0], [-1.0]], np.float32)
    out, _ = scene.values(name, -below * flip, above * flip, front=False)
    lit = into[0] > 1e-4
    assert lit.sum() > 500
    # Values are for basic radiance.
    np.testing.assert_allclose(
        (into / below[2])[:, lit], (out / above[2])[:, lit] * MATERIALS[name].ior ** 2, rtol=5e-3
    )


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_lobes_are_no_chance_hits(scene, name):
    wi, weight, pdf = scene.samples(name, at_angle(0.6, 0.0), numbers(2, 2000, 3))
    exact = (pdf == 0) & (weight.max(axis=0) > 0)
    assert exact.any()
    np.testing.assert_allclose(np.abs(wi[1][exact]), 0, atol=2e-6)
    reflects = exact & (wi[2] > 0)
    np.testing.assert_allclose(wi[:, reflects].T - (-0.8, 0, 0.6), 0, atol=1e-5)
