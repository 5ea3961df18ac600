"""One ray through the 8-wide tree: a step tests eight boxes or eight triangles at once.

A link to an instance takes the ray into its coordinates. Below what waits on the stack in there lies the link by which
it is left again.
"""

from __future__ import annotations

from ..kernels.instances import ray_within, root_of
from ..kernels.opacity import stopping_quadric_distance, stops
from ..kernels.rays import Hit, Ray
from ..lang import (
    INF,
    as_float,
    as_int,
    count_bits,
    f32,
    get,
    i32,
    kernel,
    load,
    lowest_bit,
    prefetch,
    put,
    stack_floats,
    struct,
)
from ..lang.lanes import Simd, bits, compress, permute, select, smallest, store_lanes, vmax, vmin
from ..pack.layout import INSTANCES, OPACITY, QUADRICS
from .bvh8 import GROUP_SIZE, INSTANCE_LINK, LEAVE, NODE_SIZE, PRIMITIVE_MASK
from .slabs import WIDER, Slab, slab_of
from .triangles8 import Shear, hit_group, shear_of

load8 = Simd(8).load
index8 = Simd(8).index

_NODE = i32(NODE_SIZE)
_GROUP = i32(GROUP_SIZE)
_PRIMITIVE = i32(PRIMITIVE_MASK)
_INSTANCE = i32(INSTANCE_LINK)
_LEAVE = i32(LEAVE)


@kernel
def primitive_of(accel, slot):
    """Primitive number of a slot, -1 for none."""
    if slot < 0:
        return i32(-1)
    group = slot >> 3
    return i32(as_int(load(accel.groups, group * _GROUP + 72 + (slot & 7))) & _PRIMITIVE)


@kernel
def nearest_lane(scene, group, ray, hit, distance, found, within):
    """`found`, or the nearest of the lanes that are hit."""
    if bits(hit) == 0:
        return found
    t = smallest(select(hit, distance, INF))
    return Hit(t, i32(group * 8 + lowest_bit(bits((distance == t) & hit))), within)


@kernel(needs=OPACITY, otherwise=nearest_lane)
def nearest_triangle(scene, group, ray, hit, distance, found, within):
    """`found`, or the nearest of the lanes that are hit and stop the ray."""
    while bits(hit) != 0:
        t = smallest(select(hit, distance, INF))
        lane = i32(lowest_bit(bits((distance == t) & hit)))
        slot = i32(group * 8 + lane)
        if stops(scene, primitive_of(scene.accel, slot), within, ray.o, ray.d, t):
            return Hit(t, slot, within)
        hit = hit & ~(index8() == lane)
    return found


@kernel
def no_quadric(scene, group, ray, hit, within):
    """A scene without quadrics."""
    return hit


@kernel(needs=QUADRICS, otherwise=no_quadric)
def nearest_quadric(scene, group, ray, hit, within):
    """`hit`, or a nearer quadric of the group, for a ray within an instance, -1 for none."""
    t = hit.t
    slot = hit.primitive
    instance = hit.instance
    base = group * _GROUP + 72
    for k in range(8):
        number = as_int(load(scene.accel.groups, base + k))
        if number >= 0:
            primitive = number & _PRIMITIVE
            if primitive >= scene.triangle_count:
                s = stopping_quadric_distance(scene, primitive, within, ray.o, ray.d, t)
                if s < t:
                    t = s
                    slot = i32(group * 8 + k)
                    instance = within
    return Hit(t, slot, instance)


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


@struct
class Aim:
    """A ray as boxes and triangles are tested against it."""

    ray: Ray
    x: Slab
    y: Slab
    z: Slab
    near_x: i32  # where a node has the sides of boxes that the ray meets first
    near_y: i32
    near_z: i32
    octant: i32
    sheared: Shear
    within: i32  # the instance in whose coordinates it is, -1 for none


@kernel
def aim_of(ray, within):
    """A ray, ready for boxes and triangles."""
    x = slab_of(ray.o.x, ray.d.x)
    y = slab_of(ray.o.y, ray.d.y)
    z = slab_of(ray.o.z, ray.d.z)
    near_x = i32(0) if x.inverse >= 0.0 else i32(8)
    near_y = i32(16) if y.inverse >= 0.0 else i32(24)
    near_z = i32(32) if z.inverse >= 0.0 else i32(40)
    octant = (4 if x.inverse < 0.0 else 0) + (2 if y.inverse < 0.0 else 0) + (1 if z.inverse < 0.0 else 0)
    return Aim(ray, x, y, z, near_x, near_y, near_z, i32(octant), shear_of(ray.o, ray.d), within)


@kernel
def leads_to_no_instance(scene, link):
    """A scene without instances."""
    return False


@kernel(needs=INSTANCES, otherwise=leads_to_no_instance)
def leads_to_instance(scene, link):
    """Whether a link enters an instance or leaves it."""
    return link <= _INSTANCE


@kernel
def walk8(scene, ray, link, any_hit, stack, distances):
    """The traversal of `trace_slot`, with its stack."""
    nodes = scene.accel.nodes
    aim = aim_of(ray, i32(-1))
    t = ray.tmax
    slot = i32(-1)
    instance = i32(-1)
    depth = 0
    while True:
        if link >= 0:
            x = aim.x
            y = aim.y
            z = aim.z
            near_x = aim.near_x
            near_y = aim.near_y
            near_z = aim.near_z
            far_x = i32(8) - near_x
            far_y = i32(40) - near_y
            far_z = i32(72) - near_z
            far_to_near = index8() ^ i32(7 - aim.octant)
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
                    fetch(scene.accel, as_int(get(stack, depth - 1)))
                continue
        elif leads_to_instance(scene, link):
            if link == _LEAVE:
                aim = aim_of(ray, i32(-1))
            else:
                entered = i32(_INSTANCE - link)
                # Nothing is too near for the way out.
                put(stack, depth, as_float(_LEAVE))
                put(distances, depth, f32(-1.0))
                depth += 1
                aim = aim_of(ray_within(scene, entered, ray), entered)
                link = root_of(scene, entered)
                continue
        elif link < -1:
            group = i32(-2 - link)
            hit, distance = hit_group(scene, scene.accel.groups, group, aim.sheared, t)
            nearest = Hit(t, slot, instance)
            nearest = nearest_triangle(scene, group, aim.ray, hit, distance, nearest, aim.within)
            nearest = nearest_quadric(scene, group, aim.ray, nearest, aim.within)
            t = nearest.t
            slot = nearest.primitive
            instance = nearest.instance
            if any_hit and slot >= 0:
                return Hit(t, slot, instance)
        # Take up what waits, unless something nearer was found meanwhile.
        while True:
            if depth == 0:
                return Hit(t, slot, instance)
            depth -= 1
            if get(distances, depth) < t:
                break
        link = as_int(get(stack, depth))


@kernel
def trace_world(scene, ray, link, any_hit):
    """A scene without instances."""
    return walk8(scene, ray, link, any_hit, stack_floats(512), stack_floats(512))


@kernel(needs=INSTANCES, otherwise=trace_world)
def trace_slot(scene, ray, link, any_hit):
    """Nearest hit (or any, if `any_hit`) of a ray in the subtree at `link`, its slot in place of the primitive.

    A slot is 8 times the group plus the lane, -1 for none. The children of a node lie in slots by octant, so that slot
    order, turned by the ray's octant, is near to far; one compression pushes all that were hit.
    """
    return walk8(scene, ray, link, any_hit, stack_floats(1024), stack_floats(1024))


@kernel
def trace_ray(scene, ray, any_hit):
    """The nearest hit of a ray, or any hit."""
    found = trace_slot(scene, ray, i32(0), any_hit)
    return Hit(found.t, primitive_of(scene.accel, found.primitive), found.instance)


@kernel
def intersect(scene, ray):
    """The nearest hit of a ray."""
    return trace_ray(scene, ray, False)


@kernel
def occluded(scene, ray):
    """Whether anything is on the ray."""
    return trace_slot(scene, ray, i32(0), True).primitive >= 0
