"""Rays against boxes so that no box is ever missed (Ize 2013, Robust BVH Ray Traversal)."""

from __future__ import annotations

from ..lang import f32, kernel, struct

# Twice the roundings of the distance to a plane.
WIDER = f32(1.0 + 6 * 2.0**-24)
_ROUNDING = f32(2.0**-23)
_TINY = f32(1e-18)


@struct
class Slab:
    """One axis of a ray: a plane at p lies at the distance p * inverse + near, if it is left out too early, or + far.

    One fused operation a plane; what rounding may have done to the origin's part is in the difference of near and far.
    """

    inverse: f32
    near: f32
    far: f32


@kernel
def slab_of(o, d):
    """One axis of a ray; a direction of (nearly) 0 counts as tiny."""
    inverse = 1.0 / (d if abs(d) > _TINY else _TINY)
    origin = -o * inverse
    slack = abs(origin) * _ROUNDING
    return Slab(inverse, origin - slack, origin + slack)
