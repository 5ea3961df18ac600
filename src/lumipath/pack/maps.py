"""Records of what materials do besides scattering: opacity, bent normals, mixing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Appearance, Material, Mix, Texture
from . import layout


def map_rows(
    materials: Sequence[Material | Appearance],
    number: Callable[[Any], int],
    texture_number: Callable[[Texture], int],
) -> tuple[NDArray[np.float32], int]:
    """(M, 16) float32: the records of all materials; and their feature bits.

    Args:
        materials: of the scene, those that only mixes use among them.
        number: gives a material its number.
        texture_number: gives a texture its number.
    """
    rows = np.zeros((len(materials), int(layout.MAP_SIZE)), np.float32)
    bits = rows.view(np.int32)
    features = 0
    bits[:, [3, 6, 7, 9, 10, 11]] = -1
    rows[:, :2] = 1.0, -1.0
    for row, words, material in zip(rows, bits, materials):
        if not isinstance(material, Appearance):
            continue
        row[1] = -1.0 if material.alpha_cutoff is None else material.alpha_cutoff
        row[4:6] = material.normal_scale, material.bump_height
        _write_number(row, words, layout.MAP_OPACITY, material.opacity, texture_number)
        if material.normal_map is not None:
            words[6] = texture_number(material.normal_map)
        if material.bump_map is not None:
            words[7] = texture_number(material.bump_map)
        features |= layout.OPACITY if material.has_holes else 0
        features |= layout.NORMAL_MAPS if material.has_normals else 0
        if isinstance(material, Mix):
            _write_number(row, words, layout.MAP_MIX, material.weight, texture_number)
            words[9:11] = number(material.first), number(material.second)
            features |= layout.MIXES
    return rows, features


def _write_number(row: Any, words: Any, at: Any, value: Any, texture_number: Callable[[Texture], int]) -> None:
    row[at] = 1.0 if isinstance(value, Texture) else value
    words[at + 3] = texture_number(value) if isinstance(value, Texture) else -1
