"""Energy: facets that absorb nothing lose nothing, at any roughness and angle."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_calls import looped, packed_with, square
from parts import sky, with_all_surfaces
from renders import renders

from lumipath.kernels.bsdf.conductor import Metal, sample_metal
from lumipath.kernels.bsdf.rough_dielectric import RoughDielectric, facet_reflectance, sample_rough_dielectric
from lumipath.kernels.bsdf.rough_diffuse import RoughDiffuse, sample_rough_diffuse
from lumipath.kernels.bsdf.thin_dielectric import ThinDielectric, sample_thin_dielectric
from lumipath.kernels.energy import dielectric_compensation, energy_compensation, schlick_albedo
from lumipath.kernels.functions import cos_sin_turn
from lumipath.kernels.microfacet import anisotropic_alphas, ggx_visible_normal
from lumipath.kernels.vectors import dot
from lumipath.lang import Vec3, sqrt
from lumipath.pack.layout import ENERGY_INDICES, ENERGY_WHITE
from lumipath.scene import Camera, Scene, Sphere
from lumipath.scene.bsdfs import Conductor, Dielectric
from lumipath.scene.bsdfs import ThinDielectric as Pane

COSINES = (0.03, 0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
ROUGHNESSES = (0.04, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0)


def over_roughness_and_angle(function):
    """(roughnesses, cosines): means of `function` of both and of random numbers, over the square of the latter."""
    roughness, cosine = (a.reshape(-1, 1) for a in np.meshgrid(ROUGHNESSES, COSINES, indexing="ij"))
    u, v = square(1024, 64)
    found = function(*(np.ravel(a) for a in np.broadcast_arrays(roughness, cosine, u, v)))
    return found.reshape(len(ROUGHNESSES), len(COSINES), -1).mean(axis=-1, dtype=float)


def metal_weight(scene, reflectance, compensated, anisotropy, turn, roughness, mu, u, v):
    alpha_x, alpha_y = anisotropic_alphas(roughness, anisotropy)
    grey = Vec3(reflectance, reflectance, reflectance)
    boost = energy_compensation(scene, mu, alpha_x, alpha_y, grey)
    boost = boost if compensated else Vec3(1, 1, 1)
    # With a white edge that is Schlick's reflectance.
    m = Metal(False, grey, Vec3(1, 1, 1), alpha_x, alpha_y, boost)
    sine = sqrt(max(1.0 - mu * mu, 0.0))
    c, s = cos_sin_turn(turn)
    wo = Vec3(c * sine, s * sine, mu)
    return sample_metal(scene, m, wo, u, v).weight.x


@pytest.fixture(scope="module")
def metals():
    return packed_with(Conductor(reflectance=1.0, roughness=0.5, anisotropy=0.5))


@pytest.fixture(scope="module")
def furnace(metals):
    kernel = looped(metal_weight, scene=True)

    def run(reflectance, compensated=True, anisotropy=0.0, turn=0.0):
        return over_roughness_and_angle(lambda *rest: kernel(metals, reflectance, compensated, anisotropy, turn, *rest))

    return run


def test_a_white_metal_reflects_everything(furnace):
    assert np.abs(furnace(1.0) - 1).max() < 0.0025


def test_single_facets_lose_more_than_half_where_rough(furnace):
    alone = furnace(1.0, compensated=False)
    assert alone.min() < 0.5
    assert alone.max() < 1.0005


def test_an_anisotropic_white_metal_reflects_nearly_everything(furnace):
    around = np.mean([furnace(1.0, anisotropy=0.5, turn=turn) for turn in (0.0, 0.125, 0.25)], axis=0)
    assert np.abs(around - 1).max() < 0.04


def test_a_grey_metal_loses_more_than_one_facet_does(furnace):
    # Light that meets two facets is absorbed twice: less comes back than of a single facet that loses nothing.
    rough = np.array(ROUGHNESSES) > 0.4
    grey, alone, white = (f[rough] for f in (furnace(0.5), furnace(0.5, compensated=False), furnace(1.0, False)))
    assert (grey > alone).all()
    assert (grey < alone / white).all()


def test_the_albedo_of_schlick_facets_is_what_they_reflect(metals, furnace):
    told = looped(lambda scene, r, mu: schlick_albedo(scene, mu, r * r, r * r, Vec3(0.5, 0.5, 0.5)).x, scene=True)
    roughness, cosine = np.meshgrid(ROUGHNESSES, COSINES, indexing="ij")
    isotropic = packed_with(Conductor(reflectance=1.0, roughness=0.5))
    found = told(isotropic, roughness.ravel(), cosine.ravel()).reshape(roughness.shape)
    np.testing.assert_allclose(found, furnace(0.5, compensated=False), atol=0.002)


def glass_weight(scene, table, eta, compensated, roughness, mu, u, v):
    alpha = max(roughness * roughness, 1e-4)
    boost = dielectric_compensation(scene, table, mu, alpha, alpha)
    m = RoughDielectric(eta, alpha, alpha, Vec3(1, 1, 1), Vec3(1, 1, 1), boost if compensated else 1.0)
    wo = Vec3(sqrt(max(1.0 - mu * mu, 0.0)), 0.0, mu)
    # The mean over the choice, by both of its ends.
    h = ggx_visible_normal(wo, alpha, alpha, u, v)
    reflectance = facet_reflectance(scene, m, dot(wo, h))
    reflected = sample_rough_dielectric(scene, m, wo, u, v, 0.0).weight.x
    return reflected * reflectance + sample_rough_dielectric(scene, m, wo, u, v, 0.9999999).weight.x * (
        1.0 - reflectance
    )


@pytest.fixture(scope="module")
def glass_furnace():
    indices = (1.5, 1.2, 2.4)
    scene = packed_with(*(Dielectric(ior=index, roughness=0.5) for index in indices))
    kernel = looped(glass_weight, scene=True)

    def run(index, inside, compensated=True):
        table, eta = np.int32(ENERGY_INDICES + 2 * indices.index(index) + inside), 1 / index if inside else index
        return over_roughness_and_angle(lambda *rest: kernel(scene, table, eta, compensated, *rest))

    return run


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("index", [1.5, 1.2, 2.4])
def test_clear_rough_glass_loses_nothing(glass_furnace, index, inside):
    assert np.abs(glass_furnace(index, inside) - 1).max() < 0.006


def test_single_facets_of_glass_lose_light_where_rough(glass_furnace):
    outside, inside = (glass_furnace(1.5, side, compensated=False) for side in (False, True))
    assert max(outside.max(), inside.max()) < 1.0005
    assert outside.min() < 0.8
    assert inside.min() < 0.5


def sheet_weight(scene, roughness, mu, u, v):
    alpha = max(roughness * roughness, 1e-4)
    m = ThinDielectric(1.5, alpha, Vec3(1, 1, 1), dielectric_compensation(scene, ENERGY_WHITE, mu, alpha, alpha))
    wo = Vec3(sqrt(max(1.0 - mu * mu, 0.0)), 0.0, mu)
    # Both ways weigh the same.
    return sample_thin_dielectric(m, wo, u, v, 0.5).weight.x


def test_a_rough_pane_loses_nothing():
    scene = packed_with(Pane(roughness=0.5))
    kernel = looped(sheet_weight, scene=True)
    assert np.abs(over_roughness_and_angle(lambda *rest: kernel(scene, *rest)) - 1).max() < 0.0025


def matt_weight(roughness, mu, u, v):
    wo = Vec3(sqrt(max(1.0 - mu * mu, 0.0)), 0.0, mu)
    return sample_rough_diffuse(RoughDiffuse(Vec3(1, 1, 1), roughness), wo, u, v).weight.x


def test_a_white_matt_surface_reflects_everything():
    assert np.abs(over_roughness_and_angle(looped(matt_weight)) - 1).max() < 0.003


def test_a_white_metal_is_not_to_be_seen_in_a_furnace(device):
    ball = Sphere(material=Conductor(reflectance=1.0, roughness=0.7))
    scene = Scene(shapes=[ball], environment=sky(0.5), cameras=[Camera.look_at((0, 0, 3), (0, 0, 0), fov=40)])
    images = renders(with_all_surfaces(scene), device=device, width=16, height=16, spp=256, seeds=8, max_depth=8)
    # The tables are interpolated: one or two thousandths are theirs.
    assert np.abs(images.mean((0, 1, 2)) / 0.5 - 1).max() < 0.002
    assert np.abs(images.mean(0) / 0.5 - 1).max() < 0.05
