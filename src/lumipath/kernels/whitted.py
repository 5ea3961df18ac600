"""Classic recursive ray tracing: mirrors, refraction and shadows by rays, the rest by Phong's formula.

Whitted 1980, An Improved Illumination Model for Shaded Display; Phong 1975, Illumination for Computer Generated
Pictures. No direction is drawn at random: where light both reflects and refracts, one ray is followed and the other
waits on a stack.
"""

from __future__ import annotations

from ..lang import INV_PI, Vec3, as_float, as_int, f32, get, i32, kernel, load, load4, put, stack_floats, struct
from ..pack.layout import (
    BLENDED_MATERIALS,
    DELTA_LIGHTS,
    DIELECTRICS,
    PHONG_AMBIENT,
    PHONG_EXPONENT,
    PHONG_HIGHLIGHT,
    PHONG_MIRROR,
    PHONG_SIZE,
    POINT_LIGHT,
    SPOT_LIGHT,
    SPOT_LIGHTS,
)
from .bsdf.dielectric import refracted_direction
from .bsdf.mirror import mirror_direction
from .camera import camera_sample
from .environment import environment_from
from .fresnel import refracted_cosine
from .functions import unit_power
from .materials import emission_at, lobes_at
from .media import has_inside, is_dielectric, medium_beyond, transmittance
from .normal_maps import mapped_surface
from .punctual import light_row, sample_directional_light, sample_point_light, sample_spot_light, with_suns
from .rays import SHADOW_END, Ray, endless_ray, offset_point
from .sampler import camera_numbers
from .surface import surface_at
from .textures import lobe_colour
from .vectors import black, dot, frame_around, max_component, to_local, to_world, white

MAX_LEVELS = i32(32)
"""Greatest `max_depth`. Following depth first leaves at most one ray a level waiting."""

_BRANCH = i32(11)
_STACK = 32 * 11

# Rays and shadows of less weight than this are dropped (Hall and Greenberg 1983): two mirrors would else double the
# rays at each level.
CUTOFF = f32(1e-4)

# Surfaces that a shadow ray goes through at most; a guard, for no scene has as many in a row.
_MAX_CROSSINGS = 1024


@struct
class Phong:
    """A material at a point, as Whitted ray tracing sees it."""

    ambient: Vec3
    diffuse: Vec3
    highlight: Vec3
    exponent: f32
    mirror: Vec3
    index: f32
    internal: Vec3  # weight of total internal reflection


@struct
class Branch:
    """A ray of the tree of rays."""

    ray: Ray
    weight: Vec3  # what its radiance is multiplied by on the way to the pixel
    depth: i32  # surfaces before it
    medium: i32  # material that it travels in, -1 outside


@struct
class Split:
    """What becomes of a branch: radiance for the pixel, and two branches, of weight 0 where there is none."""

    light: Vec3
    mirrored: Branch
    refracted: Branch


@kernel
def material_phong(scene, material, lobes, u, v):
    """Phong's parameters of one material."""
    row = material * PHONG_SIZE
    ambient = lobe_colour(scene, load4(scene.phong, row + PHONG_AMBIENT), u, v, 0.0)
    highlight = lobe_colour(scene, load4(scene.phong, row + PHONG_HIGHLIGHT), u, v, 0.0)
    mirror = lobe_colour(scene, load4(scene.phong, row + PHONG_MIRROR), u, v, 0.0)
    exponent = load4(scene.phong, row + PHONG_EXPONENT)[0]
    return Phong(ambient, lobes.diffuse, highlight, exponent, mirror, lobes.index, lobes.internal_tint)


@kernel
def single_phong(scene, s):
    """Phong's parameters at a point of a surface of one material."""
    return material_phong(scene, s.material, lobes_at(scene, s), s.u, s.v)


@kernel(needs=BLENDED_MATERIALS, otherwise=single_phong)
def phong_at(scene, s):
    """Phong's parameters at a point of a surface, blended between the materials of the corners where they differ."""
    lobes = lobes_at(scene, s)
    if s.corner < 0:
        return material_phong(scene, s.material, lobes, s.u, s.v)
    w1 = s.w1
    w2 = s.w2
    w0 = 1.0 - w1 - w2
    a = material_phong(scene, load(scene.vertex_materials, load(scene.corners, s.corner)), lobes, s.u, s.v)
    b = material_phong(scene, load(scene.vertex_materials, load(scene.corners, s.corner + 1)), lobes, s.u, s.v)
    c = material_phong(scene, load(scene.vertex_materials, load(scene.corners, s.corner + 2)), lobes, s.u, s.v)
    return Phong(
        a.ambient * w0 + b.ambient * w1 + c.ambient * w2,
        lobes.diffuse,
        a.highlight * w0 + b.highlight * w1 + c.highlight * w2,
        a.exponent * w0 + b.exponent * w1 + c.exponent * w2,
        a.mirror * w0 + b.mirror * w1 + c.mirror * w2,
        lobes.index,
        lobes.internal_tint,
    )


# ---- shadows ---------------------------------------------------------------------------------------------------------


@kernel
def opaque_shadow(scene, trace, ray):
    """A scene in which nothing lets light through."""
    return white() if trace(scene, ray, True).primitive < 0 else black()


@kernel(needs=DIELECTRICS, otherwise=opaque_shadow)
def shadow_tint(scene, trace, ray):
    """Fraction of light that comes along a ray: glass lets it go straight on and absorbs, all else stops it."""
    tint = white()
    for _ in range(_MAX_CROSSINGS):
        hit = trace(scene, ray, False)
        if hit.primitive < 0:
            return tint
        s = surface_at(scene, ray, hit)
        # Arriving at the back of a dielectric means having been inside.
        tint = tint * transmittance(scene, i32(-1) if s.front else s.material, hit.t)
        if (not is_dielectric(scene, s.material)) | (not max_component(tint) > CUTOFF):
            return black()
        ray = Ray(offset_point(s.p, -s.n, hit.t, s.reach), ray.d, ray.tmax - hit.t)
    return black()


# ---- light at a surface ----------------------------------------------------------------------------------------------


@kernel
def point_or_direction(scene, light, kind, o):
    """Light from a point light or from a direction."""
    if kind == POINT_LIGHT:
        return sample_point_light(scene, light, o, 0.0, 0.0)
    return sample_directional_light(scene, light, o, 0.0, 0.0)


@kernel(needs=SPOT_LIGHTS, otherwise=point_or_direction)
def spot_or_other(scene, light, kind, o):
    """Light from a spot light, or else."""
    if kind == SPOT_LIGHT:
        return sample_spot_light(scene, light, o, 0.0, 0.0)
    return point_or_direction(scene, light, kind, o)


@kernel
def delta_light(scene, light, o):
    """Light without a surface, with a facing white diffuse surface's radiance times pi; a sun is its middle."""
    return spot_or_other(scene, light, as_int(light_row(scene, light, 0)[3]), o)


@kernel
def highlight_of(phong, towards_light, towards_viewer, normal, side):
    """Phong's highlight: how near the viewer is to the light's mirrored direction; none on the far side of glass."""
    mirrored = normal * (2.0 * dot(normal, towards_light)) - towards_light
    cosine = dot(mirrored, towards_viewer)
    if (side < 0.0) | (not cosine > 0.0):
        return black()
    return phong.highlight * unit_power(min(cosine, 1.0), phong.exponent)


@kernel
def unlit(scene, trace, ray, hit, s, side, phong):
    """A scene without point and directional lights."""
    return black()


@kernel(needs=DELTA_LIGHTS, otherwise=unlit)
def local_light(scene, trace, ray, hit, s, side, phong):
    """Phong's formula for all point and directional lights, on the viewer's side (1) or beyond the surface (-1)."""
    total = black()
    n = s.n * side
    shading = s.shading * side
    o = offset_point(s.p, n, hit.t, s.reach)
    for k in range(scene.delta_count):
        light = delta_light(scene, i32(scene.first_delta + k), o)
        cosine = dot(shading, light.direction)
        if (cosine > 0.0) & (dot(n, light.direction) > 0.0):
            reflected = phong.diffuse * cosine + highlight_of(phong, light.direction, -ray.d, shading, side)
            if max_component(reflected) > 0.0:
                tint = shadow_tint(scene, trace, Ray(o, light.direction, light.distance * SHADOW_END))
                total = total + light.radiance * tint * reflected * INV_PI
    return total


# ---- the tree of rays ------------------------------------------------------------------------------------------------


@kernel
def branch_off(s, branch, hit, direction, weight, medium):
    """The branch that leaves a surface in a direction."""
    n = s.n if dot(s.n, direction) > 0.0 else -s.n
    o = offset_point(s.p, n, hit.t, s.reach)
    return Branch(endless_ray(o, direction), weight, i32(branch.depth + 1), medium)


@kernel
def dead(branch):
    """No branch."""
    return Branch(branch.ray, black(), branch.depth, branch.medium)


@kernel
def only_mirrored(scene, branch, hit, s, phong, weight, medium):
    """A surface that lets no light through."""
    frame = frame_around(s.shading)
    mirrored = to_world(frame, mirror_direction(to_local(frame, -branch.ray.d)))
    return branch_off(s, branch, hit, mirrored, weight * phong.mirror, medium), dead(branch)


@kernel(needs=DIELECTRICS, otherwise=only_mirrored)
def reflect_and_refract(scene, branch, hit, s, phong, weight, medium):
    """The mirrored branch and the refracted one."""
    frame = frame_around(s.shading)
    wo = to_local(frame, -branch.ray.d)
    mirrored = to_world(frame, mirror_direction(wo))
    if not is_dielectric(scene, s.material):
        return branch_off(s, branch, hit, mirrored, weight * phong.mirror, medium), dead(branch)
    eta = phong.index if s.front else 1.0 / phong.index
    through = refracted_cosine(wo.z, eta)
    if not through > 0.0:
        # Total internal reflection: what would have been refracted joins what is mirrored.
        return branch_off(s, branch, hit, mirrored, weight * phong.internal, medium), dead(branch)
    refracted = to_world(frame, refracted_direction(wo, through, eta))
    beyond = medium_beyond(scene, s, dot(s.n, refracted) > 0.0, medium)
    return (
        branch_off(s, branch, hit, mirrored, weight * phong.mirror, medium),
        branch_off(s, branch, hit, refracted, weight, beyond),
    )


@kernel
def split(scene, view, trace, branch):
    """Follow a branch to the next surface."""
    hit = trace(scene, branch.ray, False)
    if hit.primitive < 0:
        radiance = with_suns(scene, branch.ray.d, environment_from(scene, branch.ray.d).radiance)
        return Split(branch.weight * radiance, dead(branch), dead(branch))
    s = mapped_surface(scene, branch.ray, hit)
    # As in the path tracer: at the back of a dielectric one has been inside, and its paint lies on its outside.
    behind = has_inside(scene, s.material) & (not s.front)
    medium = s.material if behind else branch.medium
    weight = branch.weight * transmittance(scene, medium, hit.t)
    light = weight * emission_at(scene, s.material, s.corner, s.u, s.v, s.w1, s.w2)
    if branch.depth >= view.max_depth:
        return Split(light, dead(branch), dead(branch))
    phong = phong_at(scene, s)
    side = f32(-1.0) if behind else f32(1.0)
    ambient = load4(scene.ambient, 0)
    local = phong.ambient * Vec3(ambient[0], ambient[1], ambient[2])
    local = local + local_light(scene, trace, branch.ray, hit, s, side, phong)
    mirrored, refracted = reflect_and_refract(scene, branch, hit, s, phong, weight, medium)
    return Split(light + weight * local, mirrored, refracted)


@kernel
def push(stack, waiting, branch):
    """Put a branch on the stack as its entry `waiting`."""
    row = waiting * _BRANCH
    put(stack, row, branch.ray.o.x)
    put(stack, row + 1, branch.ray.o.y)
    put(stack, row + 2, branch.ray.o.z)
    put(stack, row + 3, branch.ray.d.x)
    put(stack, row + 4, branch.ray.d.y)
    put(stack, row + 5, branch.ray.d.z)
    put(stack, row + 6, branch.weight.x)
    put(stack, row + 7, branch.weight.y)
    put(stack, row + 8, branch.weight.z)
    put(stack, row + 9, as_float(branch.depth))
    put(stack, row + 10, as_float(branch.medium))


@kernel
def entry_of(stack, which):
    """The branch that is entry `which` of the stack."""
    row = which * _BRANCH
    o = Vec3(get(stack, row), get(stack, row + 1), get(stack, row + 2))
    d = Vec3(get(stack, row + 3), get(stack, row + 4), get(stack, row + 5))
    weight = Vec3(get(stack, row + 6), get(stack, row + 7), get(stack, row + 8))
    return Branch(endless_ray(o, d), weight, as_int(get(stack, row + 9)), as_int(get(stack, row + 10)))


@kernel
def whitted(scene, view, trace, column, row, pixel, sample):
    """Radiance of one sample of a pixel.

    Args:
        scene: PackedScene.
        view: View, with max_depth up to `MAX_LEVELS`.
        trace: kernel (scene, ray, any_hit) -> Hit.
        column: of the pixel in the full image.
        row: of the pixel in the full image, 0 at the top.
        pixel: its number in the full image.
        sample: number of the sample in the pixel.
    """
    seen = camera_sample(scene, view, column, row, camera_numbers(scene, pixel, sample, view.seed))
    branch = Branch(seen.ray, white(), i32(0), i32(-1))
    stack = stack_floats(_STACK)
    waiting = i32(0)
    total = black()
    going = True
    while going:
        step = split(scene, view, trace, branch)
        total = total + step.light
        reflects = max_component(step.mirrored.weight) > CUTOFF
        refracts = max_component(step.refracted.weight) > CUTOFF
        branch = step.refracted if refracts else step.mirrored
        if reflects & refracts:
            push(stack, waiting, step.mirrored)
            waiting = i32(waiting + 1)
        elif not (reflects | refracts):
            going = waiting > 0
            if going:
                waiting = i32(waiting - 1)
                branch = entry_of(stack, waiting)
    return total * seen.weight
