"""Polynomials, frames, Fresnel, refraction: against float64 and closed formulas."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped

from lumipath.kernels.bsdf.dielectric import sample_dielectric
from lumipath.kernels.bsdf.mirror import mirror_direction
from lumipath.kernels.fresnel import dielectric_reflectance, refracted_cosine
from lumipath.kernels.functions import (
    acos_turn,
    atan2_turn,
    cos_sin_turn,
    exp_minus,
    floor_int,
    power_heuristic,
    unit_power,
)
from lumipath.kernels.materials import Lobes
from lumipath.kernels.vectors import cross, dot, frame_around, length, normalize, to_local, to_world
from lumipath.lang import Features, Vec3
from lumipath.pack.layout import SCHLICK_FRESNEL
from lumipath.pack.scene import pack_scene
from lumipath.scene import Scene, Sphere


def float32s(low, high, count=200_000, seed=0):
    return np.random.default_rng(seed).uniform(low, high, count).astype(np.float32)


# ---- polynomials: the bounds are those of the docstrings ------------------------------------------------------------


def test_cos_and_sin_of_turns_are_within_their_bound_on_all_of_0_to_1():
    u = np.concatenate([float32s(0, 1), np.arange(0, 1025, dtype=np.float32) / 1024, [np.float32(1 - 2**-24)]])
    c, s = looped(lambda u: cos_sin_turn(u), outputs=2)(u)
    angle = 2 * np.pi * u.astype(np.float64)
    assert np.abs(c - np.cos(angle)).max() < 3e-7
    assert np.abs(s - np.sin(angle)).max() < 3e-7


def test_exp_of_minus_x_is_within_its_bound():
    f = looped(lambda x: exp_minus(x))
    x = np.concatenate([float32s(0, 1), float32s(0, 20), float32s(0, 87), [0, 1e-30, 1e-7, 86.99]]).astype(np.float32)
    np.testing.assert_allclose(f(x), np.exp(-x.astype(np.float64)), rtol=3e-7)


def test_exp_of_minus_x_is_0_beyond_87_and_1_at_0():
    f = looped(lambda x: exp_minus(x))(np.float32([0, 87.001, 88, 1e4, 1e38, np.inf]))
    np.testing.assert_array_equal(f, [1, 0, 0, 0, 0, 0])


def test_powers_of_0_to_1_are_within_their_bound():
    f = looped(lambda x, n: unit_power(x, n))
    x = np.concatenate([float32s(0, 1), 1 - float32s(0, 1e-4), 10 ** float32s(-30, 0)]).astype(np.float32)
    for n in (0.0, 0.3, 1.0, 2.0, 96.078, 1e3, 1e6):
        expected = x.astype(np.float64) ** np.float64(np.float32(n))
        error = np.abs(f(x, np.float32(n)) - expected) / np.maximum(expected, 1e-300)
        seen = expected > 1e-36
        assert (error[seen] < 1e-6 * (1 - np.log(expected[seen]))).all(), n


def test_powers_at_the_ends_of_0_to_1():
    found = looped(lambda x, n: unit_power(x, n))(np.float32([0, 0, 0, 1, 1, 1]), np.float32([0, 1, 50, 0, 1, 1e9]))
    np.testing.assert_array_equal(found, [1, 0, 0, 1, 1, 1])


def test_the_angle_of_a_point_is_within_its_bound_all_around_and_at_any_distance():
    f = looped(lambda y, x: atan2_turn(y, x))
    angle = np.concatenate([float32s(0, 2 * np.pi).astype(np.float64), np.arange(16) * np.pi / 8])
    for radius in (1.0, 1e-20, 1e18):
        x, y = (np.float32(radius * v) for v in (np.cos(angle), np.sin(angle)))
        expected = np.arctan2(y.astype(np.float64), x.astype(np.float64)) / (2 * np.pi) % 1.0
        error = np.abs(f(y, x) - expected)
        # 0 and 1 are the same angle.
        assert np.minimum(error, 1 - error).max() < 1e-6
    exact = f(np.float32([0, 0, 1, -1, 0]), np.float32([1, -1, 0, 0, 0]))
    np.testing.assert_allclose(exact, [0, 0.5, 0.25, 0.75, 0], atol=1e-7)


def test_arc_cosine_is_accurate_as_an_angle_and_clamps():
    f = looped(lambda x: acos_turn(x))
    x = np.concatenate([float32s(-1, 1), np.float32([-1, 0, 1])])
    expected = np.arccos(x.astype(np.float64)) / np.pi
    # 1 - x^2 in float32 limits what is known of small angles.
    assert (np.abs(f(x) - expected) * np.maximum(np.sin(np.pi * expected), 2e-4)).max() < 1e-6
    np.testing.assert_allclose(f(np.float32([1.0000001, 2, -1.0000001, -5])), [0, 0, 1, 1], atol=1e-6)


def test_floor_is_that_of_numpy():
    x = np.concatenate([float32s(-1e6, 1e6), np.float32([0.0, -0.0, 1, -1, -1e-30, 1e-30, -0.5, 2**24, -(2**24)])])
    np.testing.assert_array_equal(looped(lambda x: floor_int(x), dtype=np.int32)(x), np.floor(x.astype(float)))


def test_the_power_heuristic_weighs_by_squares_and_its_weights_add_up_to_1():
    f = looped(lambda a, b: power_heuristic(a, b))
    a, b = (np.float32(10.0 ** float32s(-12, 12, seed=k)) for k in (1, 2))
    x, y = a.astype(float), b.astype(float)
    np.testing.assert_allclose(f(a, b), x * x / (x * x + y * y), rtol=1e-6, atol=1e-37)
    np.testing.assert_allclose(f(a, b) + f(b, a), 1, rtol=1e-6)
    np.testing.assert_array_equal(f(np.float32([0, 1, 3e38, 1]), np.float32([1, 0, 1, 3e38])), [0, 1, 1, 0])


# ---- vectors --------------------------------------------------------------------------------------------------------


def normals():
    v = np.random.default_rng(3).normal(size=(100_000, 3))
    near = np.array(
        [(1e-4, 0, -1), (0, -1e-6, -1), (1e-8, 1e-8, -1), (0, 0, -1), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, -1, 0)]
    )
    v = np.concatenate([v, near, -near])
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32).T


def test_frames_are_orthonormal_right_handed_and_around_their_normal_even_at_minus_z():
    def frame(x, y, z):
        f = frame_around(Vec3(x, y, z))
        return f.t.x, f.t.y, f.t.z, f.b.x, f.b.y, f.b.z, f.n.x, f.n.y, f.n.z

    n = normals()
    basis = looped(frame, outputs=9)(*n).astype(float).reshape(3, 3, -1)
    np.testing.assert_array_equal(basis[2], n)
    gram = np.einsum("iak,jak->kij", basis, basis)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=2e-6)
    np.testing.assert_allclose(np.linalg.det(basis.transpose(2, 0, 1)), 1, atol=3e-6)


def test_a_vector_goes_to_a_frame_and_back():
    def there_and_back(x, y, z, a, b, c):
        f = frame_around(Vec3(x, y, z))
        v = to_world(f, to_local(f, Vec3(a, b, c)))
        return v.x, v.y, v.z, to_local(f, Vec3(a, b, c)).z

    n = normals()
    v = np.roll(n, 17, axis=1)
    result = looped(there_and_back, outputs=4)(*n, *v)
    np.testing.assert_allclose(result[:3], v, atol=2e-6)
    np.testing.assert_allclose(result[3], (n.astype(float) * v).sum(0), atol=1e-6)


def test_products_and_lengths_are_those_of_numpy():
    def products(a, b, c, x, y, z):
        v, w = Vec3(a, b, c), Vec3(x, y, z)
        k, n = cross(v, w), normalize(v)
        return dot(v, w), k.x, k.y, k.z, length(v), n.x, n.y, n.z

    v, w = np.random.default_rng(5).normal(size=(2, 3, 10_000)).astype(np.float32)
    found = looped(products, outputs=8)(*v, *w)
    a, b = v.astype(float), w.astype(float)
    np.testing.assert_allclose(found[0], (a * b).sum(0), atol=2e-6)
    np.testing.assert_allclose(found[1:4], np.cross(a, b, axis=0), atol=3e-6)
    np.testing.assert_allclose(found[4], np.linalg.norm(a, axis=0), rtol=3e-7)
    np.testing.assert_allclose(found[5:], a / np.linalg.norm(a, axis=0), atol=2e-7)


# ---- dielectrics ----------------------------------------------------------------------------------------------------


def scene(mask=0):
    return pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(mask))


def _reflectance(scene, cosine, eta):
    refracted = refracted_cosine(cosine, eta)
    return dielectric_reflectance(scene, cosine, refracted, eta), refracted


reflectance = looped(_reflectance, outputs=2, scene=True)


def exact(cosine, eta):
    """Fresnel's equations and Snell's law in float64: reflectance and cosine of refraction."""
    sine2 = (1 - cosine**2) / eta**2
    t = np.sqrt(np.maximum(0, 1 - sine2))
    s = (cosine - eta * t) / (cosine + eta * t)
    p = (eta * cosine - t) / (eta * cosine + t)
    return np.where(sine2 >= 1, 1, (s * s + p * p) / 2), t


@pytest.mark.parametrize("eta", [1.1, 1.5, 2.4, 1 / 1.1, 1 / 1.5, 1 / 2.4])
def test_reflectance_follows_fresnel_and_the_angle_follows_snell(eta):
    cosine = float32s(0.0, 1.0)
    expected, refracted = exact(cosine.astype(float), np.float64(np.float32(eta)))
    found, t = reflectance(scene(), cosine, np.float32(eta))
    # Within rounding of total reflection and of grazing incidence everything is steep.
    clear = (refracted > 1e-2) | (expected == 1)
    clear &= np.abs(1 - (1 - cosine.astype(float) ** 2) / eta**2) > 1e-3
    np.testing.assert_allclose(found[clear], expected[clear], atol=3e-5)
    np.testing.assert_allclose(t[clear], refracted[clear], atol=3e-5)


def test_no_light_is_reflected_where_the_index_is_1():
    found, t = reflectance(scene(), float32s(0.01, 1), np.float32(1))
    assert found.max() < 1e-6
    np.testing.assert_allclose(t, float32s(0.01, 1), atol=1e-4)


@pytest.mark.parametrize("mask", [0, SCHLICK_FRESNEL], ids=["exact", "schlick"])
@pytest.mark.parametrize("index", [1.3, 1.5, 3.0])
def test_reflectance_at_normal_and_grazing_incidence_and_at_the_critical_angle(mask, index):
    f0 = ((index - 1) / (index + 1)) ** 2
    for eta in (index, 1 / index):
        assert reflectance(scene(mask), np.float32(1), np.float32(eta))[0] == pytest.approx(f0, rel=1e-5)
    assert reflectance(scene(mask), np.float32(1e-6), np.float32(index))[0] == pytest.approx(1, abs=1e-4)
    critical = np.sqrt(1 - 1 / index**2)
    assert reflectance(scene(mask), np.float32(critical * 0.999), np.float32(1 / index))[0] == 1
    above = reflectance(scene(mask), np.float32(critical + 1e-6), np.float32(1 / index))[0]
    assert 0.9 < above <= 1


@pytest.mark.parametrize("mask", [0, SCHLICK_FRESNEL], ids=["exact", "schlick"])
def test_reflectance_is_from_0_to_1_and_the_same_along_a_ray_and_back(mask):
    cosine = float32s(0.01, 1)
    there, refracted = reflectance(scene(mask), cosine, np.float32(1.5))
    back, cosine_back = reflectance(scene(mask), refracted, np.float32(1 / np.float32(1.5)))
    assert there.min() >= 0
    assert there.max() <= 1
    np.testing.assert_allclose(back, there, atol=2e-4)
    np.testing.assert_allclose(cosine_back, cosine, atol=1e-3)


def test_schlick_follows_its_formula_outside():
    cosine = float32s(0, 1)
    f0 = 0.04
    found = reflectance(scene(SCHLICK_FRESNEL), cosine, np.float32(1.5))[0]
    np.testing.assert_allclose(found, f0 + (1 - f0) * (1 - cosine.astype(float)) ** 5, atol=1e-6)


def _sample(scene, x, y, z, index, entering, u):
    white = Vec3(1, 1, 1)
    lobes = Lobes(white, white, 1.0, index, Vec3(0.25, 0.5, 1.0), Vec3(0.125, 0.5, 1.0))
    s = sample_dielectric(scene, lobes, Vec3(x, y, z), entering > 0.0, u)
    return s.wi.x, s.wi.y, s.wi.z, s.weight.x, 1.0 if s.refracted else 0.0


sample = looped(_sample, outputs=5, scene=True)


@pytest.mark.parametrize("entering", [1.0, 0.0])
def test_a_dielectric_reflects_or_refracts_by_snell_with_the_probability_of_fresnel(entering):
    wo = normals()
    wo[2] = np.maximum(np.abs(wo[2]), np.float32(1e-2))
    wo = (wo / np.linalg.norm(wo.astype(float), axis=0)).astype(np.float32)
    u = float32s(0, 1, wo.shape[1])
    *wi, weight, refracted = sample(scene(), *wo, np.float32(1.5), np.float32(entering), u)
    wi, refracted = np.array(wi, float), refracted > 0
    eta = 1.5 if entering else 1 / 1.5
    f, t = exact(wo[2].astype(float), eta)
    sure = np.abs(u - f) > 1e-3
    np.testing.assert_array_equal(refracted[sure], (u >= f)[sure])
    np.testing.assert_allclose(np.linalg.norm(wi, axis=0), 1, atol=2e-5)
    # Reflection turns around the normal; refraction goes to the other side, and its sine is smaller by eta.
    np.testing.assert_allclose(wi[:, ~refracted], (wo * [[-1], [-1], [1]])[:, ~refracted], atol=1e-7)
    np.testing.assert_allclose(wi[:2, refracted], -wo[:2, refracted] / eta, atol=1e-6)
    np.testing.assert_allclose(wi[2, refracted], -t[refracted], atol=2e-3)
    # The weights are tints only, since the choice took care of the reflectance.
    total = ~refracted & (t == 0)
    np.testing.assert_array_equal(weight[refracted], 1.0)
    np.testing.assert_array_equal(weight[~refracted & (t > 1e-2)], 0.25)
    np.testing.assert_array_equal(weight[total & (f == 1) & sure], 0.125)
    assert refracted.sum() > 1000
    assert entering or total.sum() > 1000


def test_a_mirror_keeps_the_angle():
    def mirrored(x, y, z):
        wi = mirror_direction(Vec3(x, y, z))
        return wi.x, wi.y, wi.z

    wo = normals()
    np.testing.assert_array_equal(looped(mirrored, outputs=3)(*wo), wo * np.float32([[-1], [-1], [1]]))
