"""Scattering where a path arrives: at a BSDF of any kind, or at a sum of lobes.

Each asks for light from one direction and draws another one; both are weighted against what the other strategy could
have done (multiple importance sampling, Veach 1997, chapter 9).
"""

from __future__ import annotations

from ..lang import as_int, f32, i32, inverse, kernel
from ..pack.layout import (
    ANY_LIGHT,
    BSDFS,
    LOBES_KIND,
    PRINCIPLED_KIND,
    ROUGH_DIELECTRIC_KIND,
    THIN_DIELECTRIC_KIND,
    TRANSMISSION,
)
from .bsdf.responses import Question, response
from .bsdf.values import slot
from .functions import power_heuristic
from .light_layers import light_group
from .lights import sample_light
from .lobes import lobe_origin, scatter_at_lobes, side_of
from .materials import lobes_at
from .media import index_beyond, medium_beyond, transmittance
from .punctual import no_light
from .rays import SHADOW_END, Ray, no_ray, offset_point
from .sampler import choice_numbers
from .scattered import DirectLight, Scattered
from .tangents import shading_frame
from .vectors import black, dot, length, max_component, to_local, to_world

# Whatever is farther away is not at a place, but in a direction.
FAR = f32(1e18)


@kernel
def is_glass(scene, kind):
    """Whether light comes from beyond surfaces of a kind; the principled material is opaque in this scene."""
    return (kind == ROUGH_DIELECTRIC_KIND) | (kind == THIN_DIELECTRIC_KIND)


@kernel(needs=TRANSMISSION, otherwise=is_glass)
def may_be_lit_from_beyond(scene, kind):
    """Whether light may come from beyond surfaces of a kind."""
    return is_glass(scene, kind) | (kind == PRINCIPLED_KIND)


@kernel
def no_light_at(scene, view, path, o, n, pixel, sample, numbers):
    """A scene without lights."""
    return no_light(), i32(-1)


@kernel(needs=ANY_LIGHT, otherwise=no_light_at)
def light_at(scene, view, path, o, n, pixel, sample, numbers):
    """Light that may arrive at the point o, and its number; n as for `sample_light`."""
    return sample_light(scene, o, n, pixel, sample, view.seed, path.depth, numbers.a, numbers.b)


@kernel
def unshadowed_light(scene, path, s, light, number, value):
    """The shadow ray to a light, and what arrives along it; `value` is that of the BSDF towards the light."""
    outside = dot(s.n, light.direction) > 0.0
    o = offset_point(s.p, s.n if outside else -s.n, path.ray.tmax, s.reach)
    # The light was seen from the surface itself: the ray leads from the moved point to the same point of the light.
    finite = light.distance < FAR
    to_light = s.p + light.direction * light.distance - o
    distance = length(to_light)
    direction = to_light * inverse(distance) if finite else light.direction
    distance = distance if finite else light.distance
    weight = f32(1.0) if light.delta else power_heuristic(light.rival, value.pdf)
    radiance = path.throughput * value.f * light.radiance * (weight / light.pdf)
    radiance = radiance * transmittance(scene, medium_beyond(scene, s, outside, path.medium), light.distance)
    return DirectLight(Ray(o, direction, distance * SHADOW_END), radiance, light_group(scene, number))


@kernel
def no_direct_light():
    """No light arrives."""
    return DirectLight(no_ray(), black(), i32(0))


@kernel
def scatter_at_bsdf(scene, view, path, s, kind, pixel, sample, numbers, light, number):
    """Direct light, and the next direction; arguments as those of `scatter`, and the light that may arrive."""
    frame = shading_frame(scene, s)
    wi = to_local(frame, light.direction)
    choice = choice_numbers(scene, pixel, sample, view.seed, path.depth).b
    wo = to_local(frame, -path.ray.d)
    eta = index_beyond(scene, s, path.medium)
    question = Question(wo, wi, numbers.c, numbers.d, choice, eta, path.pdf > 0.0)
    answer = response(scene, s, kind, question)
    # What is above the shading normal's horizon and below the true surface, or the other way round, carries nothing.
    reaches = (light.pdf > 0.0) & (max_component(answer.value.f) > 0.0) & (wi.z * dot(s.n, light.direction) > 0.0)
    direct = unshadowed_light(scene, path, s, light, number, answer.value) if reaches else no_direct_light()
    drawn = answer.drawn
    direction = to_world(frame, drawn.wi)
    blocked = drawn.wi.z * dot(s.n, direction) <= 0.0
    return Scattered(direct.shadow, direct.radiance, direction, drawn.weight, drawn.pdf, blocked, direct.group)


@kernel
def scatter_at_any_lobes(scene, view, path, s, behind, pixel, sample, numbers):
    """A scene whose materials are all sums of lobes."""
    lobes = lobes_at(scene, s)
    n = s.n * side_of(behind)
    light, number = light_at(scene, view, path, lobe_origin(path, s, behind), n, pixel, sample, numbers)
    return scatter_at_lobes(scene, view, path, s, behind, pixel, sample, numbers, lobes, light, number)


@kernel(needs=BSDFS, otherwise=scatter_at_any_lobes)
def scatter(scene, view, path, s, behind, pixel, sample, numbers):
    """What a surface does with a path.

    Args:
        scene: PackedScene.
        view: View.
        path: as it arrives: its ray ends at the surface, what lies before it is in its throughput.
        s: the surface there.
        behind: whether the path is inside of the surface's material.
        pixel: number of the pixel in the full image, for further random numbers.
        sample: number of the sample in the pixel.
        numbers: of `direction_numbers` for the path's depth.
    """
    kind = as_int(slot(scene, s.material, i32(0))[0])
    # Once for all materials: the lanes of a GPU would do it one material after the other.
    n = s.n * side_of(behind)
    o = lobe_origin(path, s, behind)
    if kind != LOBES_KIND:
        n = black() if may_be_lit_from_beyond(scene, kind) else s.n
        o = s.p
    light, number = light_at(scene, view, path, o, n, pixel, sample, numbers)
    if kind == LOBES_KIND:
        lobes = lobes_at(scene, s)
        return scatter_at_lobes(scene, view, path, s, behind, pixel, sample, numbers, lobes, light, number)
    return scatter_at_bsdf(scene, view, path, s, kind, pixel, sample, numbers, light, number)
