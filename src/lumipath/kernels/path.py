"""The path tracer's one step: shade a hit, with no tracing inside.

Schedulers trace a path's ray, call `shade`, trace the shadow ray that it asks for, and go on with the path it returns.
"""

from __future__ import annotations

from ..lang import Vec3, f32, i32, inverse, kernel, struct
from ..pack.layout import CLAMP_INDIRECT, ROULETTE, SIGNED_FILTER
from .camera import camera_sample
from .far_light import far_light
from .footprints import shading_surface
from .functions import strategy_weight
from .light_layers import emitter_group
from .lights import emitter_pdf
from .materials import seen_emission
from .media import (
    has_inside,
    is_overruled,
    medium_before,
    medium_beyond,
    medium_past,
    scattered_times,
    transmittance,
)
from .mixes import emitting_material
from .rays import Ray, endless_ray, no_ray, offset_point
from .sampler import choice_numbers
from .scatter import scatter
from .vectors import black, dot, max_abs_component, max_component


@struct
class Path:
    """What a path carries from one surface to the next."""

    ray: Ray
    throughput: Vec3  # negative where the sample counts so
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
    emitter: i32  # light group of `emitted`
    light: i32  # light group of `direct`


@kernel
def start_path(scene, view, column, row, numbers):
    """A path that leaves the camera; numbers of `camera_numbers`."""
    sample = camera_sample(scene, view, column, row, numbers)
    weight = Vec3(sample.weight, sample.weight, sample.weight)
    return Path(sample.ray, weight, 0.0, i32(0), i32(-1), True)


@kernel
def no_path():
    """A path that has ended before it began."""
    return Path(no_ray(), black(), 0.0, i32(0), i32(-1), False)


@kernel
def finish(path, emitted, emitter):
    """The path ends here."""
    ended = Path(path.ray, path.throughput, path.pdf, path.depth, path.medium, False)
    return Step(ended, emitted, no_ray(), black(), emitter, i32(0))


@kernel
def as_it_is(scene, view, radiance, bounces):
    """Light of any strength."""
    return radiance


@kernel
def largest(scene, throughput):
    """All samples count positively."""
    return max_component(throughput)


@kernel(needs=SIGNED_FILTER, otherwise=largest)
def strength(scene, throughput):
    """How much a path can still bring: its largest component, whatever the sign of its sample."""
    return max_abs_component(throughput)


@kernel(needs=CLAMP_INDIRECT, otherwise=as_it_is)
def limited(scene, view, radiance, bounces):
    """Light that was scattered at another surface than the one that is seen, at most as bright as wanted."""
    brightest = strength(scene, radiance)
    excessive = (bounces > 0) & (brightest > view.clamp_indirect)
    return radiance * (view.clamp_indirect / brightest) if excessive else radiance


@kernel
def escaped(scene, view, path):
    """Nothing was hit: the light of what is infinitely far away."""
    emitted = limited(scene, view, far_light(scene, path), i32(scattered_times(scene, path) - 1))
    return finish(path, emitted, emitter_group(scene, i32(-1)))


@kernel
def survive(scene, view, throughput, depth, pixel, sample):
    """Never end a path by chance."""
    return f32(1.0)


@kernel(needs=ROULETTE, otherwise=survive)
def roulette_weight(scene, view, throughput, depth, pixel, sample):
    """Russian roulette: 0 ends the path, else the factor that keeps the estimate unbiased (Arvo and Kirk 1990)."""
    if depth < view.rr_depth:
        return f32(1.0)
    survival = min(strength(scene, throughput), 1.0)
    lives = choice_numbers(scene, pixel, sample, view.seed, depth).c < survival
    return inverse(survival) if lives else f32(0.0)


@kernel
def pass_by(scene, path, s, hit, medium, throughput):
    """Go on as if the surface were not there."""
    ray = endless_ray(offset_point(s.p, -s.n, hit.t, s.reach), path.ray.d)
    # Shadow rays stop at the surface, so what lies behind it is found in no other way.
    beyond = medium_past(scene, s, medium)
    onward = Path(ray, throughput, 0.0, i32(path.depth + 1), beyond, strength(scene, throughput) > 0.0)
    return Step(onward, black(), no_ray(), black(), i32(0), i32(0))


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
        return escaped(scene, view, path)
    ray = path.ray
    s = shading_surface(scene, view, path, hit, pixel, sample)
    # Arriving at the back of a dielectric means having been inside, whatever the path remembers.
    behind = has_inside(scene, s.material) & (not s.front)
    medium = medium_before(scene, s, path.medium)
    throughput = path.throughput * transmittance(scene, medium, hit.t)

    if is_overruled(scene, s, medium):
        return pass_by(scene, path, s, hit, medium, throughput)

    # Emission of what was hit.
    emitted = black()
    emitting = emitting_material(scene, s, hit)
    emitter = emitter_group(scene, emitting)
    # Light sampling sees textures as they are, so whatever competes with it must, too.
    footprint = s.footprint if path.depth == 0 else f32(0.0)
    radiance = seen_emission(scene, emitting, s.corner, s.u, s.v, s.w1, s.w2, footprint)
    if max_component(radiance) > 0.0:
        emitted = throughput * radiance * strategy_weight(path.pdf, emitter_pdf(scene, ray, hit, s))
    times = scattered_times(scene, path)
    emitted = limited(scene, view, emitted, i32(times - 1))
    if times >= view.max_depth:
        return finish(path, emitted, emitter)

    # Direct light, and the next direction.
    here = Path(Ray(ray.o, ray.d, hit.t), throughput, path.pdf, path.depth, medium, True)
    onward = scatter(scene, view, here, s, behind, pixel, sample, numbers)
    throughput = throughput * onward.weight
    depth = i32(path.depth + 1)
    roulette = roulette_weight(scene, view, throughput, depth, pixel, sample)
    alive = (not onward.blocked) & (roulette > 0.0) & (strength(scene, throughput) > 0.0)
    outside = dot(s.n, onward.direction) > 0.0
    leaving = offset_point(s.p, s.n if outside else -s.n, hit.t, s.reach)
    beyond = medium_beyond(scene, s, outside, medium)
    next_ray = endless_ray(leaving, onward.direction)
    gone = Path(next_ray, throughput * roulette, onward.pdf, depth, beyond, alive)
    direct = limited(scene, view, onward.direct, times)
    return Step(gone, emitted, onward.shadow, direct, emitter, onward.light)
