"""Ideal diffuse reflection, for albedo 1: the caller multiplies by the albedo."""

from __future__ import annotations

from ...lang import INV_PI, f32, kernel
from ...pack.layout import UNIFORM_HEMISPHERE
from ..warps import cosine_hemisphere, cosine_hemisphere_pdf, uniform_hemisphere, uniform_hemisphere_pdf


@kernel
def lambert_eval(cosine):
    """F times cosine."""
    return max(cosine, 0.0) * INV_PI


@kernel
def cosine_direction(scene, u, v):
    """Density proportional to the cosine."""
    return cosine_hemisphere(u, v)


@kernel(needs=UNIFORM_HEMISPHERE, otherwise=cosine_direction)
def lambert_direction(scene, u, v):
    """Draw wi."""
    return uniform_hemisphere(u, v)


@kernel
def cosine_pdf(scene, cosine):
    """Density of `cosine_direction`."""
    return cosine_hemisphere_pdf(cosine)


@kernel(needs=UNIFORM_HEMISPHERE, otherwise=cosine_pdf)
def lambert_pdf(scene, cosine):
    """Density of `lambert_direction` per solid angle."""
    return uniform_hemisphere_pdf(cosine)


@kernel
def cosine_weight(scene, cosine):
    """Every direction counts the same."""
    return f32(1.0)


@kernel(needs=UNIFORM_HEMISPHERE, otherwise=cosine_weight)
def lambert_weight(scene, cosine):
    """F times cosine over density of a drawn direction."""
    return 2.0 * cosine
