"""Rough glass: GGX microfacets that reflect or refract (Walter et al. 2007; pbrt, 4th edition, section 9.7).

Radiance is carried as basic radiance, L / n^2, which refraction does not change.
"""

from __future__ import annotations

from ...lang import Vec3, as_int, f32, i32, inverse, kernel, struct
from ...pack.layout import BSDF_ANISOTROPY, BSDF_COLOUR, BSDF_EDGE, BSDF_REFRACTION, BSDF_ROUGHNESS
from ..energy import dielectric_compensation
from ..fresnel import dielectric_reflectance, refracted_cosine
from ..microfacet import (
    SMOOTH_ALPHA,
    anisotropic_alphas,
    ggx_visible_density,
    ggx_visible_normal,
    reflected,
    refracted,
    regularized,
    visible_weight,
)
from ..vectors import dot, normalize
from .dielectric import refracted_direction
from .mirror import mirror_direction
from .values import BsdfSample, BsdfValue, colour_slot, no_sample, no_value, number_slot, slot, tint_slot

# With indices nearer to each other nothing is bent that could be told, and half vectors have no digits.
_SAME_INDEX = f32(1e-3)


@struct
class RoughDielectric:
    """Index of refraction beyond the surface relative to this side, alphas, tints.

    boost: what light that goes from facet to facet adds, as a factor.
    """

    eta: f32
    alpha_x: f32
    alpha_y: f32
    reflection: Vec3
    transmission: Vec3
    boost: f32


@kernel
def rough_dielectric_at(scene, s, q):
    """The parameters at a point of a surface, for a question."""
    alpha_x, alpha_y = anisotropic_alphas(
        number_slot(scene, s, BSDF_ROUGHNESS), slot(scene, s.material, BSDF_ANISOTROPY)[0]
    )
    alpha_x, alpha_y = regularized(scene, alpha_x, alpha_y, q.blurred)
    reflection = tint_slot(scene, s, BSDF_EDGE)
    transmission = colour_slot(scene, s, BSDF_COLOUR)
    m = RoughDielectric(q.eta, alpha_x, alpha_y, reflection, transmission, 1.0)
    row = slot(scene, s.material, BSDF_REFRACTION)
    # Between two media that both are not vacuum the index is another one, for which there is no table.
    if is_smooth(m) | (abs(q.eta / (row[0] if s.front else inverse(row[0])) - 1.0) > _SAME_INDEX):
        return m
    table = as_int(row[1])
    boost = dielectric_compensation(scene, table if s.front else i32(table + 1), q.wo.z, alpha_x, alpha_y)
    return RoughDielectric(q.eta, alpha_x, alpha_y, reflection, transmission, boost)


@kernel
def is_smooth(m):
    """Whether it is clear glass, which no other strategy than this one can find a way through."""
    return (max(m.alpha_x, m.alpha_y) < SMOOTH_ALPHA) | (abs(m.eta - 1.0) < _SAME_INDEX)


@kernel
def facet_reflectance(scene, m, cosine):
    """Fraction of light that a facet reflects, seen at the cosine."""
    return dielectric_reflectance(scene, cosine, refracted_cosine(cosine, m.eta), m.eta)


@kernel
def refraction_jacobian(m, wo, wi, h):
    """Solid angle of h over that of the refracted wi (pbrt, 4th edition, 9.36)."""
    across = dot(wi, h) + dot(wo, h) / m.eta
    return abs(dot(wi, h)) / (across * across)


@kernel
def eval_rough_dielectric(scene, m, wo, wi):
    """F times |cosine|, and density; wo.z > 0, and wi on either side."""
    if is_smooth(m) | (wi.z == 0.0):
        return no_value()
    reflects = wi.z > 0.0
    # The facet that would send light from wi to wo; it looks up.
    h = normalize(wo + wi * (f32(1.0) if reflects else m.eta))
    h = h if h.z > 0.0 else -h
    cosine = dot(wo, h)
    if (cosine <= 0.0) | ((dot(wi, h) > 0.0) != reflects):
        return no_value()
    reflectance = facet_reflectance(scene, m, cosine)
    density = ggx_visible_density(wo, h, m.alpha_x, m.alpha_y)
    tint = m.reflection if reflects else m.transmission
    share = reflectance if reflects else 1.0 - reflectance
    pdf = share * density * (0.25 / cosine if reflects else refraction_jacobian(m, wo, wi, h))
    return BsdfValue(tint * (m.boost * visible_weight(wo, wi, m.alpha_x, m.alpha_y) * pdf), pdf)


@kernel
def sample_smooth(scene, m, wo, choice):
    """A flat surface."""
    through = refracted_cosine(wo.z, m.eta)
    if choice < dielectric_reflectance(scene, wo.z, through, m.eta):
        return BsdfSample(mirror_direction(wo), m.reflection, 0.0)
    return BsdfSample(refracted_direction(wo, through, m.eta), m.transmission, 0.0)


@kernel
def sample_rough_dielectric(scene, m, wo, u, v, choice):
    """Reflect or refract at a facet that wo sees, with the probability that Fresnel's equations give for that facet."""
    if is_smooth(m):
        return sample_smooth(scene, m, wo, choice)
    h = ggx_visible_normal(wo, m.alpha_x, m.alpha_y, u, v)
    cosine = dot(wo, h)
    reflectance = facet_reflectance(scene, m, cosine)
    reflects = choice < reflectance
    wi = reflected(wo, h) if reflects else refracted(wo, h, refracted_cosine(cosine, m.eta), m.eta)
    # Light that a facet sends into the surface, or refracts out of it, has gone from facet to facet.
    if (cosine <= 0.0) | ((wi.z > 0.0) != reflects) | (wi.z == 0.0):
        return no_sample()
    density = ggx_visible_density(wo, h, m.alpha_x, m.alpha_y)
    share = reflectance if reflects else 1.0 - reflectance
    pdf = share * density * (0.25 / cosine if reflects else refraction_jacobian(m, wo, wi, h))
    tint = m.reflection if reflects else m.transmission
    return BsdfSample(wi, tint * (m.boost * visible_weight(wo, wi, m.alpha_x, m.alpha_y)), pdf)
