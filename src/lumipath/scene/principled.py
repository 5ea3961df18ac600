"""The material of glTF 2.0."""

from __future__ import annotations

import math
from typing import ClassVar

from attrs import field, frozen

from .bsdfs import (
    BLACK,
    WHITE,
    Appearance,
    Inside,
    Number,
    absorption_of,
    checked_number,
    checked_share,
    left_after_a_metre,
)
from .material import Colour, Material, Texture, is_positive

# Metals that are rougher than this are no mirrors to whoever sees lobes only.
_MIRROR_ROUGHNESS = 0.3


def _mean(value: Number) -> float:
    return value.mean()[0] if isinstance(value, Texture) else value


def _scaled(value: Colour | Texture, factor: float) -> Colour | Texture:
    """The colour times a factor; a texture is left as it is, and dropped where nothing is left of it."""
    if isinstance(value, Texture):
        return value if factor > 0.5 else BLACK
    r, g, b = value
    return (r * factor, g * factor, b * factor)


@frozen(eq=False, kw_only=True)
class Principled(Appearance):
    """The metal-roughness material of glTF 2.0 with its extensions. Numbers and colours may be a `Texture`.

    Args:
        base_color: albedo of what is matt, reflectance of a metal face to face, tint of what goes through; 0 to 1.
        metallic: from 0, a dielectric, to 1, a metal.
        roughness: from 0, a mirror, to 1; its square is the alpha of GGX.
        ior: index of refraction of a dielectric, 1 to 10.
        specular: strength of a dielectric's reflection, 0 to 1.
        specular_color: its colour face to face, from 0; together with `ior` it ends at 1.
        transmission: how much of a dielectric's surface light goes through, 0 to 1, instead of into the matt base.
        thin: whether the surface is a wall without thickness, which light goes through unbent; else it encloses a
            volume.
        attenuation_color: what the volume leaves of white light after `attenuation_distance`; 0 to 1, no texture.
        attenuation_distance: metres; infinite: the volume absorbs nothing.
        clearcoat: strength of a clear coat of index 1.5, 0 to 1.
        clearcoat_roughness: as `roughness`.
        sheen_color: colour and strength of fibres that shine at the edge, 0 to 1.
        sheen_roughness: 0 to 1; below 0.1 as 0.1.
        anisotropy: from 0 to 1: how far highlights are drawn out along the u direction of the texture coordinates.
        anisotropy_rotation: of that direction, degrees counter-clockwise.
        iridescence: strength of a thin film's colours, 0 to 1.
        iridescence_ior: index of refraction of the film, 1 to 5.
        iridescence_thickness: of the film, nanometres, 0 to 10000.
    """

    base_color: Colour | Texture = (0.8, 0.8, 0.8)
    metallic: Number = field(default=0.0, validator=checked_share)
    roughness: Number = field(default=0.5, validator=checked_share)
    ior: float = field(default=1.5, validator=checked_number(1.0, 10.0))
    specular: Number = field(default=1.0, validator=checked_share)
    specular_color: Colour | Texture = WHITE
    transmission: Number = field(default=0.0, validator=checked_share)
    thin: bool = False
    attenuation_color: Colour = WHITE
    attenuation_distance: float = field(default=math.inf, validator=checked_number(1e-9, math.inf))
    clearcoat: Number = field(default=0.0, validator=checked_share)
    clearcoat_roughness: Number = field(default=0.0, validator=checked_share)
    sheen_color: Colour | Texture = BLACK
    sheen_roughness: Number = field(default=0.3, validator=checked_share)
    anisotropy: float = field(default=0.0, validator=checked_number(0.0, 1.0))
    anisotropy_rotation: float = field(default=0.0, validator=checked_number(-360.0, 360.0))
    iridescence: Number = field(default=0.0, validator=checked_share)
    iridescence_ior: float = field(default=1.3, validator=checked_number(1.0, 5.0))
    iridescence_thickness: Number = field(default=400.0, validator=checked_number(0.0, 1e4))

    _limits: ClassVar[dict[str, float]] = Appearance._limits | {
        "base_color": 1.0,
        "specular_color": 1e6,
        "attenuation_color": 1.0,
        "sheen_color": 1.0,
    }

    @property
    def transmits(self) -> bool:
        """Whether light goes through anywhere."""
        return is_positive(self.transmission) if isinstance(self.transmission, Texture) else self.transmission > 0

    @property
    def is_dielectric(self) -> bool:
        """Whether light goes through to an inside that absorbs or refracts."""
        return self.transmits and not self.thin

    @property
    def inside(self) -> Inside | None:
        """What the surface encloses; None where light does not go through, or the wall is thin."""
        if not self.is_dielectric:
            return None
        return Inside(self.ior, absorption_of(self.attenuation_color, self.attenuation_distance))

    def as_lobes(self) -> Material:
        """A metal as a mirror if it is smooth; glass as clear glass; anything else as a Lambert lobe."""
        metallic = _mean(self.metallic)
        inside = self.inside
        # Lobes of glass and matt lobes each count in full: there is one or the other.
        is_glass = _mean(self.transmission) * (1 - metallic) >= 0.5
        mirrored = metallic if _mean(self.roughness) < _MIRROR_ROUGHNESS and not is_glass else 0.0
        through = left_after_a_metre(inside) if inside else WHITE
        return Material(
            diffuse=BLACK if is_glass else _scaled(self.base_color, 1 - mirrored),
            specular=_scaled(self.base_color, mirrored) if mirrored > 0 else None,
            transmissive=through if is_glass else BLACK,
            # A thin wall is hardly there.
            index=inside.ior if inside else 1.0,
            emission=self.emission,
            name=self.name,
        )
