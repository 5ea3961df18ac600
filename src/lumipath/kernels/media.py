"""The medium that a path travels in: absorption, and which medium comes next.

Without `NESTED` a medium is the number of a material, -1 outside. With it, up to four media are packed into one int32,
and the one of the highest priority is there (Schmidt and Budge 2002, "Simple nested dielectrics in ray traced images").
Seven bits a medium, the one entered first in the lowest, 127 for none; in the four bits on top 15 less the surfaces
that were passed without being there. So -1 is outside in both.
"""

from __future__ import annotations

from ..lang import Vec3, as_int, f32, i32, inverse, kernel, load4
from ..pack.layout import (
    BODY,
    DIELECTRICS,
    EXTINCTION,
    MATERIAL_SIZE,
    MEDIUM_SIZE,
    NESTED,
    NO_PRIORITY,
    REFRACTION,
    SHEET,
)
from .functions import exp_minus
from .vectors import white, xyz

_NONE = i32(127)
_PLACES = i32(4)
_COUNTER = i32(-1 << 28)
_STACK = i32((1 << 28) - 1)


# ---- media by priority -----------------------------------------------------------------------------------------------


@kernel
def medium_number(scene, material):
    """The number of a material's medium, -1 where it has none."""
    return i32(as_int(load4(scene.materials, material * MATERIAL_SIZE + REFRACTION)[2]))


@kernel
def medium_in(media, place):
    """One of the media that a path is in, 127 for none."""
    return i32((media >> (7 * place)) & _NONE)


@kernel
def strongest(scene, media):
    """The medium of the highest priority, of equals the one entered last; -1 outside."""
    found = i32(-1)
    priority = f32(-1e38)
    for place in range(_PLACES):
        medium = medium_in(media, place)
        if medium != _NONE:
            other = load4(scene.media, medium * MEDIUM_SIZE)[3]
            wins = other >= priority
            found = medium if wins else found
            priority = other if wins else priority
    return found


@kernel
def contains(media, medium):
    """Whether a path is in a medium."""
    found = False
    for place in range(_PLACES):
        found = found | (medium_in(media, place) == medium)
    return found


@kernel
def entered(media, medium):
    """The media after entering one; a fifth is not there."""
    for place in range(_PLACES):
        if medium_in(media, place) == _NONE:
            return i32((media & ~(_NONE << (7 * place))) | (medium << (7 * place)))
    return i32(media)


@kernel
def left(media, medium):
    """The media after leaving the last one of that number."""
    for k in range(_PLACES):
        place = 3 - k
        if medium_in(media, place) == medium:
            below = media & ((1 << (7 * place)) - 1)
            # What moves down brings ones with it: places of no medium.
            above = (media | _COUNTER) >> (7 * (place + 1))
            return i32((((above << (7 * place)) | below) & _STACK) | (media & _COUNTER))
    return i32(media)


@kernel
def crossed(scene, s, media):
    """The media beyond a surface."""
    medium = medium_number(scene, s.material)
    if medium < 0:
        return i32(media)
    return entered(media, medium) if s.front else left(media, medium)


@kernel
def index_in(scene, media):
    """Index of refraction of the strongest medium."""
    medium = strongest(scene, media)
    return load4(scene.media, medium * MEDIUM_SIZE + 4)[0] if medium >= 0 else f32(1.0)


# ---- what paths ask --------------------------------------------------------------------------------------------------


@kernel
def clear(scene, medium, t):
    """Nothing is absorbed."""
    return white()


@kernel(needs=DIELECTRICS, otherwise=clear)
def transmittance_of_material(scene, medium, t):
    """Fraction of light left after the distance t inside of material `medium`, -1 outside (Beer's law)."""
    # What comes from infinitely far away comes from outside.
    if (medium < 0) | (t > 1e18):
        return white()
    k = xyz(load4(scene.materials, medium * MATERIAL_SIZE + EXTINCTION))
    return Vec3(exp_minus(k.x * t), exp_minus(k.y * t), exp_minus(k.z * t))


@kernel(needs=NESTED, otherwise=transmittance_of_material)
def transmittance(scene, medium, t):
    """Fraction of light left after the distance t (Beer's law)."""
    found = strongest(scene, medium)
    if (found < 0) | (t > 1e18):
        return white()
    k = xyz(load4(scene.media, found * MEDIUM_SIZE))
    return Vec3(exp_minus(k.x * t), exp_minus(k.y * t), exp_minus(k.z * t))


@kernel
def never_dielectric(scene, material):
    """No material lets light through."""
    return False


@kernel(needs=DIELECTRICS, otherwise=never_dielectric)
def is_dielectric(scene, material):
    """Whether the lobes of this material let light through."""
    return load4(scene.materials, material * MATERIAL_SIZE + EXTINCTION)[3] >= BODY


@kernel
def never_inside(scene, material):
    """No material has an inside."""
    return False


@kernel(needs=DIELECTRICS, otherwise=never_inside)
def has_inside(scene, material):
    """Whether light that goes through this material comes into another medium; a sheet has none."""
    kind = load4(scene.materials, material * MATERIAL_SIZE + EXTINCTION)[3]
    return (kind > 0.0) & (kind < SHEET)


@kernel
def material_before(scene, s, medium):
    """The medium that a path has come through: at the back of a dielectric its own, whatever the path remembers."""
    return s.material if has_inside(scene, s.material) & (not s.front) else medium


@kernel(needs=NESTED, otherwise=material_before)
def medium_before(scene, s, medium):
    """The media that a path has come through."""
    own = medium_number(scene, s.material)
    if s.front | (own < 0):
        return i32(medium)
    return i32(medium) if contains(medium, own) else entered(medium, own)


@kernel
def material_beyond(scene, s, same_side, medium):
    """The medium that a path goes on in: another one only where it passes through the surface of a dielectric."""
    if same_side | (not has_inside(scene, s.material)):
        return medium
    return s.material if s.front else i32(-1)


@kernel(needs=NESTED, otherwise=material_beyond)
def medium_beyond(scene, s, same_side, medium):
    """The media that a path goes on in."""
    return i32(medium) if same_side else crossed(scene, s, medium)


@kernel
def no_index(scene, s, medium):
    """Nothing is refracted."""
    return f32(1.0)


@kernel(needs=DIELECTRICS, otherwise=no_index)
def own_index_beyond(scene, s, medium):
    """Index of refraction beyond a surface relative to the viewer's side."""
    index = load4(scene.materials, s.material * MATERIAL_SIZE + REFRACTION)[0]
    return index if s.front else inverse(index)


@kernel(needs=NESTED, otherwise=own_index_beyond)
def index_beyond(scene, s, medium):
    """Index of refraction of the strongest medium beyond, relative to that before; without a priority it is given."""
    own = medium_number(scene, s.material)
    if own < 0:
        return f32(1.0)
    if load4(scene.media, own * MEDIUM_SIZE)[3] > NO_PRIORITY:
        return own_index_beyond(scene, s, medium)
    return index_in(scene, crossed(scene, s, medium)) / index_in(scene, medium)


@kernel
def always_there(scene, s, medium):
    """Every surface is there."""
    return False


@kernel(needs=NESTED, otherwise=always_there)
def is_overruled(scene, s, medium):
    """Whether a surface is not there, since a stronger medium is on both of its sides."""
    own = medium_number(scene, s.material)
    # Without a priority it is there, within a body of the same glass too.
    if own < 0:
        return False
    if load4(scene.media, own * MEDIUM_SIZE)[3] > NO_PRIORITY:
        return False
    return strongest(scene, medium) == strongest(scene, crossed(scene, s, medium))


@kernel
def medium_past(scene, s, medium):
    """The media beyond a surface that is not there; it is counted."""
    beyond = crossed(scene, s, medium)
    return i32(beyond - (1 << 28)) if ((beyond >> 28) & 15) > 0 else beyond


@kernel
def depth_of(scene, path):
    """Scattering events so far."""
    return path.depth


@kernel(needs=NESTED, otherwise=depth_of)
def scattered_times(scene, path):
    """Scattering events so far, without the first 15 surfaces that were not there."""
    return i32(path.depth - 15 + ((path.medium >> 28) & 15))
