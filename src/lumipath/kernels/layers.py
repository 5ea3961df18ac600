"""Layers of the first hit: what the surfaces behind a pixel are like, one sample after the other.

Albedo and normal, which guide a denoiser, look through mirrors and glass at what is seen there, as the notes of Open
Image Denoise on its auxiliary images advise. The other layers are of the first surface itself.
"""

from __future__ import annotations

from ..lang import INF, Vec3, f32, i32, kernel, load, store, struct, u32
from ..pack.layout import BSDF_ROUGHNESS, DIELECTRICS, INSTANCES, MICROFACETS, MIRRORS
from .bsdf.dielectric import sample_dielectric
from .bsdf.mirror import mirror_direction
from .bsdf.values import number_slot
from .camera import axial_distance, camera_ray, central_numbers
from .environment import environment_from
from .footprints import looked_at_surface
from .lobes import Bounce, lobe_probabilities
from .materials import emission_at, lobes_at
from .media import has_inside, medium_beyond, transmittance
from .mixes import emitting_material
from .punctual import with_suns
from .rays import endless_ray, offset_point
from .sampler import camera_numbers, choice_numbers, dielectric_number, sample_number
from .vectors import black, dot, frame_around, mean_component, to_local, to_world, white

# Mirrors and glass that are looked through. What is behind more of them counts as white.
LOOKED_THROUGH = 8
# Roughness of metal and glass from which on nothing is seen in them or through them.
BLURRING = f32(0.3)


@struct
class FirstHit:
    """What a camera ray has found; all 0 where it has found nothing."""

    albedo: Vec3
    normal: Vec3
    geometric: Vec3
    position: Vec3
    emission: Vec3
    u: f32
    v: f32
    depth: f32
    hits: i32  # 1, or the number of hits in a sum
    primitive: i32  # -1 for none
    instance: i32  # that places it, -1 for none


@kernel
def no_hit():
    """A ray that has found nothing."""
    return FirstHit(black(), black(), black(), black(), black(), 0.0, 0.0, 0.0, i32(0), i32(-1), i32(-1))


@kernel
def no_specular(scene, lobes):
    """No surface lets anybody look through."""
    return f32(0.0)


@kernel(needs=MIRRORS | DIELECTRICS, otherwise=no_specular)
def specular_weight(scene, lobes):
    """The mean weight of mirror and glass."""
    return mean_component(lobes.mirror) + lobes.transmission


@kernel
def look_into_mirror(scene, view, s, lobes, frame, wo, pixel, sample, event):
    """The direction that a mirror shows."""
    return Bounce(to_world(frame, mirror_direction(wo)), lobes.mirror, 0.0)


@kernel(needs=DIELECTRICS, otherwise=look_into_mirror)
def look_through(scene, view, s, lobes, frame, wo, pixel, sample, event):
    """A direction that a mirror or glass shows: one of both by chance where a surface has both."""
    mirror = mean_component(lobes.mirror)
    probability = mirror / (mirror + lobes.transmission)
    if choice_numbers(scene, pixel, sample, view.seed, event).b < probability:
        return Bounce(to_world(frame, mirror_direction(wo)), lobes.mirror / probability, 0.0)
    number = dielectric_number(scene, pixel, sample, view.seed, event)
    through = sample_dielectric(scene, lobes, wo, s.front, number)
    return Bounce(to_world(frame, through.wi), through.weight / (1.0 - probability), 0.0)


@kernel
def never_blurs(scene, s):
    """A scene whose mirrors and glass are all smooth."""
    return False


@kernel(needs=MICROFACETS, otherwise=never_blurs)
def blurs(scene, s):
    """Whether a surface is so rough that what it mirrors or lets through cannot be told: it is seen itself."""
    return number_slot(scene, s, BSDF_ROUGHNESS) >= BLURRING


@kernel
def first_hit(scene, view, trace, ray, pixel, sample):
    """Follow a camera ray to the first surface, and through mirrors and glass to what they show.

    Args:
        scene: PackedScene.
        view: View.
        trace: how the device finds hits: a kernel (scene, ray, any_hit) -> Hit.
        ray: from the camera.
        pixel: number of the pixel in the full image, for random numbers.
        sample: number of the sample in the pixel.
    """
    first = no_hit()
    albedo = black()
    normal = black()
    throughput = white()
    share = f32(1.0)
    medium = i32(-1)
    # One place that traces, since traversal is most of the machine code.
    for turn in range(LOOKED_THROUGH + 1):
        event = i32(turn)
        hit = trace(scene, ray, False)
        if hit.primitive < 0:
            if event == 0:
                seen = with_suns(scene, ray.d, environment_from(scene, ray.d).radiance)
                first = FirstHit(black(), black(), black(), black(), seen, 0.0, 0.0, 0.0, i32(0), i32(-1), i32(-1))
            break
        s = looked_at_surface(scene, view, ray, hit, pixel, sample, event)
        if event == 0:
            emission = emission_at(scene, emitting_material(scene, s, hit), s.corner, s.u, s.v, s.w1, s.w2)
            depth = axial_distance(scene, view, s.p)
            first = FirstHit(black(), black(), s.n, s.p, emission, s.u, s.v, depth, i32(1), hit.primitive, hit.instance)
        behind = has_inside(scene, s.material) & (not s.front)
        medium = s.material if behind else medium
        throughput = throughput * transmittance(scene, medium, hit.t)
        lobes = lobes_at(scene, s)
        # What scatters in all directions is seen here, with its share of the surface ...
        albedo = albedo + throughput * lobes.diffuse
        specular = specular_weight(scene, lobes)
        if not specular > 0.0:
            normal = normal + s.shading * share
            break
        if blurs(scene, s):
            albedo = albedo + throughput * (lobes.mirror + white() * lobes.transmission)
            normal = normal + s.shading * share
            break
        if event == LOOKED_THROUGH:
            albedo = albedo + throughput
            normal = normal + s.shading * share
            break
        diffuse = lobe_probabilities(scene, lobes).diffuse
        normal = normal + s.shading * (share * diffuse)
        # ... and the rest is a view of something else.
        frame = frame_around(s.shading)
        onward = look_through(scene, view, s, lobes, frame, to_local(frame, -ray.d), pixel, sample, event)
        throughput = throughput * onward.weight
        share = share * (1.0 - diffuse)
        towards = dot(s.n, onward.direction)
        medium = medium_beyond(scene, s, towards > 0.0, medium)
        ray = endless_ray(offset_point(s.p, s.n if towards > 0.0 else -s.n, hit.t, s.reach), onward.direction)
    rest = finite(Vec3(first.u, first.v, first.depth))
    return FirstHit(
        finite(albedo),
        finite(normal),
        finite(first.geometric),
        finite(first.position),
        finite(first.emission),
        rest.x,
        rest.y,
        rest.z,
        first.hits,
        first.primitive,
        first.instance,
    )


@kernel
def finite(value):
    """The value, or 0 where it is not finite."""
    return value if abs(value.x + value.y + value.z) < INF else black()


@kernel
def joined(a, b):
    """The sum of two hits; primitive and instance are those of the second."""
    return FirstHit(
        a.albedo + b.albedo,
        a.normal + b.normal,
        a.geometric + b.geometric,
        a.position + b.position,
        a.emission + b.emission,
        a.u + b.u,
        a.v + b.v,
        a.depth + b.depth,
        i32(a.hits + b.hits),
        b.primitive,
        b.instance,
    )


@kernel
def add_number(layers, place, column, value):
    """Add a number to one column of a pixel."""
    if column >= 0:
        # The product of two int32 is an int64, which large films need.
        at = place * layers.channels + column
        store(layers.sums, at, load(layers.sums, at) + value)


@kernel
def add_vector(layers, place, column, value):
    """Add three numbers to the columns of a layer."""
    if column >= 0:
        add_number(layers, place, column, value.x)
        add_number(layers, place, i32(column + 1), value.y)
        add_number(layers, place, i32(column + 2), value.z)


@kernel
def store_no_instance(scene, layers, place, instance):
    """A scene without instances."""


@kernel(needs=INSTANCES, otherwise=store_no_instance)
def store_instance(scene, layers, place, instance):
    """Write down the instance at a pixel's middle."""
    store(layers.instances, place, instance)


@kernel
def add_samples_of_layers(scene, view, trace, layers, column, row, place, first, last):
    """Add the samples first .. last - 1 of a pixel to its layers; the very first time also find what its middle shows.

    Args:
        scene: PackedScene.
        view: View.
        trace: as for `first_hit`.
        layers: LayerArrays.
        column: of the pixel in the full image.
        row: of the pixel in the full image, 0 at the top.
        place: number of the pixel on the film.
        first: of the samples, counted from the first one of the render.
        last: one more than the last of them.
    """
    total = no_hit()
    # The middle is one turn more, so that there is one place that traces.
    for turn in range(first - 1 if first == 0 else first, last):
        number = sample_number(scene, view, column, row, u32(view.first_sample + u32(max(turn, 0))))
        numbers = central_numbers() if turn < 0 else camera_numbers(scene, number.pixel, number.sample, view.seed)
        ray = camera_ray(scene, view, column, row, numbers)
        found = first_hit(scene, view, trace, ray, number.pixel, number.sample)
        if turn < 0:
            store(layers.primitives, place, found.primitive)
            store_instance(scene, layers, place, found.instance)
        else:
            total = joined(total, found)
    wanted = layers.columns
    add_vector(layers, place, wanted.albedo, total.albedo)
    add_vector(layers, place, wanted.normal, total.normal)
    add_vector(layers, place, wanted.geometric_normal, total.geometric)
    add_vector(layers, place, wanted.position, total.position)
    add_vector(layers, place, wanted.emission, total.emission)
    if wanted.uv >= 0:
        add_number(layers, place, wanted.uv, total.u)
        add_number(layers, place, i32(wanted.uv + 1), total.v)
    add_number(layers, place, wanted.depth, total.depth)
    store(layers.hits, place, u32(load(layers.hits, place) + u32(total.hits)))
    store(layers.counts, place, u32(last))
