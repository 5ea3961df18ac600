"""Quick looks at a scene: what the first surface on a camera ray is like. Each is 0 where there is none."""

from __future__ import annotations

from ..lang import Vec3, f32, i32, kernel, struct
from ..pack.layout import ALBEDO, DEPTH, NORMAL, OCCLUSION
from .camera import axial_distance, camera_ray
from .footprints import looked_at_surface
from .materials import lobes_at
from .rays import Hit, Ray, offset_point
from .sampler import camera_numbers, direction_numbers
from .vectors import black, dot, frame_around, to_world, white
from .warps import cosine_hemisphere

# Of the scene's extent: how far surfaces occlude each other where the settings do not say.
OCCLUSION_SHARE = f32(0.1)


@struct
class First:
    """A camera ray and what it hits first."""

    ray: Ray
    hit: Hit


@kernel
def first_of(scene, view, trace, column, row, pixel, sample):
    """The camera ray of a sample, and what it hits."""
    ray = camera_ray(scene, view, column, row, camera_numbers(scene, pixel, sample, view.seed))
    return First(ray, trace(scene, ray, False))


@kernel
def nothing(scene, view, trace, column, row, pixel, sample):
    """The end of the chain: no look was asked for."""
    return black()


@kernel(needs=ALBEDO, otherwise=nothing)
def albedo(scene, view, trace, column, row, pixel, sample):
    """Fraction of light that the surface gives back: diffuse plus mirror, at most 1; a dielectric is white."""
    first = first_of(scene, view, trace, column, row, pixel, sample)
    if first.hit.primitive < 0:
        return black()
    lobes = lobes_at(scene, looked_at_surface(scene, view, first.ray, first.hit, pixel, sample, i32(0)))
    if lobes.transmission > 0.0:
        return white()
    colour = lobes.diffuse + lobes.mirror
    return Vec3(min(colour.x, 1.0), min(colour.y, 1.0), min(colour.z, 1.0))


@kernel(needs=NORMAL, otherwise=albedo)
def normal(scene, view, trace, column, row, pixel, sample):
    """The shading normal in world space, towards the viewer."""
    first = first_of(scene, view, trace, column, row, pixel, sample)
    if first.hit.primitive < 0:
        return black()
    return looked_at_surface(scene, view, first.ray, first.hit, pixel, sample, i32(0)).shading


@kernel(needs=DEPTH, otherwise=normal)
def depth(scene, view, trace, column, row, pixel, sample):
    """Distance from the camera in metres, as `axial_distance` measures it."""
    first = first_of(scene, view, trace, column, row, pixel, sample)
    if first.hit.primitive < 0:
        return black()
    z = axial_distance(scene, view, first.ray.o + first.ray.d * first.hit.t)
    return Vec3(z, z, z)


@kernel(needs=OCCLUSION, otherwise=depth)
def look(scene, view, trace, column, row, pixel, sample):
    """Ambient occlusion, or else: 1 if a ray into the hemisphere, drawn by the cosine, hits nothing within reach."""
    first = first_of(scene, view, trace, column, row, pixel, sample)
    if first.hit.primitive < 0:
        return black()
    s = looked_at_surface(scene, view, first.ray, first.hit, pixel, sample, i32(0))
    numbers = direction_numbers(scene, pixel, sample, view.seed, i32(0))
    direction = to_world(frame_around(s.shading), cosine_hemisphere(numbers.c, numbers.d))
    if not dot(direction, s.n) > 0.0:
        return black()
    reach = view.ao_distance if view.ao_distance > 0.0 else scene.extent * OCCLUSION_SHARE
    ray = Ray(offset_point(s.p, s.n, first.hit.t, s.reach), direction, reach)
    return white() if trace(scene, ray, True).primitive < 0 else black()
