"""Surfaces that let a part of the rays through as if they were not there.

Whether a surface is there for a ray is decided while the ray is traced, by a hash of the ray and the hit, as in pbrt
(4th edition, section 7.1.1): so it holds for rays of all kinds, and means are right.
"""

from __future__ import annotations

from ..lang import as_int, as_uint, f32, i32, kernel, load4, u32
from ..pack.layout import HAS_HOLES, MAP_OPACITY, MAP_SIZE, MATERIAL_MASK, OPACITY, PRIMITIVE_SIZE
from .instances import placed_material
from .quadrics import quadric_distance, quadric_distance_beyond
from .sampler import hash32, unit_float
from .surface import primitive_normals
from .textures import number_at
from .vectors import xyz
from .vertex_colours import vertex_alpha

# A ray meets a quadric four times at most: mantle and caps, twice each.
_CROSSINGS = 4


@kernel
def always_opaque(scene, material, corner, u, v, w1, w2):
    """A scene whose surfaces are all closed."""
    return f32(1.0)


@kernel(needs=OPACITY, otherwise=always_opaque)
def opacity_at(scene, material, corner, u, v, w1, w2):
    """The fraction of rays that a surface stops at a point; corner, w1 and w2 as in `Surface`."""
    row = load4(scene.maps, material * MAP_SIZE + MAP_OPACITY)
    opacity = number_at(scene, row[0], as_int(row[3]), u, v) * vertex_alpha(scene, corner, w1, w2)
    cutoff = row[1]
    masked = f32(1.0) if opacity >= cutoff else f32(0.0)
    return masked if cutoff >= 0.0 else opacity


@kernel
def chance_of(o, d, t, primitive):
    """A number in [0, 1) that looks random, for a ray that meets a primitive at the distance t."""
    h = hash32(u32(as_uint(o.x) ^ u32(u32(primitive) * u32(0x9E3779B9))))
    h = hash32(u32(h ^ as_uint(o.y)))
    h = hash32(u32(h + as_uint(o.z)))
    h = hash32(u32(h ^ as_uint(d.x)))
    h = hash32(u32(h + as_uint(d.y)))
    h = hash32(u32(h ^ as_uint(d.z)))
    return unit_float(hash32(u32(h + as_uint(t))))


@kernel
def always_stops(scene, primitive, within, o, d, t):
    """A scene whose surfaces are all closed."""
    return True


@kernel(needs=OPACITY, otherwise=always_stops)
def stops(scene, primitive, within, o, d, t):
    """Whether a primitive is there for a ray that meets it at the distance t.

    `within` is the instance in whose coordinates the ray is, -1 for none.
    """
    row = load4(scene.primitives, primitive * PRIMITIVE_SIZE)
    word = as_int(row[3])
    own = i32(word & MATERIAL_MASK)
    material = placed_material(scene, within, own)
    if ((word & HAS_HOLES) == 0) & (material == own):
        return True
    found = primitive_normals(scene, primitive, o + d * t, xyz(row))
    # As in `Surface`: an instance that has a material takes no colours of vertices.
    corner = found.corner if material == own else i32(-1)
    opacity = opacity_at(scene, material, corner, found.u, found.v, found.w1, found.w2)
    return chance_of(o, d, t, primitive) < opacity


@kernel
def closed_quadric_distance(scene, primitive, within, o, d, tmax):
    """A scene whose surfaces are all closed."""
    return quadric_distance(scene.quadrics, i32(primitive - scene.triangle_count), o, d, tmax)


@kernel(needs=OPACITY, otherwise=closed_quadric_distance)
def stopping_quadric_distance(scene, primitive, within, o, d, tmax):
    """Nearest t in (0, tmax) where a quadric stops the ray, else infinity."""
    t = f32(0.0)
    for _ in range(_CROSSINGS):
        t = quadric_distance_beyond(scene.quadrics, i32(primitive - scene.triangle_count), o, d, t, tmax)
        if not t < tmax:
            return t
        if stops(scene, primitive, within, o, d, t):
            return t
    return tmax
