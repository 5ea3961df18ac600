"""Layers of light: the parts of a picture that add up to it, by scattering events and by light.

Each contribution to a sample is added to a column of three numbers as well: that of its scattering events, that of the
light it comes from, or both. Squares of whole samples are a layer of the same kind.
"""

from __future__ import annotations

from ..lang import as_int, f32, i32, kernel, load
from ..pack.layout import GROUPS, LIGHT_GROUP, LIGHT_SIZE, PARTS, VARIANCE
from .vectors import Vec3

# Seen directly, scattered once, scattered more often.
_PARTS = i32(3)

# Of radiance, W^2/(m^4 sr^2).
LARGEST_SQUARE = f32(1e28)


@kernel
def one_group(scene, number):
    """Nobody asks for groups."""
    return i32(0)


@kernel(needs=GROUPS, otherwise=one_group)
def emitter_group(scene, number):
    """The group of what a material emits; -1 stands for the environment."""
    return load(scene.light_groups, number + 1)


@kernel(needs=GROUPS, otherwise=one_group)
def light_group(scene, number):
    """The group of a light of the table."""
    return as_int(load(scene.lights, number * LIGHT_SIZE + LIGHT_GROUP))


@kernel
def no_columns(scene):
    """Nobody asks for these layers."""
    return i32(0)


@kernel(needs=PARTS, otherwise=no_columns)
def part_columns(scene):
    """Columns of emission, direct and indirect light."""
    return i32(3 * _PARTS)


@kernel(needs=GROUPS, otherwise=no_columns)
def group_columns(scene):
    """Columns of the light groups."""
    return i32(3 * scene.group_count)


@kernel(needs=VARIANCE, otherwise=no_columns)
def square_columns(scene):
    """Columns of the squares of samples."""
    return i32(3)


@kernel
def light_columns(scene):
    """Columns that contributions are added to; those of squares follow them."""
    return i32(part_columns(scene) + group_columns(scene))


@kernel
def all_columns(scene):
    """Columns of all layers of the film."""
    return i32(light_columns(scene) + square_columns(scene))


@kernel
def to_no_layer(scene, put, sums, place, events, group, light):
    """Nobody asks for this layer."""


@kernel(needs=PARTS, otherwise=to_no_layer)
def to_part(scene, put, sums, place, events, group, light):
    """Add a contribution to the part that its scattering events name."""
    put(scene, sums, place, i32(3 * min(i32(events), _PARTS - 1)), light)


@kernel(needs=GROUPS, otherwise=to_no_layer)
def to_group(scene, put, sums, place, events, group, light):
    """Add a contribution to the group of its light."""
    put(scene, sums, place, i32(part_columns(scene) + 3 * group), light)


@kernel(needs=PARTS | GROUPS, otherwise=to_no_layer)
def to_layers(scene, put, sums, place, events, group, light):
    """Add a contribution to the layers that it belongs to.

    Args:
        scene: PackedScene.
        put: how the device adds: a kernel (scene, sums, place, column, value).
        sums: what it adds to.
        place: of the sample or pixel in the sums.
        events: scattering events between light and camera.
        group: of the light.
        light: the contribution.
    """
    if light.x + light.y + light.z != 0.0:
        to_part(scene, put, sums, place, events, group, light)
        to_group(scene, put, sums, place, events, group, light)


@kernel
def no_squares(scene, put, sums, place, sample):
    """Nobody asks for the variance."""


@kernel(needs=VARIANCE, otherwise=no_squares)
def squares_to_layer(scene, put, sums, place, sample):
    """Add the squares of a whole sample; arguments as for `to_layers`."""
    # Sums of larger ones would leave float32, and no picture has such light.
    x = min(sample.x * sample.x, LARGEST_SQUARE)
    squares = Vec3(x, min(sample.y * sample.y, LARGEST_SQUARE), min(sample.z * sample.z, LARGEST_SQUARE))
    put(scene, sums, place, light_columns(scene), squares)
