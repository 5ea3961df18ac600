"""A surface's material as the weights of its lobes at one point."""

from __future__ import annotations

from ..lang import Vec3, f32, kernel, load, load4, struct
from ..pack.layout import (
    BLENDED_MATERIALS,
    DIFFUSE,
    EMISSION,
    INTERNAL_TINT,
    LOBE_GLASS,
    LOBE_MIRRORS,
    LOOKS,
    MATERIAL_SIZE,
    MIRROR,
    MIXES,
    REFLECTION_TINT,
    REFRACTION,
    VERTEX_COLOURS,
)
from .textures import emitted_colour, lobe_colour
from .vectors import black, white
from .vertex_colours import vertex_colour


@struct
class Lobes:
    """Lambert, mirror and dielectric lobe at a point."""

    diffuse: Vec3
    mirror: Vec3
    transmission: f32  # weight of the dielectric lobe; 0: none
    index: f32
    reflection_tint: Vec3
    internal_tint: Vec3


@kernel
def no_mirror(scene, material, u, v, footprint):
    """No mirror lobe."""
    return black()


@kernel(needs=LOBE_MIRRORS | LOOKS, otherwise=no_mirror)
def mirror_weight(scene, material, u, v, footprint):
    """Weight of the mirror lobe."""
    return lobe_colour(scene, load4(scene.materials, material * MATERIAL_SIZE + MIRROR), u, v, footprint)


@kernel
def opaque_lobes(scene, material, diffuse, mirror, u, v, footprint):
    """The lobes of a surface that lets no light through."""
    return Lobes(diffuse, mirror, 0.0, 1.0, white(), white())


@kernel(needs=LOBE_GLASS | LOOKS, otherwise=opaque_lobes)
def with_dielectric(scene, material, diffuse, mirror, u, v, footprint):
    """All lobes."""
    row = material * MATERIAL_SIZE
    refraction = load4(scene.materials, row + REFRACTION)
    reflection = lobe_colour(scene, load4(scene.materials, row + REFLECTION_TINT), u, v, footprint)
    internal = lobe_colour(scene, load4(scene.materials, row + INTERNAL_TINT), u, v, footprint)
    return Lobes(diffuse, mirror, refraction[1], refraction[0], reflection, internal)


@kernel
def material_lobes(scene, material, u, v, footprint):
    """The lobes of one material."""
    diffuse = lobe_colour(scene, load4(scene.materials, material * MATERIAL_SIZE + DIFFUSE), u, v, footprint)
    return with_dielectric(scene, material, diffuse, mirror_weight(scene, material, u, v, footprint), u, v, footprint)


@kernel
def single_lobes(scene, s):
    """The lobes of a surface of one material."""
    return material_lobes(scene, s.material, s.u, s.v, s.footprint)


@kernel(needs=BLENDED_MATERIALS, otherwise=single_lobes)
def uncoloured_lobes(scene, s):
    """The lobes at a point of a surface, blended between the materials of the corners where they differ."""
    # Where they do not, the surface may have a part of a mix, which is not what the corners have.
    if (s.corner < 0) or is_of_one_material(scene, s):
        return material_lobes(scene, s.material, s.u, s.v, s.footprint)
    w1 = s.w1
    w2 = s.w2
    w0 = 1.0 - w1 - w2
    a = corner_lobes(scene, s, 0)
    b = corner_lobes(scene, s, 1)
    c = corner_lobes(scene, s, 2)
    return Lobes(
        a.diffuse * w0 + b.diffuse * w1 + c.diffuse * w2,
        a.mirror * w0 + b.mirror * w1 + c.mirror * w2,
        a.transmission * w0 + b.transmission * w1 + c.transmission * w2,
        a.index * w0 + b.index * w1 + c.index * w2,
        a.reflection_tint * w0 + b.reflection_tint * w1 + c.reflection_tint * w2,
        a.internal_tint * w0 + b.internal_tint * w1 + c.internal_tint * w2,
    )


@kernel
def always_blended(scene, s):
    """A scene without mixes, in which one material blended with itself is what it was."""
    return False


@kernel(needs=MIXES, otherwise=always_blended)
def is_of_one_material(scene, s):
    """Whether the corners of a triangle have the same material."""
    if s.corner < 0:
        return True
    first = load(scene.vertex_materials, load(scene.corners, s.corner))
    second = load(scene.vertex_materials, load(scene.corners, s.corner + 1))
    return (first == second) & (first == load(scene.vertex_materials, load(scene.corners, s.corner + 2)))


@kernel
def corner_lobes(scene, s, which):
    """The lobes of the material of one corner."""
    material = load(scene.vertex_materials, load(scene.corners, s.corner + which))
    return material_lobes(scene, material, s.u, s.v, s.footprint)


@kernel(needs=VERTEX_COLOURS, otherwise=uncoloured_lobes)
def lobes_at(scene, s):
    """The lobes at a point of a surface; colours of vertices tint the Lambert lobe."""
    lobes = uncoloured_lobes(scene, s)
    diffuse = lobes.diffuse * vertex_colour(scene, s.corner, s.w1, s.w2)
    return Lobes(diffuse, lobes.mirror, lobes.transmission, lobes.index, lobes.reflection_tint, lobes.internal_tint)


@kernel
def material_emission(scene, material, u, v, footprint):
    """Radiance that leaves a surface of one material."""
    return emitted_colour(scene, load4(scene.materials, material * MATERIAL_SIZE + EMISSION), u, v, footprint)


@kernel
def single_emission(scene, material, corner, u, v, w1, w2, footprint):
    """Radiance that leaves a surface of one material."""
    return material_emission(scene, material, u, v, footprint)


@kernel(needs=BLENDED_MATERIALS, otherwise=single_emission)
def seen_emission(scene, material, corner, u, v, w1, w2, footprint):
    """Radiance that leaves a point, blended between the materials of a triangle's corners; corner as in `Surface`."""
    if corner < 0:
        return material_emission(scene, material, u, v, footprint)
    a = material_emission(scene, load(scene.vertex_materials, load(scene.corners, corner)), u, v, footprint)
    b = material_emission(scene, load(scene.vertex_materials, load(scene.corners, corner + 1)), u, v, footprint)
    c = material_emission(scene, load(scene.vertex_materials, load(scene.corners, corner + 2)), u, v, footprint)
    return a * (1.0 - w1 - w2) + b * w1 + c * w2


@kernel
def emission_at(scene, material, corner, u, v, w1, w2):
    """Radiance that leaves a point, its texture as it is."""
    return seen_emission(scene, material, corner, u, v, w1, w2, 0.0)
