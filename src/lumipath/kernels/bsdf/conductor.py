"""Metals: GGX microfacets whose reflectance is that of a conductor (pbrt, 4th edition, section 9.6)."""

from __future__ import annotations

from ...lang import Vec3, f32, inverse, kernel, struct
from ...pack.layout import BSDF_ANISOTROPY, BSDF_COLOUR, BSDF_EDGE, BSDF_ROUGHNESS, MEASURED_METAL_KIND
from ..fresnel import conductor_reflectance, tinted_reflectance
from ..microfacet import anisotropic_alphas, ggx_density, ggx_lambda, ggx_visible_normal, reflected
from ..vectors import dot, normalize
from .mirror import mirror_direction
from .values import BsdfSample, BsdfValue, base_colour_slot, colour_slot, no_sample, no_value, number_slot, slot

# Rougher than this by alpha, a lobe is sampled as one; below it is a mirror to any camera.
SMOOTH_ALPHA = f32(1e-3)


@struct
class Metal:
    """Eta and k where it was measured, else the reflectance face to face and its tint at the edge; and alphas."""

    measured: bool
    first: Vec3
    second: Vec3
    alpha_x: f32
    alpha_y: f32


@kernel
def metal_at(scene, s, kind):
    """The parameters at a point of a surface."""
    alpha_x, alpha_y = anisotropic_alphas(
        number_slot(scene, s, BSDF_ROUGHNESS), slot(scene, s.material, BSDF_ANISOTROPY)[0]
    )
    # An index of refraction is no colour.
    measured = kind == MEASURED_METAL_KIND
    first = colour_slot(scene, s, BSDF_COLOUR) if measured else base_colour_slot(scene, s)
    second = colour_slot(scene, s, BSDF_EDGE)
    return Metal(measured, first, second, alpha_x, alpha_y)


@kernel
def metal_reflectance(m, cosine):
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
def eval_metal(m, wo, wi):
    """F times cosine, and density; wo.z > 0."""
    if (wi.z <= 0.0) | is_smooth(m):
        return no_value()
    h = normalize(wo + wi)
    facing_o = ggx_lambda(wo, m.alpha_x, m.alpha_y)
    facing_i = ggx_lambda(wi, m.alpha_x, m.alpha_y)
    k = ggx_density(h, m.alpha_x, m.alpha_y) / (4.0 * wo.z)
    # Masking and shadowing go together, since both grow with the height of a facet (Heitz 2014, section 6).
    f = metal_reflectance(m, dot(wo, h)) * (k * inverse(1.0 + facing_o + facing_i))
    return BsdfValue(f, k * inverse(1.0 + facing_o))


@kernel
def sample_metal(m, wo, u, v):
    """Reflect at a facet that wo sees."""
    if is_smooth(m):
        return BsdfSample(mirror_direction(wo), metal_reflectance(m, wo.z), 0.0)
    h = ggx_visible_normal(wo, m.alpha_x, m.alpha_y, u, v)
    wi = reflected(wo, h)
    if wi.z <= 0.0:
        return no_sample()
    facing_o = ggx_lambda(wo, m.alpha_x, m.alpha_y)
    facing_i = ggx_lambda(wi, m.alpha_x, m.alpha_y)
    pdf = ggx_density(h, m.alpha_x, m.alpha_y) / (4.0 * wo.z * (1.0 + facing_o))
    weight = metal_reflectance(m, dot(wo, h)) * ((1.0 + facing_o) / (1.0 + facing_o + facing_i))
    return BsdfSample(wi, weight, pdf)
