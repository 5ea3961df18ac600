"""The two settings against fireflies."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped

from lumipath.errors import UsageError
from lumipath.kernels.microfacet import regularized
from lumipath.kernels.path import limited
from lumipath.lang import Features, Vec3
from lumipath.pack import layout
from lumipath.pack.scene import image_features, pack_scene, pack_view
from lumipath.scene import Camera, Dielectric, Scene, Sphere
from lumipath.settings import RenderSettings


@pytest.fixture(scope="module")
def scene():
    packed = pack_scene(Scene(shapes=[Sphere()])).scene

    def with_features(mask):
        return packed._replace(features=Features(mask))

    return with_features


def test_indirect_light_is_limited_by_its_largest_part_and_keeps_its_colour(scene):
    limit = looped(
        lambda pair, r, bounces: (
            limited(pair[0], pair[1], Vec3(r, 0.5 * r, 0.1), bounces).x,
            limited(pair[0], pair[1], Vec3(r, 0.5 * r, 0.1), bounces).y,
        ),
        outputs=2,
        scene=True,
    )
    view = pack_view(Camera(), RenderSettings(clamp_indirect=2.0))
    radiance, bounces = np.float32([1, 2, 8, 8, 8]), np.int32([1, 1, 1, 0, -1])
    x, y = limit((scene(layout.CLAMP_INDIRECT), view), radiance, bounces)
    np.testing.assert_allclose(x, [1, 2, 2, 8, 8], rtol=1e-6)
    np.testing.assert_allclose(y, [0.5, 1, 1, 4, 4], rtol=1e-6)
    x, _ = limit((scene(0), view), radiance, bounces)
    np.testing.assert_array_equal(x, radiance)


def test_regularisation_raises_small_alphas_of_paths_that_are_blurred(scene):
    raise_alpha = looped(
        lambda scene, alpha, blurred: regularized(scene, alpha, 0.5 * alpha, blurred), outputs=2, scene=True
    )
    alpha = np.float32([1e-4, 0.08, 0.2, 0.3, 0.9])
    x, y = raise_alpha(scene(layout.REGULARIZE), alpha, True)
    np.testing.assert_allclose(x, [0.1, 0.16, 0.3, 0.3, 0.9], rtol=1e-6)
    np.testing.assert_allclose(y, [0.1, 0.1, 0.2, 0.3, 0.45], rtol=1e-6)
    for features, blurred in ((layout.REGULARIZE, False), (0, True)):
        np.testing.assert_array_equal(raise_alpha(scene(features), alpha, blurred)[0], alpha)


def test_clear_glass_can_grow_rough_only_where_that_is_wanted():
    glass = Scene(shapes=[Sphere(material=Dielectric(ior=1.4))])
    assert not pack_scene(glass).scene.features.mask & layout.ROUGH_DIELECTRICS
    packed = pack_scene(glass, regularize=True).scene
    assert packed.features.mask & layout.ROUGH_DIELECTRICS
    assert len(packed.energy) == layout.ENERGY_INDICES + 2


def test_the_settings_choose_code_of_paths_only():
    wanted = RenderSettings(clamp_indirect=1.0, regularize=True)
    both = layout.CLAMP_INDIRECT | layout.REGULARIZE
    assert image_features(0, wanted, Camera()) & both == both
    assert image_features(0, RenderSettings(), Camera()) & both == 0
    whitted = RenderSettings(clamp_indirect=1.0, regularize=True, integrator="whitted")
    assert image_features(layout.NESTED, whitted, Camera()) & (both | layout.NESTED) == 0


@pytest.mark.parametrize("options", [{"clamp_indirect": 0.0}, {"clamp_indirect": -1.0}, {"regularize": 1}])
def test_bad_values_are_refused(options):
    with pytest.raises(UsageError, match=next(iter(options))):
        RenderSettings(**options)
