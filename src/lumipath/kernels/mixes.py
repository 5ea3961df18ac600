"""Surfaces of several materials: which of them a ray meets."""

from __future__ import annotations

from ..lang import as_int, f32, i32, kernel, load4
from ..pack.layout import MAP_MIX, MAP_SIZE, MATERIAL_MASK, MIXES, PRIMITIVE_SIZE
from .instances import placed_material
from .sampler import surface_numbers
from .surface import with_material
from .textures import number_at

# The greatest depth of mixes within mixes.
_DEPTH = 8


@kernel
def unmixed(scene, view, s, pixel, sample, depth):
    """A scene without mixes."""
    return s


@kernel(needs=MIXES, otherwise=unmixed)
def with_one_material(scene, view, s, pixel, sample, depth):
    """The surface with a part of its mix, each as likely as its weight."""
    material = s.material
    row = load4(scene.maps, material * MAP_SIZE + MAP_MIX)
    if as_int(row[1]) < 0:
        return s
    number = surface_numbers(scene, pixel, sample, view.seed, depth).a
    for _ in range(_DEPTH):
        if as_int(row[1]) < 0:
            break
        weight = min(max(number_at(scene, row[0], as_int(row[3]), s.u, s.v), 0.0), 1.0)
        second = number < weight
        # What is left of the number decides the mix within.
        number = number / weight if second else (number - weight) / (1.0 - weight)
        number = min(number, f32(0.99999994))
        material = as_int(row[2]) if second else as_int(row[1])
        row = load4(scene.maps, material * MAP_SIZE + MAP_MIX)
    return with_material(s, material)


@kernel
def only_material(scene, s, hit):
    """A scene without mixes."""
    return s.material


@kernel(needs=MIXES, otherwise=only_material)
def emitting_material(scene, s, hit):
    """The material whose emission a surface has: that of the whole mix."""
    word = as_int(load4(scene.primitives, hit.primitive * PRIMITIVE_SIZE)[3])
    return placed_material(scene, hit.instance, i32(word & MATERIAL_MASK))
