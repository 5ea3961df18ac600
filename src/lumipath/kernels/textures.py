"""Texture look-up."""

from __future__ import annotations

from ..lang import as_int, f32, i32, kernel, load, load4
from ..pack.layout import TEXTURE_SIZE, TEXTURES
from .functions import floor_int
from .vectors import xyz


@kernel
def wrapped(i, size, clamp):
    """Texel number i brought into 0 .. size - 1: clamped to the edge or repeated."""
    if clamp:
        return i32(min(max(i, 0), size - 1))
    rest = i32(i % size)
    return i32(rest + size) if rest < 0 else rest


@kernel
def bilinear(scene, texture, u, v):
    """Colour of a texture at (u, v), v upwards, interpolated between the centres of its texels."""
    row = texture * TEXTURE_SIZE
    first = load(scene.textures, row)
    width = load(scene.textures, row + 1)
    height = load(scene.textures, row + 2)
    clamp = load(scene.textures, row + 3) != 0
    # Whole turns are taken off first, since large coordinates have no digits left for the place between texels.
    x = (min(max(u, 0.0), 1.0) if clamp else u - f32(floor_int(u))) * f32(width) - 0.5
    y = (1.0 - (min(max(v, 0.0), 1.0) if clamp else v - f32(floor_int(v)))) * f32(height) - 0.5
    column = floor_int(x)
    row = floor_int(y)
    fx = x - f32(column)
    fy = y - f32(row)
    left = wrapped(column, width, clamp)
    right = wrapped(column + 1, width, clamp)
    upper = wrapped(row, height, clamp) * width + first
    lower = wrapped(row + 1, height, clamp) * width + first
    top = xyz(load4(scene.texels, (upper + left) * 4)) * (1.0 - fx) + xyz(load4(scene.texels, (upper + right) * 4)) * fx
    bottom = (
        xyz(load4(scene.texels, (lower + left) * 4)) * (1.0 - fx) + xyz(load4(scene.texels, (lower + right) * 4)) * fx
    )
    return top * (1.0 - fy) + bottom * fy


@kernel
def plain_colour(scene, row, u, v):
    """The colour itself."""
    return xyz(row)


@kernel(needs=TEXTURES, otherwise=plain_colour)
def colour_at(scene, row, u, v):
    """A material's colour: four floats, the last the number of a texture as bits, -1 for none."""
    texture = as_int(row[3])
    return bilinear(scene, texture, u, v) if texture >= 0 else xyz(row)
