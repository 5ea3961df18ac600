"""Materials as tables."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene import Appearance, Material, Mix, Texture
from ..scene.material import is_positive
from . import layout
from .bsdfs import BsdfRow, write_bsdf
from .energy import EnergyTables
from .maps import map_rows
from .textures import TextureTable

# Stands for a transmissive part of 0: whatever enters is gone within the shortest stretch.
_OPAQUE = 1e20
# Priority of a medium that has none: above all others.
_FIRST = 1e38


class MaterialTable:
    """Collects materials, each once, and the textures that they use."""

    def __init__(self, regularize: bool = False) -> None:
        self._regularize = regularize
        self.materials: list[Material | Appearance] = []
        self.textures = TextureTable()
        self.energy = EnergyTables()
        self._numbers: dict[int, int] = {}
        self._scatters_at_lobes: list[bool] = []

    def number(self, material: Material | Appearance) -> int:
        """Number of a material in the table."""
        key = id(material)
        if key not in self._numbers:
            self._numbers[key] = len(self.materials)
            self.materials.append(material)
        return self._numbers[key]

    def add_parts(self) -> None:
        """Number the materials that only mixes use; they come behind all others."""
        for material in self.materials:
            if isinstance(material, Mix):
                # The list grows, so that parts of parts come too.
                for part in material.parts().values():
                    self.number(part)

    def _write_colour(self, row: NDArray[np.float32], at: int, value: Any) -> None:
        if isinstance(value, Texture):
            row[at : at + 3] = value.mean()
            row.view(np.int32)[at + 3] = self.textures.number(value)
        else:
            row[at : at + 3] = value
            row.view(np.int32)[at + 3] = -1

    def rows(self) -> NDArray[np.float32]:
        """(M, 28) float32: the records of all materials."""
        table = np.zeros((len(self.materials), int(layout.MATERIAL_SIZE)), np.float32)
        for row, material, appearance in zip(table, self.lobes(), self.materials):
            self._write_row(row, material)
            if isinstance(appearance, Appearance):
                self._write_inside(row, appearance, material.is_dielectric)
        return table

    def _write_inside(self, row: NDArray[np.float32], material: Appearance, is_glass: bool) -> None:
        if is_glass:
            row[layout.REFRACTION + 1] = 1.0
            row[layout.EXTINCTION + 3] = layout.SHEET
        if material.inside is not None:
            row[layout.EXTINCTION : layout.EXTINCTION + 3] = material.inside.extinction
            row[layout.EXTINCTION + 3] = layout.BODY if is_glass else layout.VEILED_BODY

    def media(self, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """(D, 8) float32: the media of dielectrics, where any has a priority; their numbers are written into `rows`.

        Raises:
            SceneError: more media than can be numbered.
        """
        if all(getattr(material, "priority", None) is None for material in self.materials):
            return np.zeros((0, int(layout.MEDIUM_SIZE)), np.float32)
        # Equal media have one number, so that parts of a mix lead into the same one.
        found: dict[tuple[float, ...], int] = {}
        for row, material in zip(rows, self.materials):
            number = -1
            if 0 < row[layout.EXTINCTION + 3] < layout.SHEET and not isinstance(material, Mix):
                priority = getattr(material, "priority", None)
                extinction = row[layout.EXTINCTION : layout.EXTINCTION + 3].tolist()
                medium = (*extinction, _FIRST if priority is None else priority, float(row[layout.REFRACTION]), 0, 0, 0)
                number = found.setdefault(medium, len(found))
            row.view(np.int32)[layout.REFRACTION + 2] = number
        if len(found) > layout.MOST_MEDIA:
            raise SceneError(
                f"{len(found)} media of dielectrics, of which some have a priority: at most {layout.MOST_MEDIA} are"
                " possible"
            )
        return np.array(list(found), np.float32)

    def lobes(self) -> list[Material]:
        """The sum of lobes of each material, or the one that stands for it."""
        return [
            attrs.evolve(material.as_lobes(), emission=material.emission)
            if isinstance(material, Appearance)
            else material
            for material in self.materials
        ]

    def bsdf_rows(self) -> tuple[NDArray[np.float32], int]:
        """(M, 80) float32: the records of BSDFs, and their feature bits; no rows where all materials are lobes."""
        table = np.zeros((len(self.materials), int(layout.BSDF_SIZE)), np.float32)
        features = 0
        for row, material in zip(table, self.materials):
            if isinstance(material, Appearance):
                features |= write_bsdf(BsdfRow(row, self.textures.number, self.energy, self._regularize), material)
        self._scatters_at_lobes = (table[:, 0].view(np.int32) == layout.LOBES_KIND).tolist()
        return (table if features & layout.BSDFS else table[:0]), features

    def map_rows(self) -> tuple[NDArray[np.float32], int]:
        """(M, 16) float32: what materials do besides scattering, and their feature bits."""
        return map_rows(self.materials, self.number, self.textures.number)

    def _write_row(self, row: NDArray[np.float32], material: Material) -> None:
        white = (1.0, 1.0, 1.0)
        mirror = material.specular
        if mirror is None:
            # `reflective` is a mirror only where light does not go through.
            mirror = None if material.is_dielectric else material.reflective
        self._write_colour(row, int(layout.DIFFUSE), material.diffuse)
        self._write_colour(row, int(layout.EMISSION), material.emission)
        self._write_colour(row, int(layout.MIRROR), mirror if mirror is not None else (0.0, 0.0, 0.0))
        tint = material.specular if material.specular is not None else white
        self._write_colour(row, int(layout.REFLECTION_TINT), tint)
        internal = material.reflective if material.reflective is not None else white
        self._write_colour(row, int(layout.INTERNAL_TINT), internal)
        kt = np.array(mean_colour(material.transmissive))
        with np.errstate(divide="ignore"):
            extinction = np.minimum(-np.log(np.minimum(kt, 1.0)), _OPAQUE)
        row[layout.EXTINCTION : layout.EXTINCTION + 3] = extinction
        row[layout.EXTINCTION + 3] = float(material.is_dielectric)
        row[layout.REFRACTION] = material.index
        row[layout.REFRACTION + 1] = kt.mean()

    def phong_rows(self) -> NDArray[np.float32]:
        """(M, 16) float32: what Whitted ray tracing needs besides."""
        table = np.zeros((len(self.materials), int(layout.PHONG_SIZE)), np.float32)
        black = (0.0, 0.0, 0.0)
        for row, material in zip(table, self.lobes()):
            specular = material.specular if material.specular is not None else black
            mirror = material.reflective
            if mirror is None:
                # Without an exponent there is no highlight: a mirror that is sharp in path tracing stays one.
                mirror = black if material.shininess > 0 else specular
            self._write_colour(row, int(layout.PHONG_AMBIENT), material.ambient)
            self._write_colour(row, int(layout.PHONG_HIGHLIGHT), specular if material.shininess > 0 else black)
            self._write_colour(row, int(layout.PHONG_MIRROR), mirror)
            row[layout.PHONG_EXPONENT] = material.shininess
        return table

    def features(self) -> int:
        """Feature bits of the materials; call after all rows."""
        mask = layout.TEXTURES if len(self.textures) else 0
        if any(isinstance(material, Appearance) and material.inside for material in self.materials):
            mask |= layout.DIELECTRICS
        for material, is_scattering in zip(self.lobes(), self._scatters_at_lobes):
            if material.is_dielectric:
                mask |= layout.DIELECTRICS | (layout.LOBE_GLASS if is_scattering else 0)
            if is_positive(material.specular) or (
                is_positive(material.reflective) and material.specular is None and not material.is_dielectric
            ):
                mask |= layout.MIRRORS | (layout.LOBE_MIRRORS if is_scattering else 0)
            for lobe in _RENDERED_LOBES:
                if isinstance(getattr(material, lobe), Texture):
                    mask |= layout.TEXTURES
                    if lobe == "emission":
                        mask |= layout.TEXTURED_EMISSION
                    elif is_scattering:
                        mask |= layout.TEXTURED_LOBES
        return mask


_RENDERED_LOBES = ("emission", "diffuse", "specular", "reflective", "transmissive", "ambient")


def mean_colour(value: Any) -> tuple[float, float, float]:
    """The colour, or the mean of the texture."""
    return value.mean() if isinstance(value, Texture) else value
