"""From the unit square to directions, discs and triangles, with their densities (pbrt, 4th edition, appendix A.5)."""

from __future__ import annotations

from ..lang import INV_PI, TWO_PI, Vec3, f32, i32, kernel, sqrt
from .functions import cos_sin_turn, floor_int


@kernel
def uniform_disc(u, v):
    """A point of the unit disc: x and y; density 1 / pi."""
    r = sqrt(u)
    c, s = cos_sin_turn(v)
    return r * c, r * s


@kernel
def cosine_hemisphere(u, v):
    """A direction about +z with density cos(theta) / pi (Malley's method)."""
    x, y = uniform_disc(u, v)
    return Vec3(x, y, sqrt(max(0.0, 1.0 - u)))


@kernel
def cosine_hemisphere_pdf(cosine):
    """Density of `cosine_hemisphere` per solid angle."""
    return max(cosine, 0.0) * INV_PI


@kernel
def uniform_hemisphere(u, v):
    """A direction about +z with density 1 / (2 pi)."""
    c, s = cos_sin_turn(v)
    r = sqrt(max(0.0, u * (2.0 - u)))
    return Vec3(r * c, r * s, 1.0 - u)


@kernel
def uniform_hemisphere_pdf(cosine):
    """Density of `uniform_hemisphere` per solid angle."""
    return (INV_PI * 0.5) if cosine >= 0.0 else f32(0.0)


@kernel
def uniform_sphere(u, v):
    """A point of the unit sphere with density 1 / (4 pi)."""
    z = 1.0 - 2.0 * u
    r = sqrt(max(0.0, 1.0 - z * z))
    c, s = cos_sin_turn(v)
    return Vec3(r * c, r * s, z)


@kernel
def uniform_triangle(u, v):
    """Barycentric coordinates of a point with uniform density: the weights of the second and third corner.

    The square is folded along its diagonal, which keeps well spread points well spread (Heitz 2019, A Low-Distortion
    Map Between Triangle and Square).
    """
    if v > u:
        a = u * 0.5
        return a, v - a
    b = v * 0.5
    return u - b, b


@kernel
def polygon_corner(sides, turn, k):
    """Corner k of the regular polygon in the unit circle; corner 0 lies `turn` turns counter-clockwise from +x."""
    angle = turn + f32(k) / f32(sides)
    return cos_sin_turn(angle - f32(floor_int(angle)))


@kernel
def uniform_polygon(sides, turn, u, v):
    """A point of that polygon (3 sides or more), uniform over its area.

    The polygon is cut into equal triangles about its centre. The whole part of u * sides chooses one of them, and what
    is left of it draws the point in that triangle.
    """
    scaled = u * f32(sides)
    k = floor_int(scaled)
    a, b = uniform_triangle(scaled - f32(k), v)
    x0, y0 = polygon_corner(sides, turn, k)
    x1, y1 = polygon_corner(sides, turn, i32(k + 1))
    return a * x0 + b * x1, a * y0 + b * y1


SPHERE_AREA = f32(2.0) * TWO_PI
