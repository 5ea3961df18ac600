"""Choosing a light and a point on it, and the density of that choice."""

from __future__ import annotations

from ..lang import INF, Vec3, as_int, f32, i32, inverse, kernel, load, sqrt
from ..pack.layout import (
    ANY_LIGHT,
    DIRECTIONAL_LIGHT,
    DIRECTIONAL_LIGHTS,
    ENVIRONMENT,
    ENVIRONMENT_LIGHT,
    LIGHT_TREE,
    MANY_LIGHTS,
    OPACITY,
    OPEN_CONE,
    POINT_LIGHT,
    POINT_LIGHTS,
    QUADRIC_LIGHT,
    QUADRIC_LIGHTS,
    QUADRICS,
    SPOT_LIGHT,
    SPOT_LIGHTS,
    SUN_LIGHT,
    SUNS,
    TEXTURES,
    VERTEX_SIZE,
)
from .alias import Pick, resolve_alias
from .environment import sample_environment
from .light_tree import Chosen, descend, rival_of
from .materials import emission_at
from .opacity import opacity_at
from .punctual import (
    LightSample,
    light_row,
    no_light,
    sample_directional_light,
    sample_point_light,
    sample_spot_light,
    sample_sun,
)
from .quadrics import (
    area_scale,
    is_inside,
    normal_to_world,
    object_normal,
    object_uv,
    point_to_object,
    quadric_at,
    seen_gain,
    seen_point,
)
from .rays import TARGET_OFFSET
from .sampler import choice_numbers
from .vectors import dot, max_abs_component, normalize, xyz
from .warps import uniform_triangle

# Light that leaves a surface at a lesser cosine than this is left to the other strategy.
GRAZING = f32(1e-6)


@kernel
def in_front(p, n, reach, o):
    """A point of a light, moved to the side that o is on: a shadow ray to it does not hit the light itself."""
    moved = (max_abs_component(p) + reach) * TARGET_OFFSET
    return p + n * (moved if dot(n, o - p) >= 0.0 else -moved)


@kernel
def sample_triangle_light(scene, light, o, u, v):
    """A point with uniform density on an emissive triangle."""
    corner = light_row(scene, light, 4)
    edge1 = light_row(scene, light, 8)
    edge2 = light_row(scene, light, 12)
    normal = light_row(scene, light, 16)
    w1, w2 = uniform_triangle(u, v)
    p = xyz(corner) + xyz(edge1) * w1 + xyz(edge2) * w2
    reach = max_abs_component(xyz(corner)) + max_abs_component(xyz(edge1)) + max_abs_component(xyz(edge2))
    to_light = in_front(p, xyz(normal), reach, o) - o
    distance2 = dot(to_light, to_light)
    distance = sqrt(distance2)
    direction = to_light * inverse(distance)
    cosine = -dot(xyz(normal), direction)
    cosine = abs(cosine) if edge2[3] > 0.0 else cosine
    radiance = triangle_radiance(scene, as_int(edge1[3]), as_int(normal[3]), w1, w2)
    # A choice of values, not of branches: which way it goes cannot be predicted.
    pdf = corner[3] * distance2 / cosine if cosine > GRAZING else f32(0.0)
    return LightSample(direction, distance, radiance, pdf, pdf, False)


@kernel
def triangle_radiance(scene, primitive, material, w1, w2):
    """Radiance of a point on an emissive triangle."""
    u, v = interpolated_uv(scene, primitive, w1, w2)
    corner = primitive * 4
    return emission_at(scene, material, corner, u, v, w1, w2) * opacity_at(scene, material, corner, u, v, w1, w2)


@kernel
def no_uv(scene, primitive, w1, w2):
    """A scene without textures."""
    return f32(0.0), f32(0.0)


@kernel(needs=TEXTURES, otherwise=no_uv)
def interpolated_uv(scene, primitive, w1, w2):
    """Texture coordinates at a point of a triangle."""
    corner = primitive * 4
    i0 = load(scene.corners, corner) * VERTEX_SIZE
    i1 = load(scene.corners, corner + 1) * VERTEX_SIZE
    i2 = load(scene.corners, corner + 2) * VERTEX_SIZE
    w0 = 1.0 - w1 - w2
    u = load(scene.vertices, i0 + 3) * w0 + load(scene.vertices, i1 + 3) * w1 + load(scene.vertices, i2 + 3) * w2
    v = load(scene.vertices, i0 + 7) * w0 + load(scene.vertices, i1 + 7) * w1 + load(scene.vertices, i2 + 7) * w2
    return u, v


@kernel
def closed(scene):
    """A scene whose surfaces are all closed."""
    return False


@kernel(needs=OPACITY, otherwise=closed)
def through_holes(scene):
    """Whether the far side of a closed shape may be seen from outside."""
    return True


@kernel
def sample_quadric_light(scene, light, o, a, b):
    """A point on an emissive quadric: uniform in its object space, or for round ones in what is seen of them."""
    x = light_row(scene, light, 4)
    y = light_row(scene, light, 8)
    z = light_row(scene, light, 12)
    names = light_row(scene, light, 16)
    q = quadric_at(scene.quadrics, as_int(names[0]))
    local = point_to_object(q, o)
    drawn = seen_point(scene, q, local, a, b)
    point = drawn.point
    p = Vec3(
        dot(xyz(x), point.p) + x[3],
        dot(xyz(y), point.p) + y[3],
        dot(xyz(z), point.p) + z[3],
    )
    normal = normalize(normal_to_world(q, point.n))
    reach = max_abs_component(xyz(x)) + max_abs_component(xyz(y)) + max_abs_component(xyz(z)) + max_abs_component(p)
    to_light = in_front(p, normal, reach, o) - o
    distance2 = dot(to_light, to_light)
    distance = sqrt(distance2)
    direction = to_light * inverse(distance)
    facing = -dot(normal, direction)
    cosine = abs(facing)
    # The far side of a closed shape is seen from inside only.
    seen = (facing > 0.0) | (q.kind == OPEN_CONE) | is_inside(q, local) | through_holes(scene)
    u, v = object_uv(q, point.p, point.n)
    material = as_int(names[2])
    shown = opacity_at(scene, material, i32(-1), u, v, 0.0, 0.0)
    radiance = emission_at(scene, material, i32(-1), u, v, 0.0, 0.0) * shown
    pdf = names[3] / area_scale(q, point.n) * distance2 / cosine if (cosine > GRAZING) & seen else f32(0.0)
    pdf = names[3] * drawn.gain if drawn.gain > 0.0 else pdf
    return LightSample(direction, distance, radiance, pdf, pdf, False)


@kernel
def sample_environment_light(scene, light, o, u, v):
    """A direction of the environment."""
    s = sample_environment(scene, u, v)
    pdf = s.pdf * scene.environment_probability
    return LightSample(s.direction, INF, s.radiance, pdf, pdf, False)


# One link for each kind of light; those that a scene lacks are left out of its kernels.


@kernel
def from_triangle(scene, light, kind, o, u, v):
    """The last link: a triangle."""
    return sample_triangle_light(scene, light, o, u, v)


@kernel(needs=QUADRIC_LIGHTS, otherwise=from_triangle)
def from_surface(scene, light, kind, o, u, v):
    """A quadric, or else."""
    if kind == QUADRIC_LIGHT:
        return sample_quadric_light(scene, light, o, u, v)
    return from_triangle(scene, light, kind, o, u, v)


@kernel(needs=POINT_LIGHTS, otherwise=from_surface)
def from_point(scene, light, kind, o, u, v):
    """A point light, or else."""
    if kind == POINT_LIGHT:
        return sample_point_light(scene, light, o, u, v)
    return from_surface(scene, light, kind, o, u, v)


@kernel(needs=SPOT_LIGHTS, otherwise=from_point)
def from_spot(scene, light, kind, o, u, v):
    """A spot light, or else."""
    if kind == SPOT_LIGHT:
        return sample_spot_light(scene, light, o, u, v)
    return from_point(scene, light, kind, o, u, v)


@kernel(needs=DIRECTIONAL_LIGHTS, otherwise=from_spot)
def from_direction(scene, light, kind, o, u, v):
    """A directional light, or else."""
    if kind == DIRECTIONAL_LIGHT:
        return sample_directional_light(scene, light, o, u, v)
    return from_spot(scene, light, kind, o, u, v)


@kernel(needs=SUNS, otherwise=from_direction)
def from_sun(scene, light, kind, o, u, v):
    """A sun, or else."""
    if kind == SUN_LIGHT:
        return sample_sun(scene, light, o, u, v)
    return from_direction(scene, light, kind, o, u, v)


@kernel(needs=ENVIRONMENT, otherwise=from_sun)
def from_any(scene, light, kind, o, u, v):
    """The environment, or else."""
    if kind == ENVIRONMENT_LIGHT:
        return sample_environment_light(scene, light, o, u, v)
    return from_sun(scene, light, kind, o, u, v)


@kernel
def pick_light(scene, first, u):
    """Draw from the alias table of the lights from number `first` on."""
    count = i32(scene.light_count - first)
    x = u * f32(count)
    i = min(i32(x), i32(count - 1))
    row = light_row(scene, i32(first + i), 0)
    return resolve_alias(i32(first + i), as_int(row[1]), row[0], x - f32(i))


@kernel
def pick_and_reuse(scene, pixel, sample, seed, depth, u):
    """Choose among few lights: what the choice leaves of the number places the point."""
    return pick_light(scene, i32(0), u)


@kernel(needs=MANY_LIGHTS, otherwise=pick_and_reuse)
def choose_light(scene, pixel, sample, seed, depth, u):
    """Choose a light by its fixed probability; many lights need a number of their own."""
    chosen = pick_light(scene, i32(0), choice_numbers(scene, pixel, sample, seed, depth).a)
    return Pick(chosen.index, u)


@kernel
def sample_from_table(scene, o, n, pixel, sample, seed, depth, u, v):
    """A light chosen by a probability that is the same everywhere."""
    chosen = choose_light(scene, pixel, sample, seed, depth, u)
    kind = as_int(light_row(scene, chosen.index, 0)[3])
    return from_any(scene, chosen.index, kind, o, chosen.rest, v), chosen.index


@kernel
def pick_from_tree(scene, o, n, u):
    """A light that is near, by the tree, or one infinitely far away, by the table of those."""
    pick = resolve_alias(i32(0), i32(1), scene.tree_probability, u)
    if pick.index == 1:
        # Their probability is in their records.
        return Chosen(pick_light(scene, scene.first_infinite, pick.rest).index, 1.0, 1.0)
    chosen = descend(scene, o, n, pick.rest)
    return Chosen(chosen.light, chosen.pdf * scene.tree_probability, chosen.rival * scene.tree_probability)


@kernel(needs=LIGHT_TREE, otherwise=sample_from_table)
def sample_from_tree(scene, o, n, pixel, sample, seed, depth, u, v):
    """A light chosen by what it may do for the point."""
    chosen = pick_from_tree(scene, o, n, choice_numbers(scene, pixel, sample, seed, depth).a)
    if not chosen.pdf > 0.0:
        # The number of any light will do.
        return no_light(), i32(0)
    kind = as_int(light_row(scene, chosen.light, 0)[3])
    s = from_any(scene, chosen.light, kind, o, u, v)
    s = LightSample(s.direction, s.distance, s.radiance, s.pdf * chosen.pdf, s.rival * chosen.rival, s.delta)
    return s, chosen.light


@kernel
def sample_nothing(scene, o, n, pixel, sample, seed, depth, u, v):
    """A scene without lights."""
    return no_light(), i32(-1)


@kernel(needs=ANY_LIGHT, otherwise=sample_nothing)
def sample_light(scene, o, n, pixel, sample, seed, depth, u, v):
    """Light that may arrive at the point o, and the number of the light that it comes from.

    Of a surface only the side to which its normal n points is lit; n = 0: either.
    """
    return sample_from_tree(scene, o, n, pixel, sample, seed, depth, u, v)


@kernel
def triangle_emitter_pdf(scene, ray, hit, s):
    """Density per solid angle with which `sample_light` finds the triangle that a ray hit."""
    return load(scene.emitter_density, hit.primitive) * hit.t * hit.t / abs(dot(s.n, ray.d))


@kernel(needs=QUADRICS, otherwise=triangle_emitter_pdf)
def surface_emitter_pdf(scene, ray, hit, s):
    """Density per solid angle with which `sample_from_table` finds the point that a ray hit."""
    pdf = triangle_emitter_pdf(scene, ray, hit, s)
    if hit.primitive < scene.triangle_count:
        return pdf
    q = quadric_at(scene.quadrics, hit.primitive - scene.triangle_count)
    gain = seen_gain(scene, q, point_to_object(q, ray.o))
    if gain > 0.0:
        return load(scene.emitter_density, hit.primitive) * gain
    return pdf / area_scale(q, object_normal(q, point_to_object(q, s.p)))


@kernel(needs=LIGHT_TREE, otherwise=surface_emitter_pdf)
def emitter_pdf(scene, ray, hit, s):
    """What `LightSample.rival` is where `sample_light` finds the point that a ray hit, from the ray's origin."""
    share = rival_of(scene, hit.primitive, ray.o) * scene.tree_probability
    return surface_emitter_pdf(scene, ray, hit, s) * share
