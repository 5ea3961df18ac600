"""Sums of lobes: lobes are chosen so that no lobe is drawn that a surface does not have."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped

from lumipath.kernels.lobes import bounce, lobe_probabilities
from lumipath.kernels.materials import Lobes
from lumipath.kernels.sampler import choice_numbers
from lumipath.kernels.surface import Surface
from lumipath.kernels.tangents import no_tangents
from lumipath.kernels.vectors import frame_around
from lumipath.lang import Features, Vec3, i32
from lumipath.pack.layout import LOBE_GLASS, LOBE_MIRRORS
from lumipath.pack.scene import pack_scene, pack_view
from lumipath.scene import Camera, Scene, Sphere
from lumipath.settings import RenderSettings


def _number(scene, pixel, sample):
    return choice_numbers(scene, pixel, sample, np.uint32(0), i32(0)).b


def _bounce(pair, pixel, sample, diffuse, mirror, transmission):
    scene, view = pair
    up, white = Vec3(0, 0, 1), Vec3(1, 1, 1)
    lobes = Lobes(Vec3(diffuse, diffuse, diffuse), Vec3(mirror, mirror, mirror), transmission, 1.5, white, white)
    surface = Surface(Vec3(0, 0, 0), up, up, True, i32(0), i32(-1), 0.0, 0.0, 0.0, 0.0, 1.0, no_tangents(), 0.0)
    choice = lobe_probabilities(scene, lobes)
    wo = Vec3(0.6, 0.0, 0.8)
    drawn = bounce(scene, view, surface, lobes, choice, frame_around(up), wo, 1.0, pixel, sample, i32(0), 0.3, 0.7)
    return drawn.direction.z, drawn.weight.x, drawn.pdf


numbers = looped(_number, scene=True)
bounces = looped(_bounce, outputs=3, scene=True)


@pytest.fixture(scope="module")
def extremes():
    """Pixels and samples whose number for the choice of a lobe is the largest, or 0."""
    scene = pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(LOBE_MIRRORS | LOBE_GLASS))
    found = []
    for block in range(16):
        pixel, sample = np.divmod(np.arange(block << 22, (block + 1) << 22), 4096)
        u = numbers(scene, pixel.astype(np.uint32), sample.astype(np.uint32))
        rare = np.flatnonzero((u == u.max()) & (u > 0.9999999) | (u == 0))
        found += [(pixel[k], sample[k], u[k]) for k in rare]
    pixel, sample, u = np.transpose(found)
    assert u.max() == np.float32(1 - 2**-24)
    return scene, pixel.astype(np.uint32), sample.astype(np.uint32), u


@pytest.mark.parametrize("mirror", [0.0, 0.3])
@pytest.mark.parametrize("mask", [LOBE_MIRRORS, LOBE_MIRRORS | LOBE_GLASS])
def test_light_never_goes_through_an_opaque_surface_whatever_its_albedo_and_the_random_number(extremes, mask, mirror):
    scene, pixel, sample, _ = extremes
    view = pack_view(Camera(), RenderSettings(width=8))
    for diffuse in np.linspace(0.01, 1, 200).astype(np.float32):
        z, weight, _ = bounces(
            (scene._replace(features=Features(mask)), view), pixel, sample, diffuse, np.float32(mirror), 0.0
        )
        alive = weight > 0
        assert (z[alive] > 0).all()
        assert (weight[alive] < 1.5).all()


def test_each_lobe_is_drawn_with_the_probability_of_its_weight_and_weighs_all_of_them():
    scene = pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(LOBE_MIRRORS | LOBE_GLASS))
    view = pack_view(Camera(), RenderSettings(width=8))
    pixel = np.arange(200_000, dtype=np.uint32)
    z, weight, pdf = bounces((scene, view), pixel, np.uint32(0), np.float32(0.2), np.float32(0.3), np.float32(0.5))
    diffuse, through = pdf > 0, z < 0
    assert diffuse.mean() == pytest.approx(0.2, abs=0.005)
    # Albedo or weight over probability; a dielectric is not weighted by its kt, which absorbs on the way inside.
    glass = weight > 1.5
    np.testing.assert_allclose(weight, np.where(glass, 2.0, 1.0), rtol=1e-5)
    assert glass[through].all()
    assert not glass[diffuse].any()
    assert glass.mean() == pytest.approx(0.5, abs=0.006)
    t = np.sqrt(1 - 0.36 / 2.25)
    reflectance = (((0.8 - 1.5 * t) / (0.8 + 1.5 * t)) ** 2 + ((1.2 - t) / (1.2 + t)) ** 2) / 2
    assert through.mean() == pytest.approx(0.5 * (1 - reflectance), abs=0.006)
