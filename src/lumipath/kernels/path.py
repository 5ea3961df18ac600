"""The path tracer's one step: shade a hit, with no tracing inside.

Schedulers trace a path's ray, call `shade`, trace the shadow ray that it asks for, and go on with the path it returns.
"""

from __future__ import annotations

from ..lang import INV_PI, Vec3, f32, i32, inverse, kernel, struct
from ..pack.layout import ANY_LIGHT, DIELECTRICS, MIRRORS, ROULETTE, SUNS
from .bsdf.dielectric import sample_dielectric
from .bsdf.lambert import lambert_direction, lambert_pdf, lambert_weight
from .bsdf.mirror import mirror_direction
from .camera import camera_ray
from .environment import environment_from
from .functions import power_heuristic
from .lights import emitter_pdf, sample_light
from .materials import emission_at, is_dielectric, lobes_at, transmittance
from .punctual import sun_from
from .rays import SHADOW_END, Ray, endless_ray, no_ray, offset_point
from .sampler import choice_numbers, dielectric_number
from .surface import surface_at
from .vectors import (
    black,
    dot,
    frame_around,
    max_component,
    mean_component,
    to_local,
    to_world,
    white,
)


@struct
class Path:
    """What a path carries from one surface to the next."""

    ray: Ray
    throughput: Vec3
    pdf: f32  # density with which ray.d was drawn, per solid angle; 0: no other strategy could have drawn it
    depth: i32  # scattering events so far
    medium: i32  # material that the ray travels in, -1 outside
    alive: bool


@struct
class Step:
    """What a path does at a hit."""

    path: Path
    emitted: Vec3  # radiance that reaches the pixel now
    shadow: Ray  # tmax = 0: none
    direct: Vec3  # radiance that reaches the pixel if nothing is on `shadow`


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
def start_path(scene, view, column, row, numbers):
    """A path that leaves the camera; numbers of `camera_numbers`."""
    ray = camera_ray(scene, view, column, row, numbers)
    return Path(ray, white(), 0.0, i32(0), i32(-1), True)


@kernel
def no_path():
    """A path that has ended before it began."""
    return Path(no_ray(), black(), 0.0, i32(0), i32(-1), False)


@kernel
def finish(path, emitted):
    """The path ends here."""
    ended = Path(path.ray, path.throughput, path.pdf, path.depth, path.medium, False)
    return Step(ended, emitted, no_ray(), black())


@kernel
def strategy_weight(pdf, other):
    """Multiple importance sampling: weight of a sample that only light sampling (density `other`) competes for."""
    return f32(1.0) if pdf == 0.0 else power_heuristic(pdf, other)


@kernel
def without_suns(scene, path, light):
    """A scene without suns."""
    return light


@kernel(needs=SUNS, otherwise=without_suns)
def with_weighted_suns(scene, path, light):
    """The light of what was not hit, and that of all suns there."""
    for k in range(scene.sun_count):
        sun = sun_from(scene, i32(scene.first_sun + k), path.ray.d)
        light = light + path.throughput * sun.radiance * strategy_weight(path.pdf, sun.pdf)
    return light


@kernel
def escaped(scene, path):
    """Nothing was hit: the environment's light, and the suns'."""
    seen = environment_from(scene, path.ray.d)
    weight = strategy_weight(path.pdf, seen.pdf * scene.environment_probability)
    return finish(path, with_weighted_suns(scene, path, path.throughput * seen.radiance * weight))


@kernel
def only_diffuse(scene, lobes):
    """A surface with a Lambert lobe only."""
    return LobeChoice(1.0, 0.0, 0.0)


@kernel(needs=MIRRORS | DIELECTRICS, otherwise=only_diffuse)
def lobe_probabilities(scene, lobes):
    """Each lobe's share of the mean weights."""
    diffuse = mean_component(lobes.diffuse)
    mirror = mean_component(lobes.mirror)
    scale = 1.0 / (diffuse + mirror + lobes.transmission)
    return LobeChoice(diffuse * scale, mirror * scale, lobes.transmission * scale)


@kernel
def bounce_diffuse(scene, lobes, probability, frame, side, u, v):
    """Draw from the Lambert lobe, which lies on the viewer's side (1) or beyond the surface (-1)."""
    wi = lambert_direction(scene, u, v)
    weight = lobes.diffuse * (lambert_weight(scene, wi.z) / probability)
    return Bounce(to_world(frame, Vec3(wi.x, wi.y, wi.z * side)), weight, lambert_pdf(scene, wi.z) * probability)


@kernel
def bounce_only_diffuse(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, depth, u, v):
    """A surface with a Lambert lobe only."""
    return bounce_diffuse(scene, lobes, choice.diffuse, frame, side, u, v)


# The probabilities add up to a little less or more than 1. What rounding leaves over goes to the Lambert lobe: a mirror
# or glass that is not there would be divided by almost 0.


@kernel(needs=MIRRORS, otherwise=bounce_only_diffuse)
def bounce_without_dielectric(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, depth, u, v):
    """Lambert, and a mirror where the scene has any."""
    if choice_numbers(scene, pixel, sample, view.seed, depth).b < choice.mirror:
        return Bounce(to_world(frame, mirror_direction(wo)), lobes.mirror / choice.mirror, 0.0)
    return bounce_diffuse(scene, lobes, choice.diffuse, frame, side, u, v)


@kernel(needs=DIELECTRICS, otherwise=bounce_without_dielectric)
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


@struct
class DirectLight:
    """A shadow ray and the radiance that it lets through."""

    shadow: Ray
    radiance: Vec3


@kernel
def no_direct_light(scene, view, path, s, side, lobes, probability, pixel, sample, numbers):
    """A scene without lights."""
    return DirectLight(no_ray(), black())


@kernel(needs=ANY_LIGHT, otherwise=no_direct_light)
def direct_light(scene, view, path, s, side, lobes, probability, pixel, sample, numbers):
    """Next-event estimation of the Lambert lobe, weighted against drawing the same direction from the lobe."""
    n = s.n * side
    o = offset_point(s.p, n, path.ray.tmax, s.reach)
    light = sample_light(scene, o, n, pixel, sample, view.seed, path.depth, numbers.a, numbers.b)
    cosine = dot(s.shading, light.direction) * side
    reaches = (light.pdf > 0.0) & (cosine > 0.0) & (dot(n, light.direction) > 0.0) & (probability > 0.0)
    competing = lambert_pdf(scene, cosine) * probability
    weight = f32(1.0) if light.delta else power_heuristic(light.rival, competing)
    radiance = path.throughput * lobes.diffuse * light.radiance * (INV_PI * cosine * weight / light.pdf)
    medium = path.medium if side > 0.0 else i32(-1)
    radiance = radiance * transmittance(scene, medium, light.distance)
    # As values, not as branches: which way it goes cannot be predicted.
    tmax = light.distance * SHADOW_END if reaches else f32(0.0)
    return DirectLight(Ray(o, light.direction, tmax), radiance)


@kernel
def survive(scene, view, throughput, depth, pixel, sample):
    """Never end a path by chance."""
    return f32(1.0)


@kernel(needs=ROULETTE, otherwise=survive)
def roulette_weight(scene, view, throughput, depth, pixel, sample):
    """Russian roulette: 0 ends the path, else the factor that keeps the estimate unbiased (Arvo and Kirk 1990)."""
    if depth < view.rr_depth:
        return f32(1.0)
    survival = min(max_component(throughput), 1.0)
    lives = choice_numbers(scene, pixel, sample, view.seed, depth).c < survival
    return inverse(survival) if lives else f32(0.0)


@kernel
def medium_beyond(scene, s, same_side, medium):
    """The medium that a path goes on in: another one only where it passes through the surface of a dielectric."""
    if same_side | (not is_dielectric(scene, s.material)):
        return medium
    return s.material if s.front else i32(-1)


@kernel
def shade(scene, view, path, hit, numbers, pixel, sample):
    """One step of a path whose ray has hit something or nothing.

    Args:
        scene: PackedScene.
        view: View.
        path: as `start_path` or the step before made it.
        hit: what its ray found.
        numbers: of `direction_numbers` for the path's depth.
        pixel: number of the pixel in the full image, for further random numbers.
        sample: number of the sample in the pixel.
    """
    if hit.primitive < 0:
        return escaped(scene, path)
    ray = path.ray
    s = surface_at(scene, ray, hit)
    # Arriving at the back of a dielectric means having been inside, whatever the path remembers.
    behind = is_dielectric(scene, s.material) & (not s.front)
    medium = s.material if behind else path.medium
    throughput = path.throughput * transmittance(scene, medium, hit.t)

    # Emission of what was hit.
    emitted = black()
    radiance = emission_at(scene, s.material, s.corner, s.u, s.v, s.w1, s.w2)
    if max_component(radiance) > 0.0:
        emitted = throughput * radiance * strategy_weight(path.pdf, emitter_pdf(scene, ray, hit, s))
    lobes = lobes_at(scene, s)
    reach = max_component(lobes.diffuse) + max_component(lobes.mirror) + lobes.transmission
    if (path.depth >= view.max_depth) | (not reach > 0.0):
        return finish(path, emitted)

    # The paint on glass is on its outside: seen from within, it scatters light from without, and to there.
    side = f32(-1.0) if behind else f32(1.0)

    # Direct light.
    choice = lobe_probabilities(scene, lobes)
    here = Path(Ray(ray.o, ray.d, hit.t), throughput, path.pdf, path.depth, medium, True)
    direct = direct_light(scene, view, here, s, side, lobes, choice.diffuse, pixel, sample, numbers)

    # The next direction.
    frame = frame_around(s.shading)
    wo = to_local(frame, -ray.d)
    drawn = bounce(scene, view, s, lobes, choice, frame, wo, side, pixel, sample, path.depth, numbers.c, numbers.d)
    throughput = throughput * drawn.weight
    towards = dot(s.n, drawn.direction)
    # A diffuse direction on the wrong side of the true surface carries nothing; mirrors and glass may go anywhere.
    blocked = (drawn.pdf > 0.0) & (towards * side <= 0.0)
    depth = i32(path.depth + 1)
    roulette = roulette_weight(scene, view, throughput, depth, pixel, sample)
    alive = (not blocked) & (roulette > 0.0) & (max_component(throughput) > 0.0)
    leaving = offset_point(s.p, s.n if towards > 0.0 else -s.n, hit.t, s.reach)
    beyond = medium_beyond(scene, s, towards > 0.0, medium)
    onward = Path(endless_ray(leaving, drawn.direction), throughput * roulette, drawn.pdf, depth, beyond, alive)
    return Step(onward, emitted, direct.shadow, direct.radiance)
