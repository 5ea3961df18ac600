"""Metals: GGX microfacets whose reflectance is that of a conductor (pbrt, 4th edition, section 9.6)."""

from __future__ import annotations

from ...lang import Vec3, f32, kernel, struct
from ...pack.layout import BSDF_ANISOTROPY, BSDF_COLOUR, BSDF_EDGE, BSDF_ROUGHNESS, MEASURED_METAL_KIND, MEASURED_METALS
from ..energy import energy_compensation
from ..fresnel import conductor_reflectance, tinted_reflectance
from ..microfacet import (
    SMOOTH_ALPHA,
    anisotropic_alphas,
    ggx_density,
    ggx_lambda,
    ggx_visible_normal,
    reflected,
    regularized,
    visible_weight,
)
from ..vectors import dot, normalize, white
from .mirror import mirror_direction
from .values import (
    BsdfSample,
    BsdfValue,
    base_colour_slot,
    colour_slot,
    no_sample,
    no_value,
    number_slot,
    slot,
    tint_slot,
)


@struct
class Metal:
    """Eta and k where it was measured, else the reflectance face to face and its tint at the edge; and alphas.

    boost: what light that goes from facet to facet adds, as a factor.
    """

    measured: bool
    first: Vec3
    second: Vec3
    alpha_x: f32
    alpha_y: f32
    boost: Vec3


@kernel
def metal_at(scene, s, kind, q):
    """The parameters at a point of a surface, for a question."""
    alpha_x, alpha_y = anisotropic_alphas(
        number_slot(scene, s, BSDF_ROUGHNESS), slot(scene, s.material, BSDF_ANISOTROPY)[0]
    )
    alpha_x, alpha_y = regularized(scene, alpha_x, alpha_y, q.blurred)
    # An index of refraction is no colour.
    measured = kind == MEASURED_METAL_KIND
    first = colour_slot(scene, s, BSDF_COLOUR) if measured else base_colour_slot(scene, s)
    second = tint_slot(scene, s, BSDF_EDGE)
    m = Metal(measured, first, second, alpha_x, alpha_y, white())
    if is_smooth(m):
        return m
    # The average over the hemisphere by two points, exact for cubics (Gauss's quadrature with the weight 2 cos).
    average = (
        metal_reflectance(scene, m, f32(0.35505103)) * 0.36391723
        + metal_reflectance(scene, m, f32(0.84494897)) * 0.63608277
    )
    boost = energy_compensation(scene, q.wo.z, alpha_x, alpha_y, average)
    return Metal(measured, first, second, alpha_x, alpha_y, boost)


@kernel
def tinted_metal_reflectance(scene, m, cosine):
    """A scene of metals that are given by a colour."""
    return tinted_reflectance(cosine, m.first, m.second)


@kernel(needs=MEASURED_METALS, otherwise=tinted_metal_reflectance)
def metal_reflectance(scene, m, cosine):
    """Fraction of light that a facet reflects."""
    if m.measured:
        return Vec3(
            conductor_reflectance(cosine, m.first.x, m.second.x),
            conductor_reflectance(cosine, m.first.y, m.second.y),
            conductor_reflectance(cosine, m.first.z, m.second.z),
        )
    return tinted_reflectance(cosine, m.first, m.second)


@kernel
def is_smooth(m):
    """Whether it is a mirror."""
    return max(m.alpha_x, m.alpha_y) < SMOOTH_ALPHA


@kernel
def reflection_density(m, wo, h):
    """Density of reflecting at the facet h that wo sees."""
    return ggx_density(h, m.alpha_x, m.alpha_y) / (4.0 * wo.z * (1.0 + ggx_lambda(wo, m.alpha_x, m.alpha_y)))


@kernel
def eval_metal(scene, m, wo, wi):
    """F times cosine, and density; wo.z > 0."""
    if (wi.z <= 0.0) | is_smooth(m):
        return no_value()
    h = normalize(wo + wi)
    pdf = reflection_density(m, wo, h)
    weight = visible_weight(wo, wi, m.alpha_x, m.alpha_y)
    return BsdfValue(m.boost * metal_reflectance(scene, m, dot(wo, h)) * (weight * pdf), pdf)


@kernel
def sample_metal(scene, m, wo, u, v):
    """Reflect at a facet that wo sees."""
    if is_smooth(m):
        return BsdfSample(mirror_direction(wo), metal_reflectance(scene, m, wo.z), 0.0)
    h = ggx_visible_normal(wo, m.alpha_x, m.alpha_y, u, v)
    wi = reflected(wo, h)
    if wi.z <= 0.0:
        return no_sample()
    weight = m.boost * metal_reflectance(scene, m, dot(wo, h)) * visible_weight(wo, wi, m.alpha_x, m.alpha_y)
    return BsdfSample(wi, weight, reflection_density(m, wo, h))
