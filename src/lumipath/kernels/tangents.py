"""How texture coordinates lie on a surface."""

from __future__ import annotations

from ..lang import Vec3, f32, inverse, kernel, load4, sqrt, struct
from ..pack.layout import ANISOTROPY, BSDF_ANISOTROPY, BSDF_SIZE, SPHERE, TANGENTS
from .functions import cos_sin_turn
from .vectors import Frame, black, cross, dot, frame_around, normalize


@struct
class Tangents:
    """Change of the point per unit of u and of v, metres; 0 where there are no coordinates."""

    u: Vec3
    v: Vec3


@kernel
def no_tangents():
    """No texture coordinates."""
    return Tangents(black(), black())


@kernel
def no_triangle_tangents(scene, e1, e2, u1, v1, u2, v2):
    """Nobody asks."""
    return no_tangents()


@kernel(needs=TANGENTS, otherwise=no_triangle_tangents)
def triangle_tangents(scene, e1, e2, u1, v1, u2, v2):
    """Of a triangle, by the edges from its first corner and the coordinates at their ends, relative to that corner."""
    determinant = u1 * v2 - u2 * v1
    if not abs(determinant) > 1e-20:
        return no_tangents()
    scale = 1.0 / determinant
    return Tangents((e1 * v2 - e2 * v1) * scale, (e2 * u1 - e1 * u2) * scale)


@kernel
def no_quadric_tangents(scene, q, p, n):
    """Nobody asks."""
    return no_tangents()


@kernel(needs=TANGENTS, otherwise=no_quadric_tangents)
def quadric_tangents(scene, q, p, n):
    """Of a quadric `q` at the point p with the normal n, both in object space; see `object_uv`."""
    r = sqrt(p.x * p.x + p.y * p.y)
    around = Vec3(-p.y, p.x, 0.0) * 6.2831855
    if q.kind == SPHERE:
        outward = 1.0 / max(r, 1e-20)
        return tangents_to_world(q, around, Vec3(-p.z * p.x * outward, -p.z * p.y * outward, r) * 3.1415927)
    if abs(n.z) == 1.0:
        size = max(q.bottom, q.top) * 2.0
        return tangents_to_world(q, Vec3(size, 0.0, 0.0), Vec3(0.0, size, 0.0))
    slope = (q.top - q.bottom) / max(r, 1e-20)
    return tangents_to_world(q, around, Vec3(p.x * slope, p.y * slope, q.height))


@kernel
def tangents_to_world(q, u, v):
    """Object space to world: the inverse of world to object, by its rows."""
    a = cross(q.y, q.z)
    b = cross(q.z, q.x)
    c = cross(q.x, q.y)
    scale = 1.0 / dot(q.x, a)
    return Tangents((a * u.x + b * u.y + c * u.z) * scale, (a * v.x + b * v.y + c * v.z) * scale)


@kernel
def no_placed_tangents(scene, placement, tangents):
    """Nobody asks."""
    return tangents


@kernel(needs=TANGENTS, otherwise=no_placed_tangents)
def placed_tangents(scene, placement, tangents):
    """From the coordinates of what an instance places to the world."""
    return tangents_to_world(placement, tangents.u, tangents.v)


@kernel
def uv_frame(tangents, n):
    """A frame around n whose t runs along u, and b towards increasing v; any one where there are no coordinates."""
    t = tangents.u - n * dot(n, tangents.u)
    size = dot(t, t)
    if not size > dot(tangents.u, tangents.u) * 1e-10:
        return frame_around(n)
    t = t * inverse(sqrt(size))
    # Mirrored coordinates make the frame left-handed.
    side = f32(1.0) if dot(cross(tangents.u, tangents.v), n) >= 0.0 else f32(-1.0)
    return Frame(t, cross(n, t) * side, n)


@kernel
def any_frame(scene, s):
    """A scene in which no highlight has a direction."""
    return frame_around(s.shading)


@kernel(needs=ANISOTROPY, otherwise=any_frame)
def shading_frame(scene, s):
    """The frame of a BSDF: z is the shading normal, x the direction along u, turned by the material's rotation."""
    frame = uv_frame(s.tangents, s.shading)
    c, sine = cos_sin_turn(load4(scene.bsdfs, s.material * BSDF_SIZE + BSDF_ANISOTROPY)[1])
    return Frame(frame.t * c + frame.b * sine, frame.b * c - frame.t * sine, frame.n)


@kernel
def uv_per_metre(tangents):
    """Length in uv of a metre on the surface, as the root of the ratio of areas; 0 where there are no coordinates."""
    normal = cross(tangents.u, tangents.v)
    area = sqrt(dot(normal, normal))
    return inverse(sqrt(area)) if area > 0.0 else f32(0.0)


@kernel
def normal_in(frame, x, y, z):
    """The unit vector of such local coordinates."""
    return normalize(frame.t * x + frame.b * y + frame.n * z)
