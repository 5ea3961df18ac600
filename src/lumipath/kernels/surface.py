"""From a hit to the surface there: point, normals, texture coordinates, material."""

from __future__ import annotations

from ..lang import Vec3, as_float, as_int, f32, i32, kernel, load, load4, struct
from ..pack.layout import INSTANCES, MATERIAL_MASK, PRIMITIVE_SIZE, QUADRICS, REACH_SHIFT, VERTEX_DATA, VERTEX_SIZE
from .instances import own_material, placed_reach, placement_of
from .quadrics import normal_to_world, object_normal, object_uv, point_to_object, quadric_at
from .tangents import Tangents, no_tangents, placed_tangents, quadric_tangents, triangle_tangents
from .vectors import cross, dot, normalize, xyz


@struct
class Surface:
    """A point of a surface, as seen by a ray, in world space."""

    p: Vec3
    n: Vec3  # geometric normal, towards the ray's origin
    shading: Vec3  # shading normal, towards the ray's origin
    front: bool  # the geometric normal of the primitive itself points to the ray's origin
    material: i32
    corner: i32  # of a triangle: row of its vertex numbers; -1 otherwise, and where an instance has a material
    u: f32
    v: f32
    w1: f32  # barycentric weights of the second and third corner
    w2: f32
    reach: f32  # greatest coordinate of the primitive, as a power of 2
    tangents: Tangents  # of the texture coordinates
    footprint: f32  # how much of uv a ray covers, along one axis; 0: a point


@struct
class Normals:
    """What is known of a primitive at a point before it is turned to the viewer; n has length 1."""

    n: Vec3
    shading: Vec3
    corner: i32
    u: f32
    v: f32
    w1: f32
    w2: f32
    tangents: Tangents


@kernel
def flat_triangle(scene, primitive, p, n):
    """A triangle without vertex data."""
    return Normals(n, n, i32(-1), 0.0, 0.0, 0.0, 0.0, no_tangents())


@kernel(needs=VERTEX_DATA, otherwise=flat_triangle)
def triangle_normals(scene, primitive, p, n):
    """Interpolate vertex normals and texture coordinates at the point p of a triangle with the normal n."""
    corner = primitive * 4
    i0 = load(scene.corners, corner) * VERTEX_SIZE
    i1 = load(scene.corners, corner + 1) * VERTEX_SIZE
    i2 = load(scene.corners, corner + 2) * VERTEX_SIZE
    p0 = load4(scene.vertices, i0)
    p1 = load4(scene.vertices, i1)
    p2 = load4(scene.vertices, i2)
    n0 = load4(scene.vertices, i0 + 4)
    n1 = load4(scene.vertices, i1 + 4)
    n2 = load4(scene.vertices, i2 + 4)
    # Barycentric coordinates as ratios of areas (Ericson 2005, Real-Time Collision Detection, section 3.4).
    e1 = xyz(p1) - xyz(p0)
    e2 = xyz(p2) - xyz(p0)
    r = p - xyz(p0)
    scale = 1.0 / dot(cross(e1, e2), n)
    w1 = min(max(dot(cross(r, e2), n) * scale, 0.0), 1.0)
    w2 = min(max(dot(cross(e1, r), n) * scale, 0.0), 1.0 - w1)
    w0 = 1.0 - w1 - w2
    smooth = xyz(n0) * w0 + xyz(n1) * w1 + xyz(n2) * w2
    size = dot(smooth, smooth)
    # Vertices without a normal have 0.
    smooth = normalize(smooth) if size > 1e-12 else n
    u = p0[3] * w0 + p1[3] * w1 + p2[3] * w2
    v = n0[3] * w0 + n1[3] * w1 + n2[3] * w2
    tangents = triangle_tangents(scene, e1, e2, p1[3] - p0[3], n1[3] - n0[3], p2[3] - p0[3], n2[3] - n0[3])
    return Normals(n, smooth, corner, u, v, w1, w2, tangents)


@kernel
def only_triangles(scene, primitive, p, n):
    """A scene without quadrics."""
    return triangle_normals(scene, primitive, p, n)


@kernel(needs=QUADRICS, otherwise=only_triangles)
def primitive_normals(scene, primitive, p, n):
    """Normals and texture coordinates of a triangle or a quadric."""
    if primitive < scene.triangle_count:
        return triangle_normals(scene, primitive, p, n)
    q = quadric_at(scene.quadrics, primitive - scene.triangle_count)
    local = point_to_object(q, p)
    local_n = object_normal(q, local)
    u, v = object_uv(q, local, local_n)
    world = normalize(normal_to_world(q, local_n))
    tangents = quadric_tangents(scene, q, local, local_n)
    return Normals(world, world, i32(-1), u, v, 0.0, 0.0, tangents)


@struct
class Found:
    """What is known of a primitive where a ray met it; `normals` in world space."""

    normals: Normals
    material: i32
    reach: f32


@kernel
def found_in_world(scene, hit, p, n, material, reach):
    """A primitive that stands alone."""
    return Found(primitive_normals(scene, hit.primitive, p, n), material, reach)


@kernel(needs=INSTANCES, otherwise=found_in_world)
def found_at(scene, hit, p, n, material, reach):
    """A primitive that stands alone or in an instance: normals go to the world by the inverse transpose."""
    if hit.instance < 0:
        return found_in_world(scene, hit, p, n, material, reach)
    placement = placement_of(scene, hit.instance)
    found = primitive_normals(scene, hit.primitive, point_to_object(placement, p), n)
    own = own_material(scene, hit.instance)
    return Found(
        Normals(
            normalize(normal_to_world(placement, found.n)),
            normalize(normal_to_world(placement, found.shading)),
            found.corner if own < 0 else i32(-1),
            found.u,
            found.v,
            found.w1,
            found.w2,
            placed_tangents(scene, placement, found.tangents),
        ),
        material if own < 0 else own,
        placed_reach(scene, hit.instance, reach, p, hit.t),
    )


@kernel
def surface_at(scene, ray, hit):
    """The surface that a hit found."""
    row = load4(scene.primitives, hit.primitive * PRIMITIVE_SIZE)
    p = ray.o + ray.d * hit.t
    word = as_int(row[3])
    reach = as_float(((word >> REACH_SHIFT) & 255) << 23)
    placed = found_at(scene, hit, p, xyz(row), i32(word & MATERIAL_MASK), reach)
    found = placed.normals
    front = dot(found.n, ray.d) < 0.0
    n = found.n if front else -found.n
    shading = found.shading if dot(found.shading, n) >= 0.0 else -found.shading
    # A shading normal that turns away from the viewer would make the surface black: use the true one there.
    shading = shading if dot(shading, ray.d) < 0.0 else n
    return Surface(
        p,
        n,
        shading,
        front,
        placed.material,
        found.corner,
        found.u,
        found.v,
        found.w1,
        found.w2,
        placed.reach,
        found.tangents,
        0.0,
    )


@kernel
def changed(s, shading, material, footprint):
    """The surface with some parts replaced."""
    return Surface(
        s.p,
        s.n,
        shading,
        s.front,
        material,
        s.corner,
        s.u,
        s.v,
        s.w1,
        s.w2,
        s.reach,
        s.tangents,
        footprint,
    )


@kernel
def with_shading(s, shading):
    """The surface with another shading normal."""
    return changed(s, shading, s.material, s.footprint)


@kernel
def with_material(s, material):
    """The surface of another material."""
    return changed(s, s.shading, material, s.footprint)


@kernel
def with_footprint(s, footprint):
    """The surface as a ray sees it that covers so much of its texture coordinates."""
    return changed(s, s.shading, s.material, footprint)
