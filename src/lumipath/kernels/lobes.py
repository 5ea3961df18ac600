"""Scattering at a sum of lobes: Lambert, perfect mirror, smooth dielectric, one of them drawn by chance."""

from __future__ import annotations

from ..lang import INV_PI, Vec3, f32, i32, kernel, struct
from ..pack.layout import ANY_LIGHT, LOBE_GLASS, LOBE_MIRRORS, LOOKS
from .bsdf.dielectric import sample_dielectric
from .bsdf.lambert import lambert_direction, lambert_pdf, lambert_weight
from .bsdf.mirror import mirror_direction
from .functions import power_heuristic
from .light_layers import light_group
from .media import transmittance
from .rays import SHADOW_END, Ray, no_ray, offset_point
from .sampler import choice_numbers, dielectric_number
from .scattered import DirectLight, Scattered
from .vectors import black, dot, frame_around, mean_component, to_local, to_world


@struct
class Bounce:
    """A direction drawn from one of the lobes."""

    direction: Vec3
    weight: Vec3  # f times cosine over density, over the probability of the lobe
    pdf: f32  # as in Path


@struct
class LobeChoice:
    """Probabilities of the lobes; they add up to 1."""

    diffuse: f32
    mirror: f32
    dielectric: f32


@kernel
def only_diffuse(scene, lobes):
    """A surface with a Lambert lobe only."""
    return LobeChoice(1.0, 0.0, 0.0)


@kernel(needs=LOBE_MIRRORS | LOBE_GLASS | LOOKS, otherwise=only_diffuse)
def lobe_probabilities(scene, lobes):
    """Each lobe's share of the mean weights."""
    diffuse = mean_component(lobes.diffuse)
    mirror = mean_component(lobes.mirror)
    # A black surface has no lobe to choose.
    scale = 1.0 / max(diffuse + mirror + lobes.transmission, 1e-30)
    return LobeChoice(diffuse * scale, mirror * scale, lobes.transmission * scale)


@kernel
def bounce_diffuse(scene, lobes, probability, frame, side, u, v):
    """Draw from the Lambert lobe, which lies on the viewer's side (1) or beyond the surface (-1)."""
    wi = lambert_direction(scene, u, v)
    # A black surface comes here too, with the probability 0.
    weight = lobes.diffuse * (lambert_weight(scene, wi.z) / max(probability, 1e-30))
    return Bounce(to_world(frame, Vec3(wi.x, wi.y, wi.z * side)), weight, lambert_pdf(scene, wi.z) * probability)


@kernel
def bounce_only_diffuse(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, depth, u, v):
    """A surface with a Lambert lobe only."""
    return bounce_diffuse(scene, lobes, choice.diffuse, frame, side, u, v)


# The probabilities add up to a little less or more than 1. What rounding leaves over goes to the Lambert lobe: a mirror
# or glass that is not there would be divided by almost 0.


@kernel(needs=LOBE_MIRRORS, otherwise=bounce_only_diffuse)
def bounce_without_dielectric(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, depth, u, v):
    """Lambert, and a mirror where the scene has any."""
    if choice_numbers(scene, pixel, sample, view.seed, depth).b < choice.mirror:
        return Bounce(to_world(frame, mirror_direction(wo)), lobes.mirror / choice.mirror, 0.0)
    return bounce_diffuse(scene, lobes, choice.diffuse, frame, side, u, v)


@kernel(needs=LOBE_GLASS, otherwise=bounce_without_dielectric)
def bounce(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, depth, u, v):
    """Draw a direction from a lobe that is chosen with the probability of its weight."""
    which = choice_numbers(scene, pixel, sample, view.seed, depth).b
    if which < choice.dielectric:
        number = dielectric_number(scene, pixel, sample, view.seed, depth)
        through = sample_dielectric(scene, lobes, wo, s.front, number)
        return Bounce(to_world(frame, through.wi), through.weight / choice.dielectric, 0.0)
    if which < choice.dielectric + choice.mirror:
        return Bounce(to_world(frame, mirror_direction(wo)), lobes.mirror / choice.mirror, 0.0)
    return bounce_diffuse(scene, lobes, choice.diffuse, frame, side, u, v)


@kernel
def side_of(behind):
    """The side of a surface on which its Lambert lobe lies: the viewer's, 1, or the other one, -1.

    The paint on glass is on its outside: seen from within, it scatters light from without, and to there.
    """
    return f32(-1.0) if behind else f32(1.0)


@kernel
def lobe_origin(path, s, behind):
    """Where shadow rays of the Lambert lobe begin."""
    return offset_point(s.p, s.n * side_of(behind), path.ray.tmax, s.reach)


@kernel
def no_direct_light(scene, path, s, behind, lobes, probability, light, number):
    """A scene without lights."""
    return DirectLight(no_ray(), black(), i32(0))


@kernel(needs=ANY_LIGHT, otherwise=no_direct_light)
def direct_light(scene, path, s, behind, lobes, probability, light, number):
    """Next-event estimation of the Lambert lobe, weighted against drawing the same direction from the lobe."""
    side = side_of(behind)
    n = s.n * side
    cosine = dot(s.shading, light.direction) * side
    reaches = (light.pdf > 0.0) & (cosine > 0.0) & (dot(n, light.direction) > 0.0) & (probability > 0.0)
    competing = lambert_pdf(scene, cosine) * probability
    weight = f32(1.0) if light.delta else power_heuristic(light.rival, competing)
    radiance = path.throughput * lobes.diffuse * light.radiance * (INV_PI * cosine * weight / light.pdf)
    medium = path.medium if side > 0.0 else i32(-1)
    radiance = radiance * transmittance(scene, medium, light.distance)
    # As values, not as branches: which way it goes cannot be predicted.
    tmax = light.distance * SHADOW_END if reaches else f32(0.0)
    return DirectLight(Ray(lobe_origin(path, s, behind), light.direction, tmax), radiance, light_group(scene, number))


@kernel
def scatter_at_lobes(scene, view, path, s, behind, pixel, sample, numbers, lobes, light, number):
    """Direct light, and the next direction.

    Arguments as those of `scatter`, the lobes there, and the light that may arrive at `lobe_origin`, with its number.
    """
    side = side_of(behind)
    choice = lobe_probabilities(scene, lobes)
    direct = direct_light(scene, path, s, behind, lobes, choice.diffuse, light, number)
    frame = frame_around(s.shading)
    wo = to_local(frame, -path.ray.d)
    drawn = bounce(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, path.depth, numbers.c, numbers.d)
    # A diffuse direction on the wrong side of the true surface carries nothing; mirrors and glass may go anywhere.
    blocked = (drawn.pdf > 0.0) & (dot(s.n, drawn.direction) * side <= 0.0)
    return Scattered(direct.shadow, direct.radiance, drawn.direction, drawn.weight, drawn.pdf, blocked, direct.group)
