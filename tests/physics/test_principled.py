"""The principled material: sampling against density, energy, reciprocity, and the materials that it contains."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_calls import at_angle, looped, numbers, packed_with
from parts import moved, sky, with_all_surfaces
from principled_calls import KINDS, MATERIALS, NAMES, WHITE, PrincipledScene, question, surface
from renders import renders
from scipy import stats

from lumipath.kernels.bsdf.conductor import eval_metal, metal_at
from lumipath.kernels.bsdf.rough_dielectric import eval_rough_dielectric, rough_dielectric_at
from lumipath.lang import Vec3, i32
from lumipath.pack.layout import TINTED_METAL_KIND
from lumipath.scene import Camera, Conductor, Dielectric, Principled, Scene, Sphere

COSINES = (0.05, 0.2, 0.4, 0.6, 0.8, 1.0)
SMOOTH = ["smooth plastic", "clear glass", "window", "varnished metal"]
SOLID_GLASS = ["frosted glass", "tinted glass", "clear glass", "milk glass"]
SIDES = [(name, True) for name in NAMES] + [(name, False) for name in SOLID_GLASS]


@pytest.fixture(scope="module")
def scene():
    return PrincipledScene(MATERIALS | WHITE)


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


# Of light from everywhere, the least part that surfaces under layers give back. Facets of a metal or a glossy base get
# what the greater of two albedos leaves, and so do all below a sheen, so that light and viewer may change places.
LEAST = {"lacquer": 0.98, "varnish": 0.97, "velvet": 0.7}


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in LEAST])
def test_white_surfaces_reflect_everything(scene, kind):
    for name in (name for name in WHITE if name.startswith(kind)):
        for front in (True, False) if kind == "glass" else (True,):
            found = [albedo(scene, name, cosine, front) for cosine in COSINES]
            np.testing.assert_allclose(found, 1, atol=0.006, err_msg=f"{name} {front}")


def test_a_white_rough_lacquer_reflects_everything(scene):
    np.testing.assert_allclose([albedo(scene, "white lacquer", cosine) for cosine in COSINES], 1, atol=0.006)


@pytest.mark.parametrize("kind", LEAST)
def test_white_surfaces_under_layers_lose_a_little_and_gain_nothing(scene, kind):
    for name in (name for name in WHITE if name.startswith(kind)):
        found = np.array([albedo(scene, name, cosine) for cosine in COSINES])
        assert LEAST[kind] < found.min(), name
        assert found.max() < 1.004, name


RECIPROCAL = ["plastic", "white plastic", "rubber", "pearl", "lacquer", "velvet", "white velvet"]


def directions(seed, count=2000):
    """(3, count) float32 above the surface."""
    rng = np.random.default_rng(seed)
    return at_angle(rng.uniform(0.02, 1, count), rng.random(count))


@pytest.mark.parametrize("name", RECIPROCAL)
def test_viewer_and_light_may_change_places(scene, name):
    a, b = directions(0), directions(1)
    there, _ = scene.values(name, a, b)
    back, _ = scene.values(name, b, a)
    np.testing.assert_allclose(there / b[2], back / a[2], rtol=3e-3, atol=1e-5)


def test_a_metal_is_a_conductor(scene):
    wo, wi = directions(2), directions(3)
    f, pdf = scene.values("metal", wo, wi)
    other = _conductor(packed_with(Conductor(reflectance=(0.9, 0.6, 0.3), roughness=0.4)), *wo, *wi)
    # The mean reflectance, for light between facets, is a closed form here and a quadrature there.
    np.testing.assert_allclose(f, other[:3], rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(pdf, other[3], rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("front", [True, False])
def test_white_glass_is_a_rough_dielectric(scene, front):
    wo, wi = directions(2), directions(3)
    wi[2, ::2] *= -1
    f, pdf = scene.values("frosted glass", wo, wi, front)
    other = _dielectric(packed_with(Dielectric(roughness=0.5)), np.bool_(front), *wo, *wi)
    assert (f[0, ::2] > 0).mean() > 0.1
    np.testing.assert_allclose(f, np.broadcast_to(other[0], f.shape), rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(pdf, other[1], rtol=2e-3, atol=1e-6)


def test_a_surface_that_reflects_nothing_specular_is_lambertian(scene):
    wo, wi = directions(2), directions(3)
    f, _ = scene.values("rubber", wo, wi)
    np.testing.assert_allclose(f, np.broadcast_to(0.5 * wi[2] / np.pi, f.shape), rtol=1e-5)


def _conductor_value(scene, ox, oy, oz, ix, iy, iz):
    wo = Vec3(ox, oy, oz)
    wi = Vec3(ix, iy, iz)
    s = surface(i32(0), True)
    found = eval_metal(scene, metal_at(scene, s, TINTED_METAL_KIND, question(scene, s, wo, wi)), wo, wi)
    return found.f.x, found.f.y, found.f.z, found.pdf


def _dielectric_value(scene, front, ox, oy, oz, ix, iy, iz):
    wo = Vec3(ox, oy, oz)
    wi = Vec3(ix, iy, iz)
    s = surface(i32(0), front)
    m = rough_dielectric_at(scene, s, question(scene, s, wo, wi))
    found = eval_rough_dielectric(scene, m, wo, wi)
    return found.f.x, found.pdf


_conductor = looped(_conductor_value, outputs=4, scene=True)
_dielectric = looped(_dielectric_value, outputs=2, scene=True)


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_lobes_are_no_chance_hits(scene, name):
    wi, weight, pdf = scene.samples(name, at_angle(0.6, 0.0), numbers(2, 2000, 3))
    exact = (pdf == 0) & (weight.max(axis=0) > 0)
    assert exact.any()
    np.testing.assert_allclose(np.abs(wi[1][exact]), 0, atol=2e-6)
    reflects = exact & (wi[2] > 0)
    np.testing.assert_allclose(wi[:, reflects].T - (-0.8, 0, 0.6), 0, atol=1e-5)


def test_white_surfaces_are_not_to_be_seen_in_a_furnace(device):
    balls = [
        Principled(base_color=1.0, roughness=0.4, clearcoat=1.0, clearcoat_roughness=0.3),
        Principled(base_color=1.0, roughness=0.3, transmission=1.0),
        Principled(base_color=1.0, roughness=0.6, metallic=1.0),
        Principled(base_color=1.0, roughness=0.5, transmission=1.0, thin=True),
    ]
    shapes = [
        Sphere(transform=moved(2.2 * (k % 2) - 1.1, 2.2 * (k // 2) - 1.1, 0.0), material=ball)
        for k, ball in enumerate(balls)
    ]
    camera = Camera.look_at((0, 0, 8), (0, 0, 0), fov=32)
    scene = Scene(shapes=shapes, environment=sky(0.5), cameras=[camera])
    images = renders(with_all_surfaces(scene), device=device, width=24, height=24, spp=256, seeds=6, max_depth=32)
    # Some thousandths are those of the tables, and of paths that are longer.
    assert np.abs(images.mean(axis=(0, 1, 2)) / 0.5 - 1).max() < 0.003
    assert np.abs(images.mean(axis=0) / 0.5 - 1).max() < 0.05
