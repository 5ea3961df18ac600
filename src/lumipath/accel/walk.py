"""One ray through a GPU tree as single steps, so that a scheduler can choose what a warp does next."""

from __future__ import annotations

from ..kernels.instances import ray_within, root_of
from ..kernels.opacity import stopping_quadric_distance, stops
from ..kernels.rays import Hit, Ray
from ..kernels.vectors import dot, frame_around, to_local, xyz
from ..lang import INF, Vec3, as_float, as_int, f32, get, i32, inverse, kernel, load4, put, sqrt, struct
from ..lang.maths import byte0, byte1, byte2, byte3, exact_mul, exact_sub
from ..pack.layout import CULLING, INSTANCES, OPACITY, QUADRICS, WIDE_TREE
from .bvh4 import INSTANCE_COUNT, LEAVE_COUNT
from .slabs import WIDER

DONE = i32(-(2**31))
# The link of a lane that has no ray to walk.
IDLE = i32(-(2**31) + 1)
_MISS = i32(0x7FFFFFFF)
_TINY = f32(1e-18)
_ENTER = i32(INSTANCE_COUNT)
_LEAVE = i32(LEAVE_COUNT)


@struct
class Walk:
    """A ray on its way.

    link >= 0: a node; < 0: ~(first * 16 + count) of triangles to test, or of an instance to enter or to leave; or DONE,
    or IDLE.
    """

    ray: Ray  # in the coordinates of the instance that it is in
    inverse: Vec3
    primitive: i32  # nearest so far, -1 for none
    instance: i32  # that places it, -1 for none
    link: i32
    depth: i32  # links on the stack
    within: i32  # instance that the ray is in, -1 for none


@kernel
def nonzero(x):
    """x, or something tiny in place of (nearly) 0."""
    return x if abs(x) > _TINY else _TINY


@kernel
def inverse_of(d):
    """1 / d for each component."""
    return Vec3(inverse(nonzero(d.x)), inverse(nonzero(d.y)), inverse(nonzero(d.z)))


@kernel
def start_walk(ray):
    """A ray at the root."""
    return Walk(ray, inverse_of(ray.d), i32(-1), i32(-1), i32(0), i32(0), i32(-1))


@kernel
def go_on(walk, link, depth):
    """The walk at another link."""
    return Walk(walk.ray, walk.inverse, walk.primitive, walk.instance, link, depth, walk.within)


@kernel
def idle(walk):
    """The walk of a lane without a ray."""
    return go_on(walk, IDLE, walk.depth)


@kernel
def binary_step(scene, walk, stack):
    """Test the boxes of both children; four 128-bit loads."""
    nodes = scene.accel.nodes
    base = walk.link * 16
    a = load4(nodes, base)
    b = load4(nodes, base + 4)
    z = load4(nodes, base + 8)
    c = load4(nodes, base + 12)
    o = walk.ray.o
    d = walk.inverse
    ax0 = (a[0] - o.x) * d.x
    ax1 = (a[1] - o.x) * d.x
    ay0 = (a[2] - o.y) * d.y
    ay1 = (a[3] - o.y) * d.y
    az0 = (z[0] - o.z) * d.z
    az1 = (z[1] - o.z) * d.z
    bx0 = (b[0] - o.x) * d.x
    bx1 = (b[1] - o.x) * d.x
    by0 = (b[2] - o.y) * d.y
    by1 = (b[3] - o.y) * d.y
    bz0 = (z[2] - o.z) * d.z
    bz1 = (z[3] - o.z) * d.z
    t = walk.ray.tmax
    a_near = max(max(min(ax0, ax1), min(ay0, ay1)), max(min(az0, az1), 0.0))
    a_far = min(min(max(ax0, ax1), max(ay0, ay1)), max(az0, az1)) * WIDER
    b_near = max(max(min(bx0, bx1), min(by0, by1)), max(min(bz0, bz1), 0.0))
    b_far = min(min(max(bx0, bx1), max(by0, by1)), max(bz0, bz1)) * WIDER
    left = as_int(c[0])
    right = as_int(c[1])
    hit_a = a_near <= min(a_far, t)
    hit_b = b_near <= min(b_far, t)
    depth = walk.depth
    link = DONE
    if hit_a & hit_b:
        swapped = b_near < a_near
        put(stack, depth, left if swapped else right)
        depth = i32(depth + 1)
        link = right if swapped else left
    elif hit_a:
        link = left
    elif hit_b:
        link = right
    elif depth > 0:
        depth = i32(depth - 1)
        link = get(stack, depth)
    return go_on(walk, link, depth)


@kernel
def slab_key(nx, ny, nz, fx, fy, fz, tmax, child):
    """Distance to a box as an integer that sorts alike, its lowest two bits the child's number; _MISS if not hit."""
    near = max(max(nx, ny), max(nz, 0.0))
    far = min(min(fx, fy), fz) * WIDER
    return i32((as_int(near) & i32(-4)) | i32(child)) if near <= min(far, tmax) else _MISS


@kernel
def pick(key, c0, c1, c2, c3):
    """The link that belongs to a key."""
    a = c1 if (key & 1) != 0 else c0
    b = c3 if (key & 1) != 0 else c2
    return b if (key & 2) != 0 else a


@kernel(needs=WIDE_TREE, otherwise=binary_step)
def node_step(scene, walk, stack):
    """Test the boxes of four children in 8-bit coordinates, go to the nearest and push the others; four loads."""
    nodes = scene.accel.nodes
    base = walk.link * 16
    p = load4(nodes, base)
    q = load4(nodes, base + 4)
    r = load4(nodes, base + 8)
    k = load4(nodes, base + 12)
    o = walk.ray.o
    d = walk.inverse
    # A plane lies at origin + step * byte = origin - step * 32768 + step * 32768 * (1 + byte / 32768).
    sx = p[3] * d.x * 32768.0
    sy = q[0] * d.y * 32768.0
    sz = q[1] * d.z * 32768.0
    ox = (p[0] - o.x) * d.x - sx
    oy = (p[1] - o.y) * d.y - sy
    oz = (p[2] - o.z) * d.z - sz
    xl = as_int(q[2])
    xh = as_int(q[3])
    yl = as_int(r[0])
    yh = as_int(r[1])
    zl = as_int(r[2])
    zh = as_int(r[3])
    px = d.x >= 0.0
    py = d.y >= 0.0
    pz = d.z >= 0.0
    nx = xl if px else xh
    fx = xh if px else xl
    ny = yl if py else yh
    fy = yh if py else yl
    nz = zl if pz else zh
    fz = zh if pz else zl
    t = walk.ray.tmax
    k0 = slab_key(
        byte0(nx) * sx + ox,
        byte0(ny) * sy + oy,
        byte0(nz) * sz + oz,
        byte0(fx) * sx + ox,
        byte0(fy) * sy + oy,
        byte0(fz) * sz + oz,
        t,
        0,
    )
    k1 = slab_key(
        byte1(nx) * sx + ox,
        byte1(ny) * sy + oy,
        byte1(nz) * sz + oz,
        byte1(fx) * sx + ox,
        byte1(fy) * sy + oy,
        byte1(fz) * sz + oz,
        t,
        1,
    )
    k2 = slab_key(
        byte2(nx) * sx + ox,
        byte2(ny) * sy + oy,
        byte2(nz) * sz + oz,
        byte2(fx) * sx + ox,
        byte2(fy) * sy + oy,
        byte2(fz) * sz + oz,
        t,
        2,
    )
    k3 = slab_key(
        byte3(nx) * sx + ox,
        byte3(ny) * sy + oy,
        byte3(nz) * sz + oz,
        byte3(fx) * sx + ox,
        byte3(fy) * sy + oy,
        byte3(fz) * sz + oz,
        t,
        3,
    )
    # Sort four keys with five comparisons.
    a0 = min(k0, k1)
    a1 = max(k0, k1)
    a2 = min(k2, k3)
    a3 = max(k2, k3)
    b0 = min(a0, a2)
    b2 = max(a0, a2)
    b1 = min(a1, a3)
    b3 = max(a1, a3)
    m1 = min(b1, b2)
    m2 = max(b1, b2)
    c0 = as_int(k[0])
    c1 = as_int(k[1])
    c2 = as_int(k[2])
    c3 = as_int(k[3])
    depth = walk.depth
    link = DONE
    if b0 != _MISS:
        if m1 != _MISS:
            if m2 != _MISS:
                if b3 != _MISS:
                    put(stack, depth, pick(b3, c0, c1, c2, c3))
                    depth = i32(depth + 1)
                put(stack, depth, pick(m2, c0, c1, c2, c3))
                depth = i32(depth + 1)
            put(stack, depth, pick(m1, c0, c1, c2, c3))
            depth = i32(depth + 1)
        link = pick(b0, c0, c1, c2, c3)
    elif depth > 0:
        depth = i32(depth - 1)
        link = get(stack, depth)
    return go_on(walk, link, depth)


@kernel
def edge(ax, ay, bx, by):
    """Edge function of two corners, never fused, so that the other side of an edge gets exactly its negative."""
    return exact_sub(exact_mul(ax, by), exact_mul(ay, bx))


@kernel
def any_side(scene, positive, negative, both):
    """Triangles are seen from both sides."""
    return positive | negative


@kernel(needs=CULLING, otherwise=any_side)
def seen(scene, positive, negative, both):
    """Triangles are seen from the front, and from behind if they are two-sided."""
    return (positive | negative) if both else positive


@struct
class Direction:
    """A direction of length 1, and by how much a distance along it is longer than the ray's."""

    d: Vec3
    scale: f32


@kernel
def as_it_is(scene, d):
    """Rays of the world have directions of length 1."""
    return Direction(d, 1.0)


@kernel(needs=INSTANCES, otherwise=as_it_is)
def unit_direction(scene, d):
    """The direction with length 1, which it may lack in an instance."""
    scale = inverse(sqrt(dot(d, d)))
    return Direction(d * scale, scale)


@kernel
def triangle_distance(scene, ray, a, b, c):
    """Distance to a triangle, infinity if it is missed; watertight.

    As in `triangles8`, corners are brought into a space in which the ray is the z axis, each by itself, and the edge
    functions there are exact. The space is a rotation of the world instead of a shear: a few operations more, but the
    same ones for every ray, so that the lanes of a warp stay together.
    """
    direction = unit_direction(scene, ray.d)
    basis = frame_around(direction.d)
    p = to_local(basis, xyz(a) - ray.o)
    q = to_local(basis, xyz(b) - ray.o)
    r = to_local(basis, xyz(c) - ray.o)
    u = edge(r.x, r.y, q.x, q.y)
    v = edge(p.x, p.y, r.x, r.y)
    w = edge(q.x, q.y, p.x, p.y)
    positive = (u >= 0.0) & (v >= 0.0) & (w >= 0.0)
    negative = (u <= 0.0) & (v <= 0.0) & (w <= 0.0)
    # A triangle without area divides 0 by 0, and NaN fails the comparisons.
    t = (u * p.z + v * q.z + w * r.z) * inverse(u + v + w) * direction.scale
    inside = seen(scene, positive, negative, b[3] > 0.0)
    return t if inside & (t > 0.0) & (t < ray.tmax) else INF


@kernel
def closed_triangle_distance(scene, ray, within, a, b, c):
    """A scene whose surfaces are all closed."""
    return triangle_distance(scene, ray, a, b, c)


@kernel(needs=OPACITY, otherwise=closed_triangle_distance)
def stopping_triangle_distance(scene, ray, within, a, b, c):
    """Distance to a triangle that stops the ray, infinity if it is missed or lets it through."""
    t = triangle_distance(scene, ray, a, b, c)
    if t < ray.tmax:
        if not stops(scene, as_int(a[3]), within, ray.o, ray.d, t):
            return INF
    return t


@kernel
def primitive_distance_triangle(scene, ray, within, a, b, c):
    """A scene of triangles only."""
    return stopping_triangle_distance(scene, ray, within, a, b, c)


@kernel(needs=QUADRICS, otherwise=primitive_distance_triangle)
def primitive_distance(scene, ray, within, a, b, c):
    """Distance to a triangle or a quadric."""
    if b[3] > 1.5:
        return stopping_quadric_distance(scene, as_int(a[3]), within, ray.o, ray.d, ray.tmax)
    return stopping_triangle_distance(scene, ray, within, a, b, c)


@kernel
def placed_by_none(scene, walk, found):
    """A scene without instances."""
    return i32(-1)


@kernel(needs=INSTANCES, otherwise=placed_by_none)
def placed_by(scene, walk, found):
    """The instance of the nearest hit, after another one was found or not."""
    return walk.within if found else walk.instance


@kernel
def primitive_step(scene, walk, stack, any_hit):
    """Test one primitive of a leaf, then stay for the next one, or go on."""
    code = i32(~walk.link)
    base = (code >> 4) * 12
    a = load4(scene.accel.triangles, base)
    b = load4(scene.accel.triangles, base + 4)
    c = load4(scene.accel.triangles, base + 8)
    ray = walk.ray
    t = primitive_distance(scene, ray, walk.within, a, b, c)
    found = t < ray.tmax
    primitive = as_int(a[3]) if found else walk.primitive
    instance = placed_by(scene, walk, found)
    ray = Ray(ray.o, ray.d, t if found else ray.tmax)
    depth = walk.depth
    link = DONE
    if not (any_hit & found):
        if (code & 15) > 1:
            # The next primitive: first + 1, count - 1.
            link = i32(walk.link - 15)
        elif depth > 0:
            depth = i32(depth - 1)
            link = get(stack, depth)
    return Walk(ray, walk.inverse, primitive, instance, link, depth, walk.within)


@kernel
def enter(scene, walk, stack):
    """Go on in an instance; the ray of the world waits on the stack."""
    instance = i32(~walk.link >> 4)
    ray = walk.ray
    depth = walk.depth
    put(stack, depth, as_int(ray.o.x))
    put(stack, depth + 1, as_int(ray.o.y))
    put(stack, depth + 2, as_int(ray.o.z))
    put(stack, depth + 3, as_int(ray.d.x))
    put(stack, depth + 4, as_int(ray.d.y))
    put(stack, depth + 5, as_int(ray.d.z))
    put(stack, depth + 6, i32(~_LEAVE))
    ray = ray_within(scene, instance, ray)
    link = root_of(scene, instance)
    return Walk(ray, inverse_of(ray.d), walk.primitive, walk.instance, link, i32(depth + 7), instance)


@kernel
def leave(walk, stack):
    """Go on in the world."""
    depth = i32(walk.depth - 6)
    o = Vec3(as_float(get(stack, depth)), as_float(get(stack, depth + 1)), as_float(get(stack, depth + 2)))
    d = Vec3(as_float(get(stack, depth + 3)), as_float(get(stack, depth + 4)), as_float(get(stack, depth + 5)))
    link = DONE
    if depth > 0:
        depth = i32(depth - 1)
        link = get(stack, depth)
    ray = Ray(o, d, walk.ray.tmax)
    return Walk(ray, inverse_of(d), walk.primitive, walk.instance, link, depth, i32(-1))


@kernel(needs=INSTANCES, otherwise=primitive_step)
def leaf_step(scene, walk, stack, any_hit):
    """Enter an instance, leave it, or test one primitive of a leaf."""
    count = ~walk.link & 15
    if count == _ENTER:
        return enter(scene, walk, stack)
    if count == _LEAVE:
        return leave(walk, stack)
    return primitive_step(scene, walk, stack, any_hit)


@kernel
def walk_to_end(scene, ray, any_hit, stack):
    """The whole traversal by one thread."""
    walk = start_walk(ray)
    while walk.link != DONE:
        while walk.link >= 0:
            walk = node_step(scene, walk, stack)
        while (walk.link < 0) & (walk.link != DONE):
            walk = leaf_step(scene, walk, stack, any_hit)
    return Hit(walk.ray.tmax, walk.primitive, walk.instance)
