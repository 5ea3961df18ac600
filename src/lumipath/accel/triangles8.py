"""One ray against eight triangles, watertight (Woop, Benthin and Wald 2013, Watertight Ray/Triangle Intersection).

Corners are sheared into a space in which the ray is the z axis. There the three edge functions of a triangle are
computed without fused or reordered operations, so that neighbours agree exactly about their common edge, and no ray can
slip between them.
"""

from __future__ import annotations

from ..lang import f32, i32, kernel, struct
from ..lang.lanes import Simd, bits_of_lanes, fused
from ..pack.layout import CULLING
from .bvh8 import GROUP_SIZE, TWO_SIDED

load8 = Simd(8).load

_GROUP = i32(GROUP_SIZE)
_TWO_SIDED = i32(TWO_SIDED)


@struct
class Shear:
    """How a ray becomes the z axis: rows of the permuted axes in a group, origin in that order, and the shear."""

    x: i32
    y: i32
    z: i32
    ox: f32
    oy: f32
    oz: f32
    sx: f32
    sy: f32
    sz: f32


@kernel
def component(v, axis):
    """v[axis]."""
    return v.x if axis == 0 else (v.y if axis == 1 else v.z)


@kernel(precise=True)
def shear_of(o, d):
    """The longest axis of the direction becomes z; the other two keep their handedness."""
    ax = abs(d.x)
    ay = abs(d.y)
    az = abs(d.z)
    z = i32(0) if (ax > ay) & (ax > az) else (i32(1) if ay > az else i32(2))
    x = i32(0) if z == 2 else i32(z + 1)
    y = i32(0) if x == 2 else i32(x + 1)
    dz = component(d, z)
    first = y if dz < 0.0 else x
    second = x if dz < 0.0 else y
    sz = 1.0 / dz
    sx = component(d, first) * sz
    sy = component(d, second) * sz
    return Shear(
        i32(first * 8),
        i32(second * 8),
        i32(z * 8),
        component(o, first),
        component(o, second),
        component(o, z),
        sx,
        sy,
        sz,
    )


@kernel
def facing_all(scene, groups, base, u, v, w):
    """Inside of a triangle, from either side."""
    return ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0))


@kernel(needs=CULLING, otherwise=facing_all)
def inside(scene, groups, base, u, v, w):
    """Inside of a triangle, and on its front unless it is two-sided."""
    front = (u >= 0.0) & (v >= 0.0) & (w >= 0.0)
    two_sided = (bits_of_lanes(load8(groups, base + 72)) & _TWO_SIDED) > 0
    return front | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0) & two_sided)


@kernel(precise=True)
def sheared_distance(u, v, w, az, bz, cz, sz):
    """Distance to the plane of a triangle by its edge functions, rounded alike for single rays and packets."""
    # A triangle without area divides 0 by 0, and NaN fails the comparisons.
    return fused(u, az, fused(v, bz, w * cz)) * sz / (u + v + w)


@kernel(precise=True)
def hit_group(scene, groups, group, ray, tmax):
    """One ray, as its `Shear`, against the triangles of a group: lanes that are hit in (0, tmax), and distances."""
    base = group * _GROUP
    az = load8(groups, base + ray.z) - ray.oz
    bz = load8(groups, base + 24 + ray.z) - ray.oz
    cz = load8(groups, base + 48 + ray.z) - ray.oz
    ax = fused(az, -ray.sx, load8(groups, base + ray.x) - ray.ox)
    ay = fused(az, -ray.sy, load8(groups, base + ray.y) - ray.oy)
    bx = fused(bz, -ray.sx, load8(groups, base + 24 + ray.x) - ray.ox)
    by = fused(bz, -ray.sy, load8(groups, base + 24 + ray.y) - ray.oy)
    cx = fused(cz, -ray.sx, load8(groups, base + 48 + ray.x) - ray.ox)
    cy = fused(cz, -ray.sy, load8(groups, base + 48 + ray.y) - ray.oy)
    u = cx * by - cy * bx
    v = ax * cy - ay * cx
    w = bx * ay - by * ax
    t = sheared_distance(u, v, w, az, bz, cz, ray.sz)
    return inside(scene, groups, base, u, v, w) & (t > 0.0) & (t < tmax), t
