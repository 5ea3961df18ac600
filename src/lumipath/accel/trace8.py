"""One ray through the 8-wide tree: a step tests eight boxes or eight triangles at once."""

from __future__ import annotations

from ..kernels.opacity import stopping_quadric_distance, stops
from ..kernels.rays import Hit
from ..lang import (
    INF,
    as_int,
    count_bits,
    get,
    i32,
    kernel,
    load,
    lowest_bit,
    prefetch,
    stack_floats,
)
from ..lang.lanes import Simd, bits, compress, permute, select, smallest, store_lanes, vmax, vmin
from ..pack.layout import OPACITY, QUADRICS
from .bvh8 import GROUP_SIZE, NODE_SIZE, PRIMITIVE_MASK
from .slabs import WIDER, slab_of
from .triangles8 import hit_group, shear_of

load8 = Simd(8).load
index8 = Simd(8).index

_NODE = i32(NODE_SIZE)
_GROUP = i32(GROUP_SIZE)
_PRIMITIVE = i32(PRIMITIVE_MASK)


@kernel
def primitive_of(accel, slot):
    """Primitive number of a slot, -1 for none."""
    if slot < 0:
        return i32(-1)
    group = slot >> 3
    return i32(as_int(load(accel.groups, group * _GROUP + 72 + (slot & 7))) & _PRIMITIVE)


@kernel
def nearest_lane(scene, group, o, d, hit, distance, found):
    """`found`, or the nearest of the lanes that are hit."""
    if bits(hit) == 0:
        return found
    t = smallest(select(hit, distance, INF))
    return Hit(t, i32(group * 8 + lowest_bit(bits((distance == t) & hit))))


@kernel(needs=OPACITY, otherwise=nearest_lane)
def nearest_triangle(scene, group, o, d, hit, distance, found):
    """`found`, or the nearest of the lanes that are hit and stop the ray."""
    while bits(hit) != 0:
        t = smallest(select(hit, distance, INF))
        lane = i32(lowest_bit(bits((distance == t) & hit)))
        slot = i32(group * 8 + lane)
        if stops(scene, primitive_of(scene.accel, slot), o, d, t):
            return Hit(t, slot)
        hit = hit & ~(index8() == lane)
    return found


@kernel
def no_quadric(scene, group, o, d, hit):
    """A scene without quadrics."""
    return hit


@kernel(needs=QUADRICS, otherwise=no_quadric)
def nearest_quadric(scene, group, o, d, hit):
    """`hit`, or a nearer quadric of the group."""
    t = hit.t
    slot = hit.primitive
    base = group * _GROUP + 72
    for k in range(8):
        number = as_int(load(scene.accel.groups, base + k))
        if number >= 0:
            primitive = number & _PRIMITIVE
            if primitive >= scene.triangle_count:
                s = stopping_quadric_distance(scene, primitive, o, d, t)
                if s < t:
                    t = s
                    slot = i32(group * 8 + k)
    return Hit(t, slot)


@kernel
def fetch(accel, link):
    """Ask for the memory of what a link leads to."""
    if link >= 0:
        base = link * _NODE
        prefetch(accel.nodes, base)
        prefetch(accel.nodes, base + 16)
        prefetch(accel.nodes, base + 32)
        prefetch(accel.nodes, base + 48)
    else:
        base = (-2 - link) * _GROUP
        prefetch(accel.groups, base)
        prefetch(accel.groups, base + 16)
        prefetch(accel.groups, base + 32)
        prefetch(accel.groups, base + 48)
        prefetch(accel.groups, base + 64)


@kernel
def trace_slot(scene, o, d, link, tmax, any_hit):
    """Nearest hit (or any, if `any_hit`) of a ray in the subtree at `link`: its distance and its slot, -1 for none.

    A slot is 8 times the group plus the lane. The children of a node lie in slots by octant, so that slot order, turned
    by the ray's octant, is near to far; one compression pushes all that were hit.
    """
    accel = scene.accel
    nodes = accel.nodes
    x = slab_of(o.x, d.x)
    y = slab_of(o.y, d.y)
    z = slab_of(o.z, d.z)
    near_x = i32(0) if x.inverse >= 0.0 else i32(8)
    near_y = i32(16) if y.inverse >= 0.0 else i32(24)
    near_z = i32(32) if z.inverse >= 0.0 else i32(40)
    far_x = i32(8) - near_x
    far_y = i32(40) - near_y
    far_z = i32(72) - near_z
    octant = (4 if x.inverse < 0.0 else 0) + (2 if y.inverse < 0.0 else 0) + (1 if z.inverse < 0.0 else 0)
    far_to_near = index8() ^ i32(7 - octant)
    sheared = shear_of(o, d)
    t = tmax
    slot = i32(-1)
    stack = stack_floats(512)
    distances = stack_floats(512)
    depth = 0
    while True:
        if link >= 0:
            base = link * _NODE
            near = vmax(
                vmax(
                    load8(nodes, base + near_x) * x.inverse + x.near,
                    load8(nodes, base + near_y) * y.inverse + y.near,
                ),
                vmax(load8(nodes, base + near_z) * z.inverse + z.near, 0.0),
            )
            far = vmin(
                vmin(
                    load8(nodes, base + far_x) * x.inverse + x.far,
                    load8(nodes, base + far_y) * y.inverse + y.far,
                ),
                load8(nodes, base + far_z) * z.inverse + z.far,
            )
            near = permute(near, far_to_near)
            hit = near <= vmin(permute(far, far_to_near) * WIDER, t)
            store_lanes(distances, depth, compress(near, hit))
            store_lanes(stack, depth, compress(permute(load8(nodes, base + 48), far_to_near), hit))
            found = count_bits(bits(hit))
            depth += found
            if found > 0:
                depth -= 1
                link = as_int(get(stack, depth))
                if depth > 0:
                    fetch(accel, as_int(get(stack, depth - 1)))
                continue
        elif link < -1:
            group = i32(-2 - link)
            hit, distance = hit_group(scene, accel.groups, group, sheared, t)
            nearest = nearest_triangle(scene, group, o, d, hit, distance, Hit(t, slot))
            nearest = nearest_quadric(scene, group, o, d, nearest)
            t = nearest.t
            slot = nearest.primitive
            if any_hit and slot >= 0:
                return Hit(t, slot)
        # Take up what waits, unless something nearer was found meanwhile.
        while True:
            if depth == 0:
                return Hit(t, slot)
            depth -= 1
            if get(distances, depth) < t:
                break
        link = as_int(get(stack, depth))


@kernel
def trace_ray(scene, ray, any_hit):
    """The nearest hit of a ray, or any hit."""
    found = trace_slot(scene, ray.o, ray.d, i32(0), ray.tmax, any_hit)
    return Hit(found.t, primitive_of(scene.accel, found.primitive))


@kernel
def intersect(scene, ray):
    """The nearest hit of a ray."""
    return trace_ray(scene, ray, False)


@kernel
def occluded(scene, ray):
    """Whether anything is on the ray."""
    return trace_slot(scene, ray.o, ray.d, i32(0), ray.tmax, True).primitive >= 0
