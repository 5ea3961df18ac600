"""Records of BSDFs: the one place that knows how the materials of `scene.bsdfs` lie in memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Mix, Texture
from ..scene.bsdfs import Appearance, Conductor, Dielectric, Diffuse, ThinDielectric
from ..scene.material import is_positive
from ..scene.principled import Principled
from . import layout
from .energy import EnergyTables

TextureNumber = Callable[[Texture], int]


class BsdfRow:
    """Writes one record.

    Args:
        row: (80,) float32, zeros.
        texture_number: gives a texture its number.
        energy: gives an index of refraction its tables.
        regularize: whether clear glass may grow rough.
    """

    def __init__(
        self, row: NDArray[np.float32], texture_number: TextureNumber, energy: EnergyTables, regularize: bool
    ) -> None:
        self.regularize = regularize
        self._row = row
        self._bits = row.view(np.int32)
        self._texture_number = texture_number
        self.features = 0
        self._energy = energy

    def kind(self, kind: Any) -> None:
        """The kind of BSDF."""
        self._bits[0] = kind

    def colour(self, at: Any, value: Any) -> None:
        """A colour slot: a constant, or a texture."""
        self._row[at : at + 3] = 1.0 if isinstance(value, Texture) else value
        self._texture(at, value, layout.TEXTURES if at == layout.BSDF_COLOUR else layout.TEXTURED_TINTS)

    def number(self, at: Any, value: Any) -> None:
        """A number slot: a constant, or the first channel of a texture."""
        self._row[at] = 1.0 if isinstance(value, Texture) else value
        self._texture(at, value, layout.TEXTURED_NUMBERS)

    def _texture(self, at: Any, value: Any, feature: int) -> None:
        if isinstance(value, Texture):
            self._bits[at + 3] = self._texture_number(value)
            self.features |= layout.TEXTURES | feature
        else:
            self._bits[at + 3] = -1

    def walls(self, index: float, thin: bool) -> None:
        """Whether there is no inside, and the reflectance face to face."""
        self._row[layout.BSDF_REFRACTION + 2] = thin
        self._row[layout.BSDF_REFRACTION + 3] = ((index - 1) / (index + 1)) ** 2

    def film(self, thickness: Any, index: float) -> None:
        """A thin film: its thickness, nm, and its index of refraction."""
        self.number(layout.BSDF_FILM, thickness)
        self._row[layout.BSDF_FILM + 1] = index

    def refraction(self, index: float, *, tables: bool) -> None:
        """The index of refraction, and the tables of rough glass of that index."""
        self._row[layout.BSDF_REFRACTION] = index
        self._bits[layout.BSDF_REFRACTION + 1] = self._energy.number(index) if tables else 0

    def anisotropy(self, strength: float, rotation: float) -> int:
        """The anisotropy slot; rotation in degrees. Returns its feature bit, or 0 without any."""
        self._row[layout.BSDF_ANISOTROPY] = strength
        self._row[layout.BSDF_ANISOTROPY + 1] = (rotation / 360) % 1.0
        return layout.ANISOTROPY if strength > 0 else 0


def write_bsdf(row: BsdfRow, material: Appearance) -> int:
    """Write the record of a material; returns the feature bits that it needs, 0 where its lobes are all there is."""
    features = _WRITERS[type(material)](row, material)
    return features | row.features if features else 0


def _write_diffuse(row: BsdfRow, material: Diffuse) -> int:
    if material.is_plain:
        return 0
    row.kind(layout.ROUGH_DIFFUSE_KIND)
    row.colour(layout.BSDF_COLOUR, material.reflectance)
    row.number(layout.BSDF_ROUGHNESS, material.roughness)
    return layout.ROUGH_DIFFUSE


def _write_conductor(row: BsdfRow, material: Conductor) -> int:
    index = material.index
    features = layout.CONDUCTORS
    if index is not None:
        features |= layout.MEASURED_METALS
        row.kind(layout.MEASURED_METAL_KIND)
        row.colour(layout.BSDF_COLOUR, index[0])
        row.colour(layout.BSDF_EDGE, index[1])
    else:
        row.kind(layout.TINTED_METAL_KIND)
        row.colour(layout.BSDF_COLOUR, material.reflectance)
        row.colour(layout.BSDF_EDGE, material.edge_tint)
    row.number(layout.BSDF_ROUGHNESS, material.roughness)
    return features | row.anisotropy(material.anisotropy, material.rotation)


def _write_mix(row: BsdfRow, material: Mix) -> int:
    # It is one of its parts wherever a ray arrives.
    return 0


def _write_dielectric(row: BsdfRow, material: Dielectric) -> int:
    if material.is_plain and not row.regularize:
        return 0
    row.kind(layout.ROUGH_DIELECTRIC_KIND)
    row.colour(layout.BSDF_COLOUR, material.transmission_tint)
    row.colour(layout.BSDF_EDGE, material.reflection_tint)
    row.number(layout.BSDF_ROUGHNESS, material.roughness)
    row.refraction(material.ior, tables=material.roughness != 0 or row.regularize)
    return layout.ROUGH_DIELECTRICS | row.anisotropy(material.anisotropy, material.rotation)


def _write_thin_dielectric(row: BsdfRow, material: ThinDielectric) -> int:
    row.kind(layout.THIN_DIELECTRIC_KIND)
    row.colour(layout.BSDF_COLOUR, material.tint)
    row.number(layout.BSDF_ROUGHNESS, material.roughness)
    row.refraction(material.ior, tables=False)
    return layout.THIN_DIELECTRICS


def _write_principled(row: BsdfRow, material: Principled) -> int:
    row.kind(layout.PRINCIPLED_KIND)
    row.colour(layout.BSDF_COLOUR, material.base_color)
    row.number(layout.BSDF_METALLIC, material.metallic)
    row.number(layout.BSDF_ROUGHNESS, material.roughness)
    row.refraction(material.ior, tables=material.is_dielectric)
    row.walls(material.ior, material.thin)
    row.number(layout.BSDF_TRANSMISSION, material.transmission)
    row.number(layout.BSDF_SPECULAR, material.specular)
    row.colour(layout.BSDF_SPECULAR_COLOUR, material.specular_color)
    row.number(layout.BSDF_CLEARCOAT, material.clearcoat)
    row.number(layout.BSDF_CLEARCOAT_ROUGHNESS, material.clearcoat_roughness)
    row.colour(layout.BSDF_SHEEN, material.sheen_color)
    row.number(layout.BSDF_SHEEN_ROUGHNESS, material.sheen_roughness)
    row.number(layout.BSDF_IRIDESCENCE, material.iridescence)
    row.film(material.iridescence_thickness, material.iridescence_ior)
    features = layout.PRINCIPLED | row.anisotropy(material.anisotropy, material.anisotropy_rotation)
    features |= layout.TRANSMISSION if material.transmits else 0
    features |= layout.CLEARCOAT if _is_above_zero(material.clearcoat) else 0
    features |= layout.SHEEN if is_positive(material.sheen_color) else 0
    features |= layout.IRIDESCENCE if _is_above_zero(material.iridescence) else 0
    usual = material.specular == 1 and material.specular_color == (1.0, 1.0, 1.0)
    return features if usual else features | layout.SPECULAR


def _is_above_zero(value: float | Texture) -> bool:
    return is_positive(value) if isinstance(value, Texture) else value > 0


_WRITERS: dict[type, Callable[[BsdfRow, Any], int]] = {
    Conductor: _write_conductor,
    Dielectric: _write_dielectric,
    Diffuse: _write_diffuse,
    Mix: _write_mix,
    Principled: _write_principled,
    ThinDielectric: _write_thin_dielectric,
}
