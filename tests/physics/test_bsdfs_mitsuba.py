"""Values and densities of BSDFs as Mitsuba 3 has them, pair by pair of directions.

Two differences are accounted for. Mitsuba multiplies the masking of both directions, as if they were independent; ours
is Smith's with the height of facets taken into account. And its radiance changes by the square of the index in
refraction, ours is L / n^2. Ours is compared without compensation of energy, which Mitsuba has not.
"""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_calls import EVALS, SAMPLES, at_angle, looped, numbers, packed_with
from principled_calls import PrincipledScene

from lumipath.kernels.fresnel import conductor_reflectance
from lumipath.scene import Conductor, Material, Principled
from lumipath.scene.metals import METALS

mitsuba = pytest.importorskip("mitsuba")
mitsuba.set_variant("scalar_rgb")

PAIRS = 300


@pytest.fixture(scope="module")
def scene():
    return packed_with(Material(transmissive=1.0))


def theirs(dictionary, wo, wi):
    """(2, N): value and density of a BSDF of Mitsuba; its z is the outside."""
    made = mitsuba.load_dict(dictionary)
    context = mitsuba.BSDFContext()
    found = []
    for o, i in zip(wo.T, wi.T):
        si = mitsuba.SurfaceInteraction3f()
        si.wi = mitsuba.Vector3f(*o.tolist())
        i = mitsuba.Vector3f(*i.tolist())
        found.append((made.eval(context, si, i)[0], made.pdf(context, si, i)))
    return np.array(found).T


def smith_lambda(w, alpha_x, alpha_y):
    tangent2 = ((w[0] * alpha_x) ** 2 + (w[1] * alpha_y) ** 2) / w[2] ** 2
    return (np.sqrt(1 + tangent2.astype(float)) - 1) / 2


def masking_ratio(wo, wi, alpha_x, alpha_y):
    """Our masking over Mitsuba's."""
    o, i = smith_lambda(wo, alpha_x, alpha_y), smith_lambda(wi, alpha_x, alpha_y)
    return (1 + o) * (1 + i) / (1 + o + i)


def pairs(seed, both_sides):
    """(3, N) each: wo above, wi above or on either side; none grazing, where digits are few."""
    u = numbers(seed, PAIRS, 5)
    side = np.where(both_sides & (u[4] < 0.6), -1, 1)
    return at_angle(0.05 + 0.95 * u[0], u[1]), at_angle(side * (0.05 + 0.95 * u[2]), u[3])


def assert_close(ours, other):
    """To four digits where there is anything, and to nothing where there is not."""
    seen = other > 1e-4 * other.max()
    assert seen.sum() > 50
    np.testing.assert_allclose(ours[seen], other[seen], rtol=2e-3)
    np.testing.assert_allclose(ours[~seen], other[~seen], atol=2e-4 * other.max())


@pytest.mark.parametrize("alphas", [(0.1, 0.1), (0.5, 0.5), (0.4, 0.1)], ids=str)
def test_rough_conductor(scene, alphas):
    wo, wi = pairs(1, False)
    value, pdf = EVALS["metal"](scene, 1.0, *alphas, *wo, *wi)
    made = {"type": "roughconductor", "material": "none", "distribution": "ggx"}
    their_value, their_pdf = theirs(made | {"alpha_u": alphas[0], "alpha_v": alphas[1]}, wo, wi)
    assert_close(value, their_value * masking_ratio(wo, wi, *alphas))
    assert_close(pdf, their_pdf)


def test_diffuse(scene):
    wo, wi = pairs(3, False)
    value, pdf = EVALS["matt"](scene, 1.0, 0.0, 0.0, *wo, *wi)
    for ours, other in zip((value, pdf), theirs({"type": "diffuse", "reflectance": 1.0}, wo, wi)):
        np.testing.assert_allclose(ours, other, rtol=1e-5)


@pytest.mark.parametrize("roughness", [0.4, 0.9])
def test_metals_of_the_principled_material(roughness):
    ours = PrincipledScene({"metal": Principled(base_color=0.6, metallic=1.0, roughness=roughness)})
    made = {"type": "principled", "base_color": {"type": "rgb", "value": 0.6}, "metallic": 1.0, "roughness": roughness}
    _, wi = pairs(4, False)
    for cosine in (0.2, 0.5, 0.9):
        wo = np.repeat(at_angle(cosine, 0.1)[:, None], PAIRS, axis=1)
        value, pdf = ours.values("metal", wo, wi)
        their_value, their_pdf = theirs(made, wo, wi)
        assert_close(pdf, their_pdf)
        # Ours makes up for light between facets, by a factor that depends on the viewer only.
        more = np.median(value[0] / (their_value * masking_ratio(wo, wi, roughness**2, roughness**2)))
        assert 1 < more < 1.6
        assert_close(value[0], their_value * masking_ratio(wo, wi, roughness**2, roughness**2) * more)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("alphas", [(0.2, 0.2), (0.7, 0.7), (0.5, 0.2)], ids=str)
def test_rough_dielectric(scene, alphas, inside):
    wo, wi = pairs(2, True)
    eta = 1 / 1.5 if inside else 1.5
    value, pdf = EVALS["glass"](scene, eta, *alphas, *wo, *wi)
    # From inside, Mitsuba's directions point down.
    side = np.float32([[1], [1], [-1 if inside else 1]])
    made = {"type": "roughdielectric", "distribution": "ggx", "int_ior": 1.5, "ext_ior": 1.0}
    their_value, their_pdf = theirs(made | {"alpha_u": alphas[0], "alpha_v": alphas[1]}, wo * side, wi * side)
    radiance = np.where(wi[2] < 0, eta**2, 1.0)
    assert_close(value, their_value * radiance * masking_ratio(wo, wi, *alphas))
    assert_close(pdf, their_pdf)


@pytest.mark.parametrize("kind", ["dielectric", "thindielectric"])
@pytest.mark.parametrize("index", [1.33, 1.5, 2.4])
def test_smooth_glass(scene, kind, index):
    made = mitsuba.load_dict({"type": kind, "int_ior": index, "ext_ior": 1.0})
    context = mitsuba.BSDFContext()
    ours = SAMPLES["sheet" if kind == "thindielectric" else "glass"]
    for cosine in (0.05, 0.3, 0.6, 0.95):
        wo = at_angle(cosine, 0.1)
        si = mitsuba.SurfaceInteraction3f()
        si.wi = mitsuba.Vector3f(*wo.tolist())
        reflection, _ = made.sample(context, si, 0.0, mitsuba.Point2f(0.5, 0.5))
        through, _ = made.sample(context, si, 0.9999999, mitsuba.Point2f(0.5, 0.5))
        # The greatest number that still reflects is the reflectance.
        choice = np.linspace(0, 1, 20_001, dtype=np.float32)[:-1]
        x, y, z, _, _ = ours(scene, index, 0.0, 0.0, *wo[:, None], 0.5, 0.5, choice)
        assert (z > 0).mean() == pytest.approx(reflection.pdf, abs=1e-4)
        np.testing.assert_allclose([x[-1], y[-1], z[-1]], list(through.wo), atol=1e-5)


@pytest.mark.parametrize(("metal", "preset"), [("aluminium", "Al"), ("copper", "Cu"), ("gold", "Au"), ("silver", "Ag")])
def test_named_metals_have_nearly_the_colours_of_the_presets(metal, preset):
    # Mitsuba's come from whole spectra, ours from three wavelengths.
    si = mitsuba.SurfaceInteraction3f()
    si.wi = mitsuba.Vector3f(0, 0, 1)
    made = mitsuba.load_dict({"type": "conductor", "material": preset})
    _, weight = made.sample(mitsuba.BSDFContext(), si, 0.5, mitsuba.Point2f(0.5, 0.5))
    np.testing.assert_allclose(Conductor(metal=metal).face_on(), list(weight), atol=0.11)


@pytest.mark.parametrize("metal", METALS)
def test_conductor_reflectance_at_every_angle(metal):
    eta, k = METALS[metal]
    made = mitsuba.load_dict({"type": "conductor", "eta": {"type": "rgb", "value": list(eta)},
                              "k": {"type": "rgb", "value": list(k)}})  # fmt: skip
    reflectance = looped(lambda c, eta, k: conductor_reflectance(c, eta, k))
    for cosine in (0.05, 0.3, 0.7, 1.0):
        si = mitsuba.SurfaceInteraction3f()
        si.wi = mitsuba.Vector3f(*at_angle(cosine).tolist())
        _, weight = made.sample(mitsuba.BSDFContext(), si, 0.5, mitsuba.Point2f(0.5, 0.5))
        np.testing.assert_allclose(reflectance(cosine, eta, k), list(weight), rtol=1e-4)
