"""Texture look-up."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..lang import Vec3, as_int, called_not_inlined, f32, i32, kernel, load, load4, start_of, struct
from ..pack.layout import (
    BYTES,
    CHANNEL_SHIFT,
    CHEQUERED,
    LINEAR_BYTES,
    LOOKS,
    MIRRORED_U,
    MIRRORED_V,
    NEAREST,
    REPEATED_U,
    REPEATED_V,
    TEXTURE_SIZE,
    TEXTURED_EMISSION,
    TEXTURED_LOBES,
    TEXTURES,
)
from .functions import floor_int
from .vectors import xyz


class Images(NamedTuple):
    """Where textures lie, as `start_of` tells it."""

    textures: Any
    texels: Any
    words: Any


@struct
class Texel:
    """What an image shows at a point, linear."""

    colour: Vec3
    alpha: f32


@struct
class Step:
    """One step of an image: where its texels begin, and its size."""

    first: i32
    width: i32
    height: i32


@kernel
def texel_at(images, flags, index):
    """One texel."""
    if (flags & BYTES) == 0:
        row = load4(images.texels, index * 4)
        return Texel(xyz(row), row[3])
    word = load(images.words, index)
    curve = i32(256) if (flags & LINEAR_BYTES) != 0 else i32(0)
    r = load(images.texels, curve + (word & 255))
    g = load(images.texels, curve + ((word >> 8) & 255))
    b = load(images.texels, curve + ((word >> 16) & 255))
    return Texel(Vec3(r, g, b), f32((word >> 24) & 255) * 0.003921569)


@kernel
def folded(x, repeated, mirrored):
    """A coordinate brought into 0 .. 1: repeated, turned over in every other copy, or clamped."""
    # Whole turns are taken off first, since large coordinates have no digits left for the place between texels.
    turn = x - f32(floor_int(x))
    double = x - 2.0 * f32(floor_int(x * 0.5))
    mirror = double if double <= 1.0 else 2.0 - double
    return turn if repeated else (mirror if mirrored else min(max(x, 0.0), 1.0))


@kernel
def neighbour(i, size, repeated):
    """Texel number i from -1 to `size` brought into 0 .. size - 1."""
    clamped = i32(min(max(i, 0), size - 1))
    opposite = i32(size - 1) if i < 0 else (i32(0) if i >= size else i32(i))
    return opposite if repeated else clamped


@kernel
def step_of(texels, head, steps):
    """The step in which a footprint of so many texels of the image is one or two texels wide."""
    first = as_int(head[0])
    width = as_int(head[1])
    height = as_int(head[2])
    # The exponent of the number is the step; footprints below a texel, and those that are no number, stay at 0.
    wanted = min(i32(((as_int(texels) >> 23) & 255) - 127), i32(steps - 1)) if texels >= 2.0 else i32(0)
    for _ in range(wanted):
        first = i32(first + width * height)
        width = i32(max(width >> 1, 1))
        height = i32(max(height >> 1, 1))
    return Step(first, width, height)


@kernel
def interpolated(images, flags, step, x, y):
    """What a step shows at (x, y) from 0 to 1, y downwards: interpolated between centres of texels, or the nearest."""
    nearest = (flags & NEAREST) != 0
    x = x * f32(step.width) - (f32(0.0) if nearest else f32(0.5))
    y = y * f32(step.height) - (f32(0.0) if nearest else f32(0.5))
    column = floor_int(x)
    row = floor_int(y)
    fx = f32(0.0) if nearest else x - f32(column)
    fy = f32(0.0) if nearest else y - f32(row)
    repeated_u = (flags & REPEATED_U) != 0
    repeated_v = (flags & REPEATED_V) != 0
    left = neighbour(column, step.width, repeated_u)
    right = neighbour(column + 1, step.width, repeated_u)
    upper = i32(neighbour(row, step.height, repeated_v) * step.width + step.first)
    lower = i32(neighbour(row + 1, step.height, repeated_v) * step.width + step.first)
    a = texel_at(images, flags, upper + left)
    b = texel_at(images, flags, upper + right)
    c = texel_at(images, flags, lower + left)
    d = texel_at(images, flags, lower + right)
    top = a.colour * (1.0 - fx) + b.colour * fx
    bottom = c.colour * (1.0 - fx) + d.colour * fx
    top_alpha = a.alpha * (1.0 - fx) + b.alpha * fx
    bottom_alpha = c.alpha * (1.0 - fx) + d.alpha * fx
    return Texel(top * (1.0 - fy) + bottom * fy, top_alpha * (1.0 - fy) + bottom_alpha * fy)


@kernel
def triangle_wave(x):
    """The integral of a square wave of 1 and -1, each 1 long, that begins with 1 at 0."""
    turn = x - 2.0 * f32(floor_int(x * 0.5))
    return 1.0 - abs(turn - 1.0)


@kernel
def chequered(images, head, u, v, width):
    """Chequers of half a unit of uv, 2 x 2 texels, as a box of that width sees them; 0: as they are."""
    x = 2.0 * (u - f32(floor_int(u)))
    y = 2.0 * (v - f32(floor_int(v)))
    # Widths are drawn from once to twice the footprint.
    w = max(1.3333334 * width, 1e-3)
    across = (triangle_wave(x + 0.5 * w) - triangle_wave(x - 0.5 * w)) / w
    upward = (triangle_wave(y + 0.5 * w) - triangle_wave(y - 0.5 * w)) / w
    sharp = f32(1.0) if (x < 1.0) == (y < 1.0) else f32(-1.0)
    share = 0.5 + 0.5 * (across * upward if width > 0.0 else sharp)
    index = as_int(head[0])
    first = texel_at(images, i32(0), index + 2)
    second = texel_at(images, i32(0), index)
    return Texel(first.colour * share + second.colour * (1.0 - share), 1.0)


@kernel
def looked_up(images, texture, u, v, footprint):
    """Colour of a texture; see `texture_colour`.

    Materials have dozens of textures, so that this is code which a GPU should have but once.
    """
    called_not_inlined()
    row = texture * TEXTURE_SIZE
    head = load4(images.textures, row)
    factor = load4(images.textures, row + 4)
    along = load4(images.textures, row + 8)
    up = load4(images.textures, row + 12)
    flags = as_int(head[3])
    x = along[0] * u + along[1] * v + along[2]
    y = up[0] * u + up[1] * v + up[2]
    texels = footprint * along[3]
    if (flags & CHEQUERED) != 0:
        # Of an image of 2 x 2 texels.
        found = chequered(images, head, x, y, texels * 0.5)
    else:
        step = step_of(texels, head, as_int(up[3]))
        x = folded(x, (flags & REPEATED_U) != 0, (flags & MIRRORED_U) != 0)
        y = folded(y, (flags & REPEATED_V) != 0, (flags & MIRRORED_V) != 0)
        found = interpolated(images, flags, step, x, 1.0 - y)
    colour = found.colour * xyz(factor)
    channel = (flags >> CHANNEL_SHIFT) & 7
    if channel == 0:
        return colour
    alpha = found.alpha * factor[3]
    value = colour.x if channel == 1 else (colour.y if channel == 2 else (colour.z if channel == 3 else alpha))
    return Vec3(value, value, value)


@kernel
def texture_colour(scene, texture, u, v, footprint):
    """Colour of a texture at (u, v), v upwards; of one channel three times its value.

    Args:
        scene: PackedScene.
        texture: its number.
        u: of the surface.
        v: of the surface.
        footprint: how much of uv a ray covers there, along one axis; 0: a point.
    """
    images = Images(start_of(scene.textures), start_of(scene.texels), start_of(scene.texel_words))
    return looked_up(images, texture, u, v, footprint)


@kernel
def plain_colour(scene, row, u, v, footprint):
    """The colour itself."""
    return xyz(row)


@kernel(needs=TEXTURES, otherwise=plain_colour)
def colour_at(scene, row, u, v, footprint):
    """A material's colour: four floats, the last the number of a texture as bits, -1 for none."""
    texture = as_int(row[3])
    return texture_colour(scene, texture, u, v, footprint) if texture >= 0 else xyz(row)


@kernel(needs=TEXTURED_LOBES | LOOKS, otherwise=plain_colour)
def lobe_colour(scene, row, u, v, footprint):
    """Weight of a lobe; see `colour_at`."""
    return colour_at(scene, row, u, v, footprint)


@kernel(needs=TEXTURED_EMISSION, otherwise=plain_colour)
def emitted_colour(scene, row, u, v, footprint):
    """Emission; see `colour_at`."""
    return colour_at(scene, row, u, v, footprint)


@kernel
def plain_number(scene, factor, texture, u, v):
    """The factor."""
    return factor


@kernel(needs=TEXTURES, otherwise=plain_number)
def number_at(scene, factor, texture, u, v):
    """A number: a factor times what a texture shows, -1 for none."""
    return factor * texture_colour(scene, texture, u, v, 0.0).x if texture >= 0 else factor
