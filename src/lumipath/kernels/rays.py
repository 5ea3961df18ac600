"""Rays, hits, and leaving a surface."""

from __future__ import annotations

from ..lang import INF, Vec3, f32, i32, kernel, struct
from .vectors import max_abs_component

# 2^-16: some hundred roundings. Less lets a ray hit what it leaves, more lets light through corners.
OFFSET = f32(1.5e-5)
# 8 roundings of the coordinates of the primitive that was hit.
_REACH = f32(4.8e-7)
# Of a point on a light, for shadow rays to it.
TARGET_OFFSET = f32(1e-6)
# A shadow ray ends this fraction before its target, which itself lies in front of the light.
SHADOW_END = f32(0.999998)


@struct
class Ray:
    """Points o + t d for 0 < t < tmax; d has length 1, but for rays in an instance; tmax = 0: no ray."""

    o: Vec3
    d: Vec3
    tmax: f32


@struct
class Hit:
    """The nearest primitive on a ray, -1 for none, its distance, and the instance that places it, -1 for none."""

    t: f32
    primitive: i32
    instance: i32


@kernel
def no_ray():
    """A ray that is not there."""
    return Ray(Vec3(0, 0, 0), Vec3(0, 0, 1), 0.0)


@kernel
def offset_point(p, n, t, reach):
    """A start for rays that leave the surface at p to the side of n.

    The rounding error of p grows with its coordinates, with the distance t at which it was found, and with the greatest
    coordinate `reach` of the primitive; so does the offset, and scenes of any size work.
    """
    return p + n * ((max_abs_component(p) + t) * OFFSET + reach * _REACH)


@kernel
def endless_ray(o, d):
    """A ray without an end."""
    return Ray(o, d, INF)
