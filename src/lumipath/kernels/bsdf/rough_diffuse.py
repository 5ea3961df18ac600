"""Rough diffuse reflection that loses no energy.

Portsmouth, Kutz and Hill 2025, "EON: A practical energy-preserving rough diffuse BRDF": Fujii's form of the model of
Oren and Nayar (1994), and what it loses between facets added back.
"""

from __future__ import annotations

from ...lang import INV_PI, PI, Vec3, f32, kernel, sqrt, struct
from ...pack.layout import BSDF_ROUGHNESS
from ..functions import acos_turn
from ..vectors import dot
from ..warps import cosine_hemisphere, cosine_hemisphere_pdf
from .values import BsdfSample, BsdfValue, base_colour_slot, no_value, number_slot

# Constants of Fujii's model: 1/2 - 2 / (3 pi), and 2/3 - 28 / (15 pi).
_C1 = f32(0.2877934)
_C2 = f32(0.07248821)


@struct
class RoughDiffuse:
    """Albedo, and roughness from 0 to 1."""

    albedo: Vec3
    roughness: f32


@kernel
def rough_diffuse_at(scene, s):
    """The parameters at a point of a surface."""
    return RoughDiffuse(base_colour_slot(scene, s), number_slot(scene, s, BSDF_ROUGHNESS))


@kernel
def single_scattering_albedo(cosine, roughness):
    """Fraction of light that white facets reflect at once, of all that arrives at the cosine."""
    sine = sqrt(max(0.0, 1.0 - cosine * cosine))
    theta = PI * acos_turn(cosine)
    # tan (1 - sin^3) - sin, without the pole of the tangent: (1 - sin^3) / cos = cos (1 + sin + sin^2) / (1 + sin).
    lifted = sine * cosine * (1.0 + sine + sine * sine) / (1.0 + sine)
    g = sine * (theta - sine * cosine) + 0.6666667 * (lifted - sine)
    return (1.0 + roughness * g * INV_PI) / (1.0 + _C1 * roughness)


@kernel
def eval_rough_diffuse(m, wo, wi):
    """F times cosine, and density; wo.z > 0."""
    if wi.z <= 0.0:
        return no_value()
    # Facets that see the light once.
    s = dot(wo, wi) - wo.z * wi.z
    t = max(wo.z, wi.z) if s > 0.0 else f32(1.0)
    a = 1.0 / (1.0 + _C1 * m.roughness)
    single = a * (1.0 + m.roughness * s / t)
    # Light that goes from facet to facet leaves evenly, coloured by each of them.
    lost_o = 1.0 - single_scattering_albedo(wo.z, m.roughness)
    lost_i = 1.0 - single_scattering_albedo(wi.z, m.roughness)
    mean = a * (1.0 + _C2 * m.roughness)
    multiple = lost_o * lost_i / max(1.0 - mean, 1e-7)
    rho = m.albedo
    deeper = Vec3(
        rho.x * rho.x * mean / (1.0 - rho.x * (1.0 - mean)),
        rho.y * rho.y * mean / (1.0 - rho.y * (1.0 - mean)),
        rho.z * rho.z * mean / (1.0 - rho.z * (1.0 - mean)),
    )
    cosine = wi.z * INV_PI
    return BsdfValue((rho * single + deeper * multiple) * cosine, cosine_hemisphere_pdf(wi.z))


@kernel
def sample_rough_diffuse(m, wo, u, v):
    """Draw by the cosine."""
    wi = cosine_hemisphere(u, v)
    value = eval_rough_diffuse(m, wo, wi)
    return BsdfSample(wi, value.f / max(value.pdf, 1e-20), value.pdf)
