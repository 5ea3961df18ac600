"""Rays from the camera: projections, and a thin lens, which is a pinhole where its aperture is 0.

Perspective, orthographic and spherical cameras follow pbrt, 4th edition, chapter 5; fisheyes the formulas in Bettonvil
2005, Fisheye lenses (WGN 33:1). A lens that looks in all directions is turned towards each of them.
"""

from __future__ import annotations

from ..lang import INF, Vec3, f32, i32, kernel, load4, sqrt, struct
from ..pack.layout import BLADES, EQUISOLID, FISHEYE, LENS, ORTHOGRAPHIC, PANORAMA, RADIAL, SHIFT, WINDOW
from .filters import filter_sample
from .functions import cos_sin_turn, floor_int
from .rays import Ray
from .sampler import Numbers
from .vectors import dot, length, normalize, xyz
from .warps import uniform_disc, uniform_polygon


@struct
class CameraSample:
    """A ray, and how much its light counts.

    In the negative lobes of a filter it counts negatively. Beyond the circle of a fisheye it does not count at all, and
    the ray has no length.
    """

    ray: Ray
    weight: f32


@struct
class Aim:
    """What a point of the image shows, seen through the middle of the lens."""

    o: Vec3  # middle of the lens
    d: Vec3  # from there to what is in focus, divided by the focus distance
    right: Vec3  # axes of the lens
    up: Vec3
    seen: bool  # whether it shows anything


# ---- projections: from a point (x, y) of the window, see `Camera.window`, to a direction -----------------------------


@kernel
def perspective(scene, view, x, y):
    """Through the point (x, y) of the image plane at distance 1."""
    lens = view.lens
    d = xyz(load4(lens, 4)) * x + xyz(load4(lens, 8)) * y - xyz(load4(lens, 12))
    return Aim(xyz(load4(lens, 0)), d, xyz(load4(lens, 4)), xyz(load4(lens, 8)), True)


@kernel(needs=ORTHOGRAPHIC, otherwise=perspective)
def orthographic(scene, view, x, y):
    """Straight ahead from the point (x, y), in metres, of the plane through the camera."""
    lens = view.lens
    right = xyz(load4(lens, 4))
    up = xyz(load4(lens, 8))
    return Aim(xyz(load4(lens, 0)) + right * x + up * y, -xyz(load4(lens, 12)), right, up, True)


@kernel
def cos_sin_any_turn(u):
    """Cos and sin of 2 pi u for any u."""
    return cos_sin_turn(u - f32(floor_int(u)))


@kernel(needs=PANORAMA, otherwise=orthographic)
def panorama(scene, view, x, y):
    """Towards the longitude x, to the right, and the latitude y, upwards, in turns (an equirectangular map)."""
    lens = view.lens
    right = xyz(load4(lens, 4))
    up = xyz(load4(lens, 8))
    backward = xyz(load4(lens, 12))
    cos_x, sin_x = cos_sin_any_turn(x)
    cos_y, sin_y = cos_sin_any_turn(y)
    level = right * sin_x - backward * cos_x
    across = right * cos_x + backward * sin_x
    return Aim(xyz(load4(lens, 0)), level * cos_y + up * sin_y, across, up * cos_y - level * sin_y, True)


@kernel
def equidistant_angle(scene, view, r):
    """The angle from the axis grows like the radius r: its cosine, and its sine divided by r."""
    cosine, sine = cos_sin_turn(r * load4(view.lens, WINDOW)[2])
    return cosine, sine / max(r, 1e-12)


@kernel(needs=EQUISOLID, otherwise=equidistant_angle)
def fisheye_angle(scene, view, r):
    """The sine of half of the angle grows like the radius r, so that equal areas of the image are equal solid angles.

    Returns the cosine of the angle, and its sine divided by r.
    """
    edge = load4(view.lens, WINDOW)[2]
    half_sine = r * edge
    return 1.0 - 2.0 * half_sine * half_sine, 2.0 * edge * sqrt(max(0.0, 1.0 - half_sine * half_sine))


@kernel
def turned(axis, ahead, d, along, cosine):
    """An axis of the lens after the shortest turn that brings `ahead` to d; `along` is their product with d."""
    return axis - (ahead + d) * (along / max(1.0 + cosine, 1e-6))


@kernel(needs=FISHEYE | EQUISOLID, otherwise=panorama)
def aim(scene, view, x, y):
    """What the point (x, y) of the window shows; a fisheye shows something within the circle of radius 1 only."""
    lens = view.lens
    right = xyz(load4(lens, 4))
    up = xyz(load4(lens, 8))
    ahead = -xyz(load4(lens, 12))
    r = sqrt(x * x + y * y)
    cosine, scale = fisheye_angle(scene, view, min(r, 1.0))
    d = right * (x * scale) + up * (y * scale) + ahead * cosine
    lens_right = turned(right, ahead, d, x * scale, cosine)
    return Aim(xyz(load4(lens, 0)), d, lens_right, turned(up, ahead, d, y * scale, cosine), r <= 1.0)


# ---- the lens --------------------------------------------------------------------------------------------------------


@kernel
def ray_of(aim, o, d):
    """The ray from o along d; where there is nothing to be seen it has no length."""
    return Ray(o, normalize(d), INF if aim.seen else f32(0.0))


@kernel
def pinhole_ray(scene, view, aim, numbers):
    """The ray through the middle of the lens."""
    return ray_of(aim, aim.o, aim.d)


@kernel
def round_lens(scene, view, u, v):
    """A point of a round aperture of radius 1."""
    return uniform_disc(u, v)


@kernel(needs=BLADES, otherwise=round_lens)
def lens_point(scene, view, u, v):
    """A point of an aperture that straight blades close; its corners lie at radius 1."""
    blades = load4(view.lens, 16)
    return uniform_polygon(i32(blades[0]), blades[1], u, v)


@kernel(needs=LENS, otherwise=pinhole_ray)
def lens_ray(scene, view, aim, numbers):
    """A ray from a point of the lens through what a pinhole would see in focus (pbrt, 4th edition, section 5.2.3)."""
    lens = view.lens
    aperture = load4(lens, 0)[3]
    focus = load4(lens, 4)[3]
    in_focus = aim.d * focus
    u, v = lens_point(scene, view, numbers.a, numbers.b)
    start = aim.right * (u * aperture) + aim.up * (v * aperture)
    return ray_of(aim, aim.o + start, in_focus - start)


# ---- pixels ----------------------------------------------------------------------------------------------------------


@kernel
def centred(scene, view, x, y):
    """The window is about the viewing direction."""
    return x, y


@kernel(needs=SHIFT, otherwise=centred)
def shifted(scene, view, x, y):
    """A point of a window whose middle is elsewhere."""
    shift = load4(view.lens, WINDOW)
    return x + shift[0], y + shift[1]


@kernel
def camera_sample(scene, view, column, row, numbers):
    """A ray of pixel (column, row) of the full image, row 0 at the top, and its weight; numbers of `camera_numbers`."""
    place = filter_sample(scene, view, numbers.c, numbers.d)
    half_height = load4(view.lens, 8)[3]
    half_width = load4(view.lens, 12)[3]
    x = (2.0 * (f32(column) + place.x) / f32(view.width) - 1.0) * half_width
    y = (1.0 - 2.0 * (f32(row) + place.y) / f32(view.height)) * half_height
    x, y = shifted(scene, view, x, y)
    seen = aim(scene, view, x, y)
    return CameraSample(lens_ray(scene, view, seen, numbers), place.weight if seen.seen else f32(0.0))


@kernel
def camera_ray(scene, view, column, row, numbers):
    """The ray of `camera_sample`, where weights do not matter."""
    return camera_sample(scene, view, column, row, numbers).ray


@kernel
def pixel_spread(view):
    """Width of a pixel's cone of rays per metre of their length."""
    return 2.0 * load4(view.lens, 8)[3] / f32(view.height)


@kernel
def central_numbers():
    """The middle of the pixel, and of the lens, round or not: there its points begin."""
    return Numbers(0.0, 0.0, 0.5, 0.5)


# ---- distances -------------------------------------------------------------------------------------------------------


@kernel
def planar_length(scene, view, v):
    """Length of a vector that points against the viewing direction."""
    return dot(xyz(load4(view.lens, 12)), v)


@kernel(needs=RADIAL, otherwise=planar_length)
def axial_length(scene, view, v):
    """Length of a vector to the camera as its focus and its depths are measured: here in all directions alike."""
    return length(v)


@kernel
def axial_distance(scene, view, p):
    """Distance of a point from the camera, metres: along its viewing direction, or straight if it looks all round."""
    return axial_length(scene, view, xyz(load4(view.lens, 0)) - p)
