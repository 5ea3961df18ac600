"""Exact quadrics under affine transforms: the unit sphere, and cones about z (cylinders among them).

Rays go to object space, where their direction keeps its length in world units, so that distances need no conversion.
"""

from __future__ import annotations

from ..lang import INF, PI, Vec3, as_int, f32, i32, kernel, load4, sqrt, struct
from ..pack.layout import CAPPED_CONE, QUADRIC_SIZE, ROUND_LIGHTS, SPHERE
from .functions import acos_turn, atan2_turn, cos_sin_turn
from .vectors import cross, dot, frame_around, length, normalize, to_world, xyz
from .warps import SPHERE_AREA, uniform_disc, uniform_sphere


@struct
class Quadric:
    """A quadric's record: world to object, and its shape."""

    x: Vec3
    y: Vec3
    z: Vec3
    translation: Vec3
    kind: i32
    bottom: f32  # radius at z = 0
    top: f32  # radius at z = height
    height: f32


@struct
class ObjectPoint:
    """A point of a quadric in object space, with its outward unit normal."""

    p: Vec3
    n: Vec3


@kernel
def quadric_at(quadrics, index):
    """The quadric of that number."""
    row = index * QUADRIC_SIZE
    x = load4(quadrics, row)
    y = load4(quadrics, row + 4)
    z = load4(quadrics, row + 8)
    shape = load4(quadrics, row + 12)
    return Quadric(xyz(x), xyz(y), xyz(z), Vec3(x[3], y[3], z[3]), as_int(shape[0]), shape[1], shape[2], shape[3])


# Distances are rounded as written, so that a ray meets a quadric at the same bits wherever the code is inlined.


@kernel(precise=True)
def plain_dot(a, b):
    """Scalar product, each operation rounded by itself."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel(precise=True)
def vector_to_object(q, v):
    """A world direction in object space."""
    return Vec3(plain_dot(q.x, v), plain_dot(q.y, v), plain_dot(q.z, v))


@kernel(precise=True)
def point_to_object(q, p):
    """A world point in object space."""
    return vector_to_object(q, p) + q.translation


@kernel
def normal_to_world(q, n):
    """An object normal in world space, not normalised: the transpose of world to object."""
    return q.x * n.x + q.y * n.y + q.z * n.z


@kernel
def area_scale(q, n):
    """World area over object area where the unit object normal is n: |det M| |M^-T n|."""
    return length(normal_to_world(q, n)) / abs(dot(q.x, cross(q.y, q.z)))


@kernel(precise=True)
def sphere_distance(o, d, tmin, tmax):
    """Nearest t in (tmin, tmax) with |o + t d| = 1, else infinity."""
    # From the point nearest to the centre no digits cancel (Haines et al. 2019, Ray Tracing Gems, chapter 7).
    dd = plain_dot(d, d)
    middle = -plain_dot(o, d) / dd
    nearest = o + d * middle
    rest = 1.0 - plain_dot(nearest, nearest)
    if not rest >= 0.0:
        return INF
    half = sqrt(rest / dd)
    t = middle - half
    if t <= tmin:
        t = middle + half
    return t if (t > tmin) & (t < tmax) else INF


@kernel(precise=True)
def disc_distance(o, d, height, radius, tmin, tmax):
    """T in (tmin, tmax) where the ray meets the disc at z = height around the z axis, else infinity."""
    t = (height - o.z) / d.z
    x = o.x + d.x * t
    y = o.y + d.y * t
    return t if (t > tmin) & (t < tmax) & (x * x + y * y <= radius * radius) else INF


@kernel(precise=True)
def mantle_root(o, d, height, middle, t, tmin, tmax):
    """`middle + t` if it is in (tmin, tmax) and the point at t lies between the ends of the cone, else infinity."""
    z = o.z + d.z * t
    world = middle + t
    return world if (world > tmin) & (world < tmax) & (z >= 0.0) & (z <= height) else INF


@kernel(precise=True)
def cone_distance(q, o, d, tmin, tmax):
    """Nearest t in (tmin, tmax) on the mantle or a cap, else infinity."""
    best = tmax
    # Again from the point nearest to the centre.
    middle = -(plain_dot(o, d) - 0.5 * q.height * d.z) / plain_dot(d, d)
    near = o + d * middle
    slope = (q.top - q.bottom) / q.height
    radius = q.bottom + slope * near.z
    a = d.x * d.x + d.y * d.y - slope * slope * d.z * d.z
    b = near.x * d.x + near.y * d.y - slope * radius * d.z
    c = near.x * near.x + near.y * near.y - radius * radius
    discriminant = b * b - a * c
    if discriminant >= 0.0:
        root = sqrt(discriminant)
        w = -(b + root) if b >= 0.0 else root - b
        # w = 0 or a = 0 give NaN or infinity, which no comparison lets through.
        best = min(best, mantle_root(near, d, q.height, middle, w / a, tmin, best))
        best = min(best, mantle_root(near, d, q.height, middle, c / w, tmin, best))
    if q.kind == CAPPED_CONE:
        best = min(best, disc_distance(o, d, f32(0.0), q.bottom, tmin, best))
        best = min(best, disc_distance(o, d, q.height, q.top, tmin, best))
    return best if best < tmax else INF


@kernel(precise=True)
def quadric_distance_beyond(quadrics, index, o, d, tmin, tmax):
    """Nearest t in (tmin, tmax) where the world ray meets quadric `index`, else infinity."""
    q = quadric_at(quadrics, index)
    local_o = point_to_object(q, o)
    local_d = vector_to_object(q, d)
    if q.kind == SPHERE:
        return sphere_distance(local_o, local_d, tmin, tmax)
    return cone_distance(q, local_o, local_d, tmin, tmax)


@kernel(precise=True)
def quadric_distance(quadrics, index, o, d, tmax):
    """Nearest t in (0, tmax) where the world ray meets quadric `index`, else infinity."""
    return quadric_distance_beyond(quadrics, index, o, d, f32(0.0), tmax)


# A point this far outside of a quadric, relative to its size, may be one of its own surface that is lit from inside.
_THICKNESS = f32(1e-3)


@kernel
def is_inside(q, p):
    """Whether a point of object space is inside of a closed quadric, or on its surface up to rounding."""
    if q.kind == SPHERE:
        return dot(p, p) < (1.0 + _THICKNESS) * (1.0 + _THICKNESS)
    off = max(q.height, max(q.bottom, q.top)) * _THICKNESS
    radius = q.bottom + (q.top - q.bottom) / q.height * p.z + off
    return (p.z > -off) & (p.z < q.height + off) & (p.x * p.x + p.y * p.y < radius * radius)


@kernel
def object_normal(q, p):
    """Outward unit normal at a point p of the surface, object space."""
    if q.kind == SPHERE:
        return normalize(p)
    slope = (q.top - q.bottom) / q.height
    r = sqrt(p.x * p.x + p.y * p.y)
    off_mantle = abs(r - (q.bottom + slope * p.z))
    off_bottom = abs(p.z)
    off_top = abs(q.height - p.z)
    if q.kind == CAPPED_CONE:
        if (off_bottom < off_mantle) & (off_bottom < off_top):
            return Vec3(0, 0, -1)
        if off_top < off_mantle:
            return Vec3(0, 0, 1)
    outward = 1.0 / max(r, 1e-30)
    return normalize(Vec3(p.x * outward, p.y * outward, -slope))


@kernel
def object_uv(q, p, n):
    """Texture coordinates of a surface point: u around z, v along it; caps are looked at from outside."""
    u = atan2_turn(p.y, p.x)
    if q.kind == SPHERE:
        return u, 1.0 - acos_turn(p.z)
    if abs(n.z) == 1.0:
        radius = max(q.bottom, q.top) * 2.0
        return 0.5 + p.x / radius, 0.5 + p.y / radius
    return u, p.z / q.height


@kernel
def object_area(q):
    """Surface area in object space."""
    if q.kind == SPHERE:
        return SPHERE_AREA
    mantle, bottom, top = cone_areas(q)
    return mantle + bottom + top


@kernel
def cone_areas(q):
    """Areas of mantle, bottom cap and top cap; caps that are not there have none."""
    slant = sqrt(q.height * q.height + (q.bottom - q.top) * (q.bottom - q.top))
    capped = f32(1.0) if q.kind == CAPPED_CONE else f32(0.0)
    return PI * (q.bottom + q.top) * slant, PI * q.bottom * q.bottom * capped, PI * q.top * q.top * capped


@kernel
def sample_cone(q, u, v):
    """A point with uniform density over mantle and caps."""
    mantle, bottom, top = cone_areas(q)
    x = u * (mantle + bottom + top)
    if x < mantle:
        # The radius is drawn with a density proportional to itself.
        part = x / mantle
        r = sqrt(q.bottom * q.bottom + part * (q.top * q.top - q.bottom * q.bottom))
        up = part * (q.bottom + q.top) / max(r + q.bottom, 1e-30)
        dx, dy = uniform_disc(f32(1.0), v)
        slope = (q.top - q.bottom) / q.height
        return ObjectPoint(Vec3(dx * r, dy * r, up * q.height), normalize(Vec3(dx, dy, -slope)))
    if x < mantle + bottom:
        dx, dy = uniform_disc((x - mantle) / bottom, v)
        return ObjectPoint(Vec3(dx * q.bottom, dy * q.bottom, 0.0), Vec3(0, 0, -1))
    dx, dy = uniform_disc(min((x - mantle - bottom) / max(top, 1e-30), 1.0), v)
    return ObjectPoint(Vec3(dx * q.top, dy * q.top, q.height), Vec3(0, 0, 1))


@kernel
def sample_quadric(q, u, v):
    """A point with uniform density over the surface in object space."""
    if q.kind == SPHERE:
        p = uniform_sphere(u, v)
        return ObjectPoint(p, p)
    return sample_cone(q, u, v)


# A round sphere is sampled by the cone in which it is seen (pbrt, 4th edition, section 6.2.4).


@struct
class Drawn:
    """A point, and its density per solid angle over that of uniform points per object area; 0: uniform points."""

    point: ObjectPoint
    gain: f32


@kernel
def always_by_area(scene, q, o):
    """A scene without round lights."""
    return f32(0.0)


@kernel(needs=ROUND_LIGHTS, otherwise=always_by_area)
def seen_gain(scene, q, o):
    """`Drawn.gain` for a point o in object space."""
    if (q.kind != SPHERE) | (q.bottom == 0.0) | is_inside(q, o):
        return f32(0.0)
    # The cone has the solid angle 2 pi (1 - cosine), the sphere the area 4 pi.
    return 2.0 / one_minus_cosine(1.0 / dot(o, o))


@kernel
def one_minus_cosine(sine2):
    """1 - cosine of an angle up to pi / 2, of which the square of the sine is given."""
    return sine2 / (1.0 + sqrt(max(0.0, 1.0 - sine2)))


@kernel
def anywhere(scene, q, o, u, v):
    """A scene without round lights."""
    return Drawn(sample_quadric(q, u, v), 0.0)


@kernel(needs=ROUND_LIGHTS, otherwise=anywhere)
def seen_point(scene, q, o, u, v):
    """A point of a quadric to be lit by; o is the lit point, in object space."""
    gain = seen_gain(scene, q, o)
    if not gain > 0.0:
        return anywhere(scene, q, o, u, v)
    # The direction, by 1 - cosine of its angle to the centre, and by that of its point as seen from the centre.
    sine2 = 1.0 / dot(o, o)
    off = u * one_minus_cosine(sine2)
    part = min(off * (2.0 - off) / sine2, 1.0)
    cosine = sqrt(sine2) * part + (1.0 - off) * sqrt(1.0 - part)
    # Not from the cosine, which has no digits left close to the sphere.
    sine = sqrt(part) * max(0.0, (1.0 - off) - sqrt(sine2 * (1.0 - part)))
    x, y = cos_sin_turn(v)
    p = to_world(frame_around(normalize(o)), Vec3(sine * x, sine * y, cosine))
    return Drawn(ObjectPoint(p, p), gain)
