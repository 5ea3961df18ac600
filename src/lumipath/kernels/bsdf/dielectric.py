"""A smooth dielectric interface: reflect or refract (pbrt, 4th edition, section 9.5).

Radiance is carried as basic radiance, L / n^2, which refraction does not change; so a lamp inside glass has the
radiance that its material says, whatever the index.
"""

from __future__ import annotations

from ...lang import Vec3, inverse, kernel, struct
from ..fresnel import dielectric_reflectance, refracted_cosine
from ..vectors import white
from .mirror import mirror_direction


@struct
class DielectricSample:
    """The direction drawn, what to multiply by, and whether light went through."""

    wi: Vec3
    weight: Vec3
    refracted: bool


@kernel
def refracted_direction(wo, through, eta):
    """Snell's law: the tangential part shrinks by the ratio of the indices; `through` from `refracted_cosine`."""
    scale = inverse(eta)
    return Vec3(-wo.x * scale, -wo.y * scale, -through)


@kernel
def sample_dielectric(scene, lobes, wo, entering, u):
    """Reflect with the probability that Fresnel's equations give, else refract.

    Args:
        scene: for its features.
        lobes: the material at the point.
        wo: local direction to the viewer, wo.z > 0.
        entering: whether the viewer is outside.
        u: random number.
    """
    eta = lobes.index if entering else inverse(lobes.index)
    through = refracted_cosine(wo.z, eta)
    reflectance = dielectric_reflectance(scene, wo.z, through, eta)
    if u < reflectance:
        tint = lobes.reflection_tint if through > 0.0 else lobes.internal_tint
        return DielectricSample(mirror_direction(wo), tint, False)
    return DielectricSample(refracted_direction(wo, through, eta), white(), True)
