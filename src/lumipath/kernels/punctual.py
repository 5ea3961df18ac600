"""Lights without a surface: points, spots, directions, and suns, which are discs of directions."""

from __future__ import annotations

from ..lang import INF, PI, Vec3, f32, i32, inverse, kernel, load4, sqrt, struct
from ..pack.layout import LIGHT_SIZE, SUNS
from .functions import cos_sin_turn
from .vectors import black, dot, frame_around, to_world, xyz


@struct
class LightSample:
    """Light that arrives at a point from one direction, if nothing is in between; pdf = 0: none."""

    direction: Vec3
    distance: f32
    radiance: Vec3
    pdf: f32  # per solid angle, of light and point together
    rival: f32  # what multiple importance sampling takes for that, here and where a ray hits the light
    delta: bool  # lights of no extent, which no other strategy can find


@kernel
def no_light():
    """No sample."""
    return LightSample(Vec3(0, 0, 1), 0.0, black(), 0.0, 0.0, False)


@kernel
def light_row(scene, light, part):
    """Four floats of a light's record."""
    return load4(scene.lights, light * LIGHT_SIZE + part)


@kernel
def sample_point_light(scene, light, o, u, v):
    """The radiance arriving from a point light, as if spread over one unit of solid angle."""
    to_light = xyz(light_row(scene, light, 4)) - o
    fade = light_row(scene, light, 12)
    distance = sqrt(dot(to_light, to_light))
    attenuation = min(1.0, inverse(fade[0] + fade[1] * distance + fade[2] * distance * distance))
    radiance = xyz(light_row(scene, light, 8)) * (PI * attenuation)
    pdf = light_row(scene, light, 0)[2]
    return LightSample(to_light * inverse(distance), distance, radiance, pdf, pdf, True)


@kernel
def sample_spot_light(scene, light, o, u, v):
    """The radiance arriving from a spot light, as if spread over one unit of solid angle."""
    place = light_row(scene, light, 4)
    shine = light_row(scene, light, 8)
    to_light = xyz(place) - o
    distance2 = dot(to_light, to_light)
    distance = sqrt(distance2)
    direction = to_light * inverse(distance)
    # 1 - cosine of the angle to the axis, from the chord between two unit vectors, which keeps the digits.
    off = xyz(light_row(scene, light, 12)) + direction
    fade = min(max((place[3] - 0.5 * dot(off, off)) * shine[3], 0.0), 1.0)
    radiance = xyz(shine) * (fade * fade * inverse(distance2))
    pdf = light_row(scene, light, 0)[2] if fade > 0.0 else f32(0.0)
    return LightSample(direction, distance, radiance, pdf, pdf, True)


@kernel
def sample_directional_light(scene, light, o, u, v):
    """The radiance arriving from a directional light, as if spread over one unit of solid angle."""
    direction = xyz(light_row(scene, light, 4))
    radiance = xyz(light_row(scene, light, 8)) * PI
    pdf = light_row(scene, light, 0)[2]
    return LightSample(direction, INF, radiance, pdf, pdf, True)


@kernel
def sample_sun(scene, light, o, u, v):
    """A direction of a sun's disc, with uniform density."""
    disc = light_row(scene, light, 4)
    colour = light_row(scene, light, 8)
    # Uniform over the disc is uniform in the square of the chord to its middle, which is 2 (1 - cosine).
    chord2 = u * disc[3]
    cosine = 1.0 - 0.5 * chord2
    sine = sqrt(max(0.0, chord2 * (1.0 - 0.25 * chord2)))
    x, y = cos_sin_turn(v)
    direction = to_world(frame_around(xyz(disc)), Vec3(sine * x, sine * y, cosine))
    pdf = light_row(scene, light, 12)[0]
    return LightSample(direction, INF, xyz(colour) * colour[3], pdf, pdf, False)


@struct
class SunSeen:
    """Radiance of a sun in one direction, and the density with which `sample_sun` draws it, per solid angle."""

    radiance: Vec3
    pdf: f32


@kernel
def sun_from(scene, light, direction):
    """A sun in a world direction."""
    disc = light_row(scene, light, 4)
    colour = light_row(scene, light, 8)
    off = direction - xyz(disc)
    inside = dot(off, off) <= disc[3]
    return SunSeen(xyz(colour) * (colour[3] if inside else f32(0.0)), light_row(scene, light, 12)[0])


@kernel
def no_suns(scene, direction, sky):
    """A scene without suns."""
    return sky


@kernel(needs=SUNS, otherwise=no_suns)
def with_suns(scene, direction, sky):
    """The radiance `sky` of a world direction and that of all suns there."""
    for k in range(scene.sun_count):
        sky = sky + sun_from(scene, i32(scene.first_sun + k), direction).radiance
    return sky
