"""What BSDFs are asked and answer, and how they read their parameters."""

from __future__ import annotations

from ...lang import Vec3, as_int, f32, kernel, load4, struct
from ...pack.layout import BSDF_COLOUR, BSDF_SIZE, TEXTURED_NUMBERS, TEXTURED_TINTS, TEXTURES
from ..textures import texture_colour
from ..vectors import black, xyz
from ..vertex_colours import vertex_colour


@struct
class BsdfValue:
    """Of one pair of directions: f times |cosine|, and the density per solid angle with which `sample` draws wi."""

    f: Vec3
    pdf: f32


@struct
class BsdfSample:
    """A direction drawn; weight is f times |cosine| over pdf. pdf = 0: no other strategy could have drawn it."""

    wi: Vec3
    weight: Vec3
    pdf: f32


@kernel
def no_value():
    """Nothing is scattered."""
    return BsdfValue(black(), 0.0)


@kernel
def no_sample():
    """A path that ends here."""
    return BsdfSample(Vec3(0, 0, 1), black(), 0.0)


@kernel
def slot(scene, material, at):
    """Four floats of a material's record."""
    return load4(scene.bsdfs, material * BSDF_SIZE + at)


@kernel
def plain_colour_slot(scene, s, at):
    """The factor."""
    return xyz(slot(scene, s.material, at))


@kernel(needs=TEXTURES, otherwise=plain_colour_slot)
def colour_slot(scene, s, at):
    """A colour at a point of a surface: a factor times what a texture shows there."""
    row = slot(scene, s.material, at)
    texture = as_int(row[3])
    return xyz(row) * texture_colour(scene, texture, s.u, s.v, s.footprint) if texture >= 0 else xyz(row)


@kernel(needs=TEXTURED_TINTS, otherwise=plain_colour_slot)
def tint_slot(scene, s, at):
    """A colour that is not the base colour; see `colour_slot`."""
    return colour_slot(scene, s, at)


@kernel
def base_colour_slot(scene, s):
    """The colour of a surface at a point: that of its material times that of the vertices around."""
    return colour_slot(scene, s, BSDF_COLOUR) * vertex_colour(scene, s.corner, s.w1, s.w2)


@kernel
def plain_number_slot(scene, s, at):
    """The factor."""
    return slot(scene, s.material, at)[0]


@kernel(needs=TEXTURED_NUMBERS, otherwise=plain_number_slot)
def number_slot(scene, s, at):
    """A number at a point of a surface: a factor times a channel of what a texture shows there."""
    row = slot(scene, s.material, at)
    texture = as_int(row[3])
    return row[0] * texture_colour(scene, texture, s.u, s.v, s.footprint).x if texture >= 0 else row[0]
