"""Rays from the camera: a thin lens, which is a pinhole where its aperture is 0."""

from __future__ import annotations

from ..lang import f32, i32, kernel, load4
from ..pack.layout import BLADES, LENS
from .rays import endless_ray
from .sampler import Numbers
from .vectors import dot, normalize, xyz
from .warps import uniform_disc, uniform_polygon


@kernel
def pinhole_ray(scene, view, x, y, numbers):
    """The ray through the point (x, y) of the image plane at distance 1."""
    lens = view.lens
    d = xyz(load4(lens, 4)) * x + xyz(load4(lens, 8)) * y - xyz(load4(lens, 12))
    return endless_ray(xyz(load4(lens, 0)), normalize(d))


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
def lens_ray(scene, view, x, y, numbers):
    """A ray from a point of the lens through the point of the plane in focus that a pinhole would see there."""
    lens = view.lens
    position = load4(lens, 0)
    right = load4(lens, 4)
    up = load4(lens, 8)
    focus = right[3]
    in_focus = (xyz(right) * x + xyz(up) * y - xyz(load4(lens, 12))) * focus
    u, v = lens_point(scene, view, numbers.c, numbers.d)
    start = xyz(right) * (u * position[3]) + xyz(up) * (v * position[3])
    return endless_ray(xyz(position) + start, normalize(in_focus - start))


@kernel
def camera_ray(scene, view, column, row, numbers):
    """A ray through pixel (column, row) of the full image, row 0 at the top; the box filter is one pixel wide."""
    half_height = load4(view.lens, 8)[3]
    half_width = load4(view.lens, 12)[3]
    x = (2.0 * (f32(column) + numbers.a) / f32(view.width) - 1.0) * half_width
    y = (1.0 - 2.0 * (f32(row) + numbers.b) / f32(view.height)) * half_height
    return lens_ray(scene, view, x, y, numbers)


@kernel
def pixel_spread(view):
    """Width of a pixel's cone of rays per metre of their length."""
    return 2.0 * load4(view.lens, 8)[3] / f32(view.height)


@kernel
def central_numbers():
    """The middle of the pixel, and of the lens, round or not: there its points begin."""
    return Numbers(0.5, 0.5, 0.0, 0.0)


@kernel
def axial_distance(view, p):
    """Distance of a point from the camera along its viewing direction, metres."""
    return dot(xyz(load4(view.lens, 12)), xyz(load4(view.lens, 0)) - p)
