"""Reflectance of smooth dielectric surfaces."""

from __future__ import annotations

from ..lang import f32, kernel, sqrt
from ..pack.layout import SCHLICK_FRESNEL


@kernel
def refracted_cosine(cosine, eta):
    """|cos| of the refracted ray by Snell's law, 0 for total internal reflection.

    Args:
        cosine: of the angle of incidence, from 0 to 1.
        eta: index of refraction of the other side relative to the side of incidence.
    """
    return sqrt(max(0.0, 1.0 - (1.0 - cosine * cosine) / (eta * eta)))


@kernel
def exact_fresnel(scene, cosine, refracted, eta):
    """Fresnel's equations for unpolarised light (pbrt, 4th edition, section 9.3.5)."""
    parallel = (eta * cosine - refracted) / (eta * cosine + refracted)
    perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted)
    return 0.5 * (parallel * parallel + perpendicular * perpendicular)


@kernel(needs=SCHLICK_FRESNEL, otherwise=exact_fresnel)
def fresnel_or_schlick(scene, cosine, refracted, eta):
    """Schlick's approximation (1994), on the side of the thinner medium as it must be."""
    f0 = (eta - 1.0) / (eta + 1.0)
    f0 = f0 * f0
    m = 1.0 - (cosine if eta > 1.0 else refracted)
    m2 = m * m
    return f0 + (1.0 - f0) * (m2 * m2 * m)


@kernel
def dielectric_reflectance(scene, cosine, refracted, eta):
    """Fraction of light that is reflected, 1 for total internal reflection; `refracted` from `refracted_cosine`."""
    return fresnel_or_schlick(scene, cosine, refracted, eta) if refracted > 0.0 else f32(1.0)
