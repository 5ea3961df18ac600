"""Rays, hits, and leaving a surface."""

from __future__ import annotations

from ..lang import INF, Vec3, f32, i32, kernel, struct
from .vectors import max_abs_component

# 2^-16: some hundred roundings. Less lets a ray hit what it leaves, more lets light through corners.
OFFSET = f32(1.5e-5)
# A shadow ray ends this fraction before its light, so that it does not hit the light itself.
SHADOW_END = f32(0.9999)


@struct
class Ray:
    """Points o + t d for 0 < t < tmax; d has length 1; tmax = 0: no ray."""

    o: Vec3
    d: Vec3
    tmax: f32


@struct
class Hit:
    """The nearest primitive on a ray, -1 for none, and its distance."""

    t: f32
    primitive: i32


@kernel
def no_ray():
    """A ray that is not there."""
    return Ray(Vec3(0, 0, 0), Vec3(0, 0, 1), 0.0)


@kernel
def offset_point(p, n, t):
    """A start for rays that leave the surface at p to the side of n; p was found at distance t from its ray's origin.

    The rounding error of p grows with its coordinates and with t, and so does the offset: scenes of any size work.
    """
    return p + n * ((max_abs_component(p) + t) * OFFSET)


@kernel
def endless_ray(o, d):
    """A ray without an end."""
    return Ray(o, d, INF)
