"""A sheet of glass whose two sides are so near that light goes on where it went: a window pane, a soap bubble."""

from __future__ import annotations

from ...lang import Vec3, f32, kernel, struct
from ...pack.layout import BSDF_COLOUR, BSDF_REFRACTION, BSDF_ROUGHNESS, ENERGY_WHITE
from ..energy import dielectric_compensation
from ..fresnel import exact_fresnel, refracted_cosine
from ..microfacet import (
    SMOOTH_ALPHA,
    anisotropic_alphas,
    ggx_visible_density,
    ggx_visible_normal,
    reflected,
    regularized,
    visible_weight,
)
from ..vectors import dot, normalize, white
from .mirror import mirror_direction
from .values import BsdfSample, BsdfValue, colour_slot, no_sample, no_value, number_slot, slot


@struct
class ThinDielectric:
    """Index of refraction, alpha, tint of what goes through.

    boost: what light that goes from facet to facet adds, as a factor.
    """

    index: f32
    alpha: f32
    tint: Vec3
    boost: f32


@kernel
def thin_dielectric_at(scene, s, q):
    """The parameters at a point of a surface, for a question."""
    alpha, _ = anisotropic_alphas(number_slot(scene, s, BSDF_ROUGHNESS), f32(0.0))
    alpha, _ = regularized(scene, alpha, alpha, q.blurred)
    index = slot(scene, s.material, BSDF_REFRACTION)[0]
    # What goes through is spread as what is reflected is, so both lose as much as facets of metal.
    smooth = alpha < SMOOTH_ALPHA
    boost = f32(1.0) if smooth else dielectric_compensation(scene, ENERGY_WHITE, q.wo.z, alpha, alpha)
    return ThinDielectric(index, alpha, colour_slot(scene, s, BSDF_COLOUR), boost)


@kernel
def sheet_reflectance(m, cosine):
    """Fraction of light reflected by both sides together, after any number of reflections between them.

    R + T^2 R / (1 - R^2), which is 2 R / (1 + R) (pbrt, 4th edition, section 9.5.1).
    """
    once = exact_fresnel(m, cosine, refracted_cosine(cosine, m.index), m.index)
    return 2.0 * once / (1.0 + once)


@kernel
def eval_thin_dielectric(m, wo, wi):
    """F times |cosine|, and density; wo.z > 0, and wi on either side."""
    if (m.alpha < SMOOTH_ALPHA) | (wi.z == 0.0):
        return no_value()
    above = Vec3(wi.x, wi.y, abs(wi.z))
    h = normalize(wo + above)
    cosine = dot(wo, h)
    reflectance = sheet_reflectance(m, cosine)
    share = reflectance if wi.z > 0.0 else 1.0 - reflectance
    tint = white() if wi.z > 0.0 else m.tint
    pdf = share * ggx_visible_density(wo, h, m.alpha, m.alpha) / (4.0 * cosine)
    return BsdfValue(tint * (m.boost * visible_weight(wo, above, m.alpha, m.alpha) * pdf), pdf)


@kernel
def sample_thin_dielectric(m, wo, u, v, choice):
    """Reflect at a facet that wo sees; what goes through is the mirror image of that."""
    if m.alpha < SMOOTH_ALPHA:
        if choice < sheet_reflectance(m, wo.z):
            return BsdfSample(mirror_direction(wo), white(), 0.0)
        return BsdfSample(-wo, m.tint, 0.0)
    h = ggx_visible_normal(wo, m.alpha, m.alpha, u, v)
    cosine = dot(wo, h)
    above = reflected(wo, h)
    if above.z <= 0.0:
        return no_sample()
    reflectance = sheet_reflectance(m, cosine)
    reflects = choice < reflectance
    share = reflectance if reflects else 1.0 - reflectance
    pdf = share * ggx_visible_density(wo, h, m.alpha, m.alpha) / (4.0 * cosine)
    wi = above if reflects else Vec3(above.x, above.y, -above.z)
    tint = white() if reflects else m.tint
    return BsdfSample(wi, tint * (m.boost * visible_weight(wo, above, m.alpha, m.alpha)), pdf)
