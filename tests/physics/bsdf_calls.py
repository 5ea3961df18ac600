"""BSDFs over arrays of directions and random numbers, without a renderer around them."""

from __future__ import annotations

from typing import Any

import numpy as np
from kernel_calls import looped

from lumipath.pack.layout import PackedScene
from lumipath.pack.scene import pack_scene
from lumipath.scene import Scene, Sphere


def packed_with(*materials: Any) -> PackedScene:
    """A packed scene that has these materials, and nothing to be seen."""
    return pack_scene(Scene(shapes=[Sphere(material=material) for material in materials])).scene


def numbers(seed: int, count: int, dimensions: int = 2) -> np.ndarray:
    """(dimensions, count) float32: random numbers in [0, 1)."""
    drawn = np.random.default_rng(seed).random((dimensions, count), np.float32)
    return np.minimum(drawn, np.float32(1 - 2**-24))


def square(rows: int, columns: int) -> np.ndarray:
    """(2, rows * columns) float32: the middles of the cells of the unit square, row by row."""
    u, v = ((np.arange(count, dtype=np.float32) + 0.5) / count for count in (rows, columns))
    return np.stack([np.repeat(u, columns), np.tile(v, rows)])


def at_angle(cosine: Any, turn: Any = 0.0) -> np.ndarray:
    """(3, ...) float32: unit vectors at the angle of that cosine from z, `turn` turns about it."""
    cosine, turn = np.broadcast_arrays(np.asarray(cosine, float), np.asarray(turn, float))
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(2 * np.pi * turn), sine * np.sin(2 * np.pi * turn), cosine]).astype(np.float32)


__all__ = ["at_angle", "looped", "numbers", "packed_with", "square"]
