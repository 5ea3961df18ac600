"""Packets of rays through the 8-wide tree: a step tests one box, or one triangle, against all rays of a packet.

Rays are sorted first, so that all of a packet go towards the same octant along the same dominant axis: near and far
sides of boxes and the axes of the watertight triangle test are then the same for all. Where few rays of a packet are
left, they go on one by one (`trace8`), and so they do in instances.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from ..kernels.quadrics import quadric_distance
from ..kernels.rays import Ray
from ..lang import (
    INF,
    Vec3,
    as_int,
    count_bits,
    f32,
    get,
    i32,
    kernel,
    load,
    lowest_bit,
    put,
    stack_floats,
    stack_ints,
    store,
)
from ..lang.host import vector_units
from ..lang.lanes import Simd, bits, fused, gather, select, smallest, store_lanes, vmax, vmin
from ..pack.layout import CULLING, INSTANCES, OPACITY, QUADRICS
from .bvh8 import CELLS, GROUP_SIZE, NODE_SIZE, PRIMITIVE_MASK, TWO_SIDED
from .slabs import WIDER
from .trace8 import leads_to_instance, trace_slot
from .triangles8 import sheared_distance

WIDTH = 16 if vector_units()[1] >= 512 else 8
"""Rays in a packet: one register of the widest kind."""

_simd = Simd(WIDTH)
load_lanes, splat, index = _simd.load, _simd.splat, _simd.index

_W = i32(WIDTH)
_NODE = i32(NODE_SIZE)
_GROUP = i32(GROUP_SIZE)
_PRIMITIVE = i32(PRIMITIVE_MASK)
_TWO_SIDED = i32(TWO_SIDED)
_CELLS = i32(CELLS)
_CELL_COUNT = i32(CELLS**3)
_RUNS = i32(24)  # octants times dominant axes
SORT_KEYS = 24 * CELLS**3
_KEYS = i32(SORT_KEYS)
_TINY = f32(1e-18)
_ROUNDING = f32(2.0**-23)

# This many rays or fewer go on one by one.
FEW = i32(5 if WIDTH == 16 else 3)


class Rays(NamedTuple):
    """Rays as arrays of components.

    t: maximum distance, then that of the hit; slot: what was hit, see `trace_slot`; instance: which one places it, -1
    for none; it is left alone in scenes without instances, and where nothing was hit.
    """

    ox: NDArray[Any]
    oy: NDArray[Any]
    oz: NDArray[Any]
    dx: NDArray[Any]
    dy: NDArray[Any]
    dz: NDArray[Any]
    t: NDArray[Any]
    slot: NDArray[Any]
    instance: NDArray[Any]


class Order(NamedTuple):
    """Scratch for sorting: ray numbers in order, a key for each ray, and a start for each key."""

    rays: NDArray[Any]
    keys: NDArray[Any]
    starts: NDArray[Any]


@kernel
def spread_bits(x):
    """The two lowest bits of x, three places apart."""
    return (x & 1) | ((x & 2) << 2)


@kernel
def cell_of(bounds, axis, x):
    """Cell of a coordinate, from 0 to CELLS - 1."""
    cell = (x - load(bounds, axis)) * load(bounds, axis + 4)
    return i32(min(max(cell, 0.0), f32(_CELLS) - 1.0))


@kernel
def run_of(dx, dy, dz):
    """Number of a ray's dominant axis and octant: 8 times the axis, plus 4, 2, 1 where x, y, z point backwards."""
    ax = abs(dx)
    ay = abs(dy)
    az = abs(dz)
    axis = i32(0) if (ax > ay) & (ax > az) else (i32(1) if ay > az else i32(2))
    return i32(axis * 8 + (4 if dx < 0.0 else 0) + (2 if dy < 0.0 else 0) + (1 if dz < 0.0 else 0))


@kernel
def sort_rays(accel, rays, n, order, coherent):
    """Counting sort by run, and within a run, unless the rays are `coherent` already, by cell of the origin."""
    # The keys in a loop of their own, which becomes SIMD code.
    for i in range(n):
        key = run_of(load(rays.dx, i), load(rays.dy, i), load(rays.dz, i)) * _CELL_COUNT
        if not coherent:
            x = spread_bits(cell_of(accel.bounds, 0, load(rays.ox, i)))
            y = spread_bits(cell_of(accel.bounds, 1, load(rays.oy, i)))
            z = spread_bits(cell_of(accel.bounds, 2, load(rays.oz, i)))
            key = i32(key + (x | (y << 1) | (z << 2)))
        store(order.keys, i, i32(key))
    for key in range(_KEYS):
        store(order.starts, key, i32(0))
    for i in range(n):
        key = load(order.keys, i)
        store(order.starts, key, i32(load(order.starts, key) + 1))
    at = i32(0)
    for key in range(_KEYS):
        count = load(order.starts, key)
        store(order.starts, key, at)
        at = i32(at + count)
    for i in range(n):
        key = load(order.keys, i)
        place = load(order.starts, key)
        store(order.rays, place, i32(i))
        store(order.starts, key, i32(place + 1))


@kernel
def lane_inverse(d):
    """1 / d, with a huge number of the same sign where d is (nearly) 0."""
    tiny = select(d < 0.0, splat(-_TINY), splat(_TINY))
    return 1.0 / select((d > _TINY) | (d < -_TINY), d, tiny)


@kernel
def either_side(scene, number, backwards, u, v, w):
    """Inside of a triangle, from either side."""
    return ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0))


@kernel(needs=CULLING, otherwise=either_side)
def visible_side(scene, number, backwards, u, v, w):
    """Inside of a triangle, and on its front unless it is two-sided."""
    positive = (u >= 0.0) & (v >= 0.0) & (w >= 0.0)
    negative = (u <= 0.0) & (v <= 0.0) & (w <= 0.0)
    if (number & _TWO_SIDED) != 0:
        return positive | negative
    return negative if backwards else positive


@kernel
def no_quadrics(scene, number, rays, order, at, active, t, slot, instance, group, k):
    """A scene without quadrics."""
    return i32(0)


@kernel(needs=QUADRICS, otherwise=no_quadrics)
def try_quadric(scene, number, rays, order, at, active, t, slot, instance, group, k):
    """The rays of a packet against one quadric, one by one; 1 if any hit. t, slot, instance are stack arrays."""
    primitive = number & _PRIMITIVE
    if primitive < scene.triangle_count:
        return i32(0)
    found = i32(0)
    while active != 0:
        lane = lowest_bit(active)
        active &= active - 1
        i = load(order.rays, at + lane)
        o = Vec3(load(rays.ox, i), load(rays.oy, i), load(rays.oz, i))
        d = Vec3(load(rays.dx, i), load(rays.dy, i), load(rays.dz, i))
        s = quadric_distance(scene.quadrics, i32(primitive - scene.triangle_count), o, d, get(t, lane))
        if s < get(t, lane):
            put(t, lane, s)
            put(slot, lane, i32(group * 8 + k))
            put_instance(scene, instance, lane, i32(-1))
            found = i32(1)
    return found


@kernel
def no_instance(scene, numbers, i, instance):
    """A scene without instances."""


@kernel(needs=INSTANCES, otherwise=no_instance)
def put_instance(scene, numbers, i, instance):
    """Note the instance of a hit, in an array on the stack or elsewhere."""
    store(numbers, i, instance)


@kernel
def note_no_instance(scene, numbers, hit):
    """A scene without instances."""


@kernel(needs=INSTANCES, otherwise=note_no_instance)
def note_world(scene, numbers, hit):
    """Note for the lanes of `hit` that they have met what is in no instance."""
    store_lanes(numbers, 0, select(hit, i32(-1), load_lanes(numbers, 0)))


@kernel(precise=True)
def edge(ax, ay, bx, by):
    """Edge function of two corners, never fused, so that the other side of an edge gets exactly its negative."""
    return ax * by - ay * bx


@kernel(precise=True)
def lane_shear(dx, dy, dz):
    """The shear that makes the rays of a run the z axis, rounded as in `shear_of`."""
    sz = 1.0 / dz
    return -1.0 * (dx * sz), -1.0 * (dy * sz), sz


@kernel
def trace_packet(scene, rays, order, at, count, run, any_hit):
    """Trace `count` rays of one run, those at `at` and behind in `order`."""
    accel = scene.accel
    nodes = accel.nodes
    groups = accel.groups
    ids = load_lanes(order.rays, at)
    ox = gather(rays.ox, ids)
    oy = gather(rays.oy, ids)
    oz = gather(rays.oz, ids)
    dx = gather(rays.dx, ids)
    dy = gather(rays.dy, ids)
    dz = gather(rays.dz, ids)
    t = gather(rays.t, ids)
    slot = splat(i32(-1))
    live = index() < i32(count)

    # Boxes: which of their sides is near is the same for all rays of a run.
    ix = lane_inverse(dx)
    iy = lane_inverse(dy)
    iz = lane_inverse(dz)
    bx = -1.0 * ox * ix
    by = -1.0 * oy * iy
    bz = -1.0 * oz * iz
    ex = vmax(bx, -1.0 * bx) * _ROUNDING
    ey = vmax(by, -1.0 * by) * _ROUNDING
    ez = vmax(bz, -1.0 * bz) * _ROUNDING
    nx = bx - ex
    ny = by - ey
    nz = bz - ez
    fx = bx + ex
    fy = by + ey
    fz = bz + ez
    octant = run & 7
    near_x = i32(8) if (octant & 4) != 0 else i32(0)
    near_y = i32(24) if (octant & 2) != 0 else i32(16)
    near_z = i32(40) if (octant & 1) != 0 else i32(32)
    far_x = i32(8) - near_x
    far_y = i32(40) - near_y
    far_z = i32(72) - near_z

    # Triangles: the shear that makes a ray the z axis (see `triangles8`), with the same axes for all.
    axis = run >> 3
    pz = axis * 8
    px = i32(0) if axis == 2 else i32(pz + 8)
    py = i32(0) if px == 16 else i32(px + 8)
    sox = ox if px == 0 else (oy if px == 8 else oz)
    soy = ox if py == 0 else (oy if py == 8 else oz)
    soz = ox if pz == 0 else (oy if pz == 8 else oz)
    sdx = dx if px == 0 else (dy if px == 8 else dz)
    sdy = dx if py == 0 else (dy if py == 8 else dz)
    sx, sy, sz = lane_shear(sdx, sdy, dx if pz == 0 else (dy if pz == 8 else dz))
    backwards = ((octant & 4) if axis == 0 else ((octant & 2) if axis == 1 else (octant & 1))) != 0

    links = stack_ints(456)
    nearest = stack_floats(456)
    distances = stack_floats(7296)
    lane_t = stack_floats(16)
    lane_slot = stack_ints(16)
    lane_instance = stack_ints(16)
    put(links, 0, i32(0))
    store_lanes(distances, 0, splat(f32(0.0)))
    depth = 1
    while depth > 0:
        depth -= 1
        on = live & (load_lanes(distances, depth * _W) < t)
        active = bits(on)
        if active == 0:
            continue
        link = get(links, depth)

        # Few rays are faster alone.
        if (count_bits(active) <= FEW) | leads_to_instance(scene, link):
            store_lanes(lane_t, 0, t)
            store_lanes(lane_slot, 0, slot)
            while active != 0:
                lane = lowest_bit(active)
                active &= active - 1
                i = load(order.rays, at + lane)
                o = Vec3(load(rays.ox, i), load(rays.oy, i), load(rays.oz, i))
                d = Vec3(load(rays.dx, i), load(rays.dy, i), load(rays.dz, i))
                found = trace_slot(scene, Ray(o, d, get(lane_t, lane)), link, any_hit)
                if found.primitive >= 0:
                    put(lane_t, lane, f32(-1.0) if any_hit else found.t)
                    put(lane_slot, lane, found.primitive)
                    put_instance(scene, lane_instance, lane, found.instance)
            t = load_lanes(lane_t, 0)
            slot = load_lanes(lane_slot, 0)
            if any_hit:
                live = live & (t > 0.0)
                if bits(live) == 0:
                    break
            continue

        # A leaf: its triangles one after the other.
        if link < -1:
            group = i32(-2 - link)
            for k in range(8):
                base = group * _GROUP + k
                number = as_int(load(groups, base + 72))
                if number < 0:
                    break
                az = load(groups, base + pz) - soz
                bz0 = load(groups, base + 24 + pz) - soz
                cz = load(groups, base + 48 + pz) - soz
                ax = fused(az, sx, load(groups, base + px) - sox)
                ay = fused(az, sy, load(groups, base + py) - soy)
                bx0 = fused(bz0, sx, load(groups, base + 24 + px) - sox)
                by0 = fused(bz0, sy, load(groups, base + 24 + py) - soy)
                cx = fused(cz, sx, load(groups, base + 48 + px) - sox)
                cy = fused(cz, sy, load(groups, base + 48 + py) - soy)
                u = edge(cx, cy, bx0, by0)
                v = edge(ax, ay, cx, cy)
                w = edge(bx0, by0, ax, ay)
                hit = on & visible_side(scene, number, backwards, u, v, w)
                if bits(hit) != 0:
                    distance = sheared_distance(u, v, w, az, bz0, cz, sz)
                    hit = hit & (distance > 0.0) & (distance < t)
                    slot = select(hit, i32(group * 8 + k), slot)
                    note_world(scene, lane_instance, hit)
                    if any_hit:
                        t = select(hit, -1.0, t)
                        live = live & (t > 0.0)
                        on = on & live
                    else:
                        t = select(hit, distance, t)
                store_lanes(lane_t, 0, t)
                store_lanes(lane_slot, 0, slot)
                if (
                    try_quadric(scene, number, rays, order, at, bits(on), lane_t, lane_slot, lane_instance, group, k)
                    != 0
                ):
                    t = load_lanes(lane_t, 0)
                    slot = load_lanes(lane_slot, 0)
                    if any_hit:
                        t = select(slot >= 0, -1.0, t)
                        live = live & (t > 0.0)
                        on = on & live
            if any_hit:
                if bits(live) == 0:
                    break
            continue

        # A node: its children, kept on the stack in order, the nearest on top.
        base = link * _NODE
        first = depth
        for k in range(8):
            child = as_int(load(nodes, base + 48 + k))
            if child == -1:
                continue
            near = vmax(
                vmax(ix * load(nodes, base + near_x + k) + nx, iy * load(nodes, base + near_y + k) + ny),
                vmax(iz * load(nodes, base + near_z + k) + nz, 0.0),
            )
            far = vmin(
                vmin(ix * load(nodes, base + far_x + k) + fx, iy * load(nodes, base + far_y + k) + fy),
                iz * load(nodes, base + far_z + k) + fz,
            )
            hit = on & (near <= vmin(far * WIDER, t))
            if bits(hit) == 0:
                continue
            near = select(hit, near, INF)
            place = depth
            depth += 1
            if not any_hit:
                key = smallest(near)
                while place > first and get(nearest, place - 1) < key:
                    put(nearest, place, get(nearest, place - 1))
                    put(links, place, get(links, place - 1))
                    store_lanes(distances, place * _W, load_lanes(distances, (place - 1) * _W))
                    place -= 1
                put(nearest, place, key)
            put(links, place, child)
            store_lanes(distances, place * _W, near)

    store_lanes(lane_t, 0, t)
    store_lanes(lane_slot, 0, slot)
    for k in range(count):
        i = load(order.rays, at + k)
        store(rays.t, i, get(lane_t, k))
        store(rays.slot, i, get(lane_slot, k))
        put_instance(scene, rays.instance, i, get(lane_instance, k))


@kernel
def trace_by_packets(scene, rays, n, order, any_hit, coherent):
    """Trace n rays; their t and slot receive the nearest hit, or, with `any_hit`, a slot of -1 where nothing is."""
    sort_rays(scene.accel, rays, n, order, coherent)
    # Behind the last ray a packet reads on: any ray will do.
    for i in range(n, n + _W):
        store(order.rays, i, load(order.rays, n - 1))
    at = i32(0)
    for run in range(_RUNS):
        # After sorting, a key's start is where the next key's rays begin.
        end = load(order.starts, (run + 1) * _CELL_COUNT - 1)
        while at < end:
            count = min(i32(end - at), _W)
            trace_packet(scene, rays, order, at, count, i32(run), any_hit)
            at = i32(at + count)


@kernel(needs=OPACITY, otherwise=trace_by_packets)
def trace_rays(scene, rays, n, order, any_hit, coherent):
    """The same one by one: where rays go through a surface, each has to look for itself."""
    for i in range(n):
        o = Vec3(load(rays.ox, i), load(rays.oy, i), load(rays.oz, i))
        d = Vec3(load(rays.dx, i), load(rays.dy, i), load(rays.dz, i))
        found = trace_slot(scene, Ray(o, d, load(rays.t, i)), i32(0), any_hit)
        store(rays.t, i, found.t)
        store(rays.slot, i, found.primitive)
        put_instance(scene, rays.instance, i, found.instance)
