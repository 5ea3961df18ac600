"""Reflectance of smooth dielectric surfaces."""

from __future__ import annotations

from ..lang import f32, kernel, sqrt
from ..pack.layout import SCHLICK_FRESNEL
from .vectors import white


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


@kernel
def conductor_reflectance(cosine, eta, k):
    """Fraction of unpolarised light that a metal with the complex index eta + i k reflects (pbrt, 4th ed., 9.3.6)."""
    # Fresnel's equations with complex numbers written out: a^2 + b^2 is |the refracted cosine times the index|^2.
    cosine2 = cosine * cosine
    sine2 = 1.0 - cosine2
    t = eta * eta - k * k - sine2
    both = sqrt(t * t + 4.0 * eta * eta * k * k)
    a = sqrt(max(0.0, 0.5 * (both + t)))
    perpendicular = (both + cosine2 - 2.0 * a * cosine) / (both + cosine2 + 2.0 * a * cosine)
    far = both * cosine2 + sine2 * sine2
    near = 2.0 * a * cosine * sine2
    return 0.5 * perpendicular * (1.0 + (far - near) / (far + near))


@kernel
def schlick_weight(cosine):
    """(1 - cosine)^5, with which reflectance goes from its value face to face to white (Schlick 1994)."""
    m = min(max(1.0 - cosine, 0.0), 1.0)
    m2 = m * m
    return m2 * m2 * m


@kernel
def tinted_reflectance(cosine, face_on, edge):
    """Schlick's reflectance, multiplied by the tint `edge` at the angle of arc cos 1/7, some 82 degrees.

    Kutz, Hasan and Edmondson 2021, Novel aspects of the Adobe Standard Material, section 2.
    """
    at_edge = face_on + (white() - face_on) * f32(0.46266436)
    # cos (1 - cos)^6 at that angle.
    dip = at_edge * (white() - edge) * f32(1.0 / 0.05665277)
    m = min(max(1.0 - cosine, 0.0), 1.0)
    m2 = m * m
    m5 = m2 * m2 * m
    return face_on + (white() - face_on) * m5 - dip * (cosine * m5 * m)
