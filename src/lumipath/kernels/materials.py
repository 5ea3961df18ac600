"""A surface's material as the weights of its lobes at one point."""

from __future__ import annotations

from ..lang import Vec3, f32, kernel, load, load4, struct
from ..pack.layout import (
    BLENDED_MATERIALS,
    DIELECTRICS,
    DIFFUSE,
    EMISSION,
    INTERNAL_TINT,
    MATERIAL_SIZE,
    MIRROR,
    MIRRORS,
    REFLECTION_TINT,
    REFRACTION,
)
from .textures import colour_at
from .vectors import black, white


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
def no_mirror(scene, material, u, v):
    """No mirror lobe."""
    return black()


@kernel(needs=MIRRORS, otherwise=no_mirror)
def mirror_weight(scene, material, u, v):
    """Weight of the mirror lobe."""
    return colour_at(scene, load4(scene.materials, material * MATERIAL_SIZE + MIRROR), u, v)


@kernel
def opaque_lobes(scene, material, diffuse, mirror, u, v):
    """The lobes of a surface that lets no light through."""
    return Lobes(diffuse, mirror, 0.0, 1.0, white(), white())


@kernel(needs=DIELECTRICS, otherwise=opaque_lobes)
def with_dielectric(scene, material, diffuse, mirror, u, v):
    """All lobes."""
    row = material * MATERIAL_SIZE
    refraction = load4(scene.materials, row + REFRACTION)
    reflection = colour_at(scene, load4(scene.materials, row + REFLECTION_TINT), u, v)
    internal = colour_at(scene, load4(scene.materials, row + INTERNAL_TINT), u, v)
    return Lobes(diffuse, mirror, refraction[1], refraction[0], reflection, internal)


@kernel
def material_lobes(scene, material, u, v):
    """The lobes of one material."""
    diffuse = colour_at(scene, load4(scene.materials, material * MATERIAL_SIZE + DIFFUSE), u, v)
    return with_dielectric(scene, material, diffuse, mirror_weight(scene, material, u, v), u, v)


@kernel
def single_lobes(scene, s):
    """The lobes of a surface of one material."""
    return material_lobes(scene, s.material, s.u, s.v)


@kernel(needs=BLENDED_MATERIALS, otherwise=single_lobes)
def lobes_at(scene, s):
    """The lobes at a point of a surface, blended between the materials of the corners where they differ."""
    if s.corner < 0:
        return material_lobes(scene, s.material, s.u, s.v)
    w1 = s.w1
    w2 = s.w2
    w0 = 1.0 - w1 - w2
    a = material_lobes(scene, load(scene.vertex_materials, load(scene.corners, s.corner)), s.u, s.v)
    b = material_lobes(scene, load(scene.vertex_materials, load(scene.corners, s.corner + 1)), s.u, s.v)
    c = material_lobes(scene, load(scene.vertex_materials, load(scene.corners, s.corner + 2)), s.u, s.v)
    return Lobes(
        a.diffuse * w0 + b.diffuse * w1 + c.diffuse * w2,
        a.mirror * w0 + b.mirror * w1 + c.mirror * w2,
        a.transmission * w0 + b.transmission * w1 + c.transmission * w2,
        a.index * w0 + b.index * w1 + c.index * w2,
        a.reflection_tint * w0 + b.reflection_tint * w1 + c.reflection_tint * w2,
        a.internal_tint * w0 + b.internal_tint * w1 + c.internal_tint * w2,
    )


@kernel
def material_emission(scene, material, u, v):
    """Radiance that leaves a surface of one material."""
    return colour_at(scene, load4(scene.materials, material * MATERIAL_SIZE + EMISSION), u, v)


@kernel
def single_emission(scene, material, corner, u, v, w1, w2):
    """Radiance that leaves a surface of one material."""
    return material_emission(scene, material, u, v)


@kernel(needs=BLENDED_MATERIALS, otherwise=single_emission)
def emission_at(scene, material, corner, u, v, w1, w2):
    """Radiance that leaves a point, blended between the materials of a triangle's corners; corner as in `Surface`."""
    if corner < 0:
        return material_emission(scene, material, u, v)
    a = material_emission(scene, load(scene.vertex_materials, load(scene.corners, corner)), u, v)
    b = material_emission(scene, load(scene.vertex_materials, load(scene.corners, corner + 1)), u, v)
    c = material_emission(scene, load(scene.vertex_materials, load(scene.corners, corner + 2)), u, v)
    return a * (1.0 - w1 - w2) + b * w1 + c * w2
