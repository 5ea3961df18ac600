"""The variance of drawing diffuse directions uniformly or by the cosine, against its exact value.

A diffuse surface of albedo 1 lies under a sky of radiance a + b cos(theta). One direction gives the estimate
pi L(theta) / pi = a + b mu if it is drawn by the cosine, 2 mu (a + b mu) if it is drawn uniformly, with mu = cos(theta)
of the density 2 mu or 1 on [0, 1]. docs/sampling.md has the integrals.
"""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from parts import floor
from renders import renders, without_light_sampling

from lumipath.kernels.bsdf.lambert import lambert_direction, lambert_weight
from lumipath.lang import Features
from lumipath.pack.layout import UNIFORM_HEMISPHERE
from lumipath.pack.scene import pack_scene
from lumipath.scene import Camera, Environment, Material, Scene, Sphere

SKIES = {"constant": (1.0, 0.0), "bright above": (0.0, 1.0), "bright at the horizon": (1.0, -1.0)}
A, B = np.array(list(SKIES.values())).T
MEAN = A + 2 * B / 3
VARIANCE = {"cosine": B**2 / 18, "uniform": A**2 / 3 + 2 * A * B / 3 + 16 * B**2 / 45}
# Standard errors. Seeds are fixed, so a verdict never changes from run to run.
LIMIT = 5.0
# Sums and products in float32, and a sky of texels.
ROUNDING = 3e-5


def assert_has_moments(values, mean, variance):
    """Fail where independent values (N,) have another mean or variance than they should, beyond their noise."""
    spread = values - values.mean()
    error_of_mean = np.sqrt(variance / len(values))
    error_of_variance = np.sqrt(max(np.mean(spread**4) - variance**2, 0.0) / len(values))
    assert abs(values.mean() - mean) <= LIMIT * error_of_mean + ROUNDING
    assert abs(values.var() - variance) <= LIMIT * error_of_variance + ROUNDING**2


def test_the_integrals_are_those_of_the_estimates():
    # Midpoints: the error is of the order of the square of the step.
    mu = (np.arange(100_000) + 0.5) / 100_000
    for (a, b), *expected in zip(SKIES.values(), MEAN, VARIANCE["cosine"], VARIANCE["uniform"], strict=True):
        radiance = a + b * mu
        for estimate, density, variance in ((radiance, 2 * mu, expected[1]), (2 * mu * radiance, 1, expected[2])):
            assert np.mean(estimate * density) == pytest.approx(expected[0], abs=1e-8)
            assert np.mean(estimate**2 * density) - expected[0] ** 2 == pytest.approx(variance, abs=1e-8)


@pytest.mark.parametrize("hemisphere", VARIANCE)
def test_the_lambert_kernels_have_the_variance_of_theory(hemisphere):
    scene = pack_scene(Scene(shapes=[Sphere()])).scene
    scene = scene._replace(features=Features(UNIFORM_HEMISPHERE if hemisphere == "uniform" else 0))

    def sample(scene, u, v):
        wi = lambert_direction(scene, u, v)
        return wi.z, lambert_weight(scene, wi.z)

    u, v = np.random.default_rng(7).random((2, 400_000), np.float32)
    mu, weight = looped(sample, outputs=2, scene=True)(scene, u, v).astype(np.float64)
    for a, b, mean, variance in zip(A, B, MEAN, VARIANCE[hemisphere], strict=True):
        assert_has_moments(weight * (a + b * mu), mean, variance)


def under_the_skies(rows=256):
    """A white floor that fills the view from above; each colour channel has a sky of its own."""
    mu = np.maximum(np.cos(np.pi * (np.arange(rows) + 0.5) / rows), 0.0)
    image = np.repeat((A + B * mu[:, None])[:, None, :], 2 * rows, axis=1)
    camera = Camera(position=(0, 5, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=20)
    ground = floor(20, material=Material(diffuse=1.0))
    return Scene(shapes=[ground], environment=Environment(image=image.astype(np.float32)), cameras=[camera])


def samples_of(device, hemisphere, change=None):
    """(N, 3): single samples, one a pixel, that know nothing of each other."""
    settings = {"width": 64, "spp": 1, "max_depth": 1, "sampler": "independent", "device": device}
    return renders(under_the_skies(), hemisphere=hemisphere, change=change, **settings).reshape(-1, 3)


@pytest.mark.parametrize("hemisphere", VARIANCE)
def test_renders_have_the_variance_of_theory_where_the_sky_is_found_by_directions_only(device, hemisphere):
    values = samples_of(device, hemisphere, without_light_sampling)
    for channel, mean, variance in zip(values.T, MEAN, VARIANCE[hemisphere], strict=True):
        assert_has_moments(channel, mean, variance)


def test_light_sampling_leaves_the_means_and_brings_the_variances_together(device):
    both = {hemisphere: samples_of(device, hemisphere) for hemisphere in VARIANCE}
    for values in both.values():
        np.testing.assert_array_less(np.abs(values.mean(0) - MEAN), LIMIT * values.std(0) / np.sqrt(len(values)))
    # Under the sky that is bright above the theory without light sampling is a ratio of 6.4.
    above = list(SKIES).index("bright above")
    ratio = both["uniform"][:, above].var() / both["cosine"][:, above].var()
    assert 1.2 < ratio < 0.5 * VARIANCE["uniform"][above] / VARIANCE["cosine"][above]
