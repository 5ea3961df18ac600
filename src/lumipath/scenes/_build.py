"""Small tools for writing scenes in Python: 4 x 4 matrices, quads, a floor, a sky."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Environment, Mesh

Matrix = NDArray[np.float64]

_AXES = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}


def translate(x: float, y: float, z: float) -> Matrix:
    """Moves by (x, y, z) metres; 4 x 4."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scale(x: float, y: float | None = None, z: float | None = None) -> Matrix:
    """Scales along the axes, by `x` on all of them where only that is given; 4 x 4."""
    return np.diag([x, x if y is None else y, x if z is None else z, 1.0])


def rotate(axis: str, degrees: float) -> Matrix:
    """Turns counter-clockwise about `x`, `y` or `z`, seen from its positive end; 4 x 4."""
    first, second = _AXES[axis]
    angle = math.radians(degrees)
    matrix = np.eye(4)
    matrix[first, first] = matrix[second, second] = math.cos(angle)
    matrix[second, first] = math.sin(angle)
    matrix[first, second] = -math.sin(angle)
    return matrix


UPRIGHT = rotate("x", -90)
"""Makes the z axis of cones and cylinders point up."""


def quads(*corners: Any, **options: Any) -> Mesh:
    """A mesh of flat quads, each given by 4 corners counter-clockwise seen from the front; two triangles a quad.

    Args:
        corners: each (4, 3), metres.
        options: of `Mesh`.
    """
    vertices = np.asarray(corners, np.float64).reshape(-1, 3)
    starts = 4 * np.arange(len(corners))[:, None]
    faces = np.stack([starts + (0, 1, 2), starts + (0, 2, 3)], axis=1).reshape(-1, 3)
    return Mesh(vertices=vertices, faces=faces, **options)


def floor(half_size: float, **options: Any) -> Mesh:
    """A square floor at y = 0 with uv over 0..1; `options` are those of `Mesh`."""
    s = half_size
    uvs = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    return quads(((-s, 0, s), (s, 0, s), (s, 0, -s), (-s, 0, -s)), uvs=uvs, name="floor", **options)


_ZENITH = (0.35, 0.55, 1.0)
_HORIZON = (1.0, 0.95, 0.85)
_GROUND = (0.25, 0.22, 0.2)


def sky(scale: float = 1.0, rows: int = 64) -> Environment:
    """A clear sky: blue above, pale at the horizon, dim below; its light depends on the height only."""
    height = np.cos(np.pi * (np.arange(rows) + 0.5) / rows)[:, None]
    above = np.asarray(_HORIZON) + np.sqrt(np.maximum(height, 0)) * (np.asarray(_ZENITH) - _HORIZON)
    row_colours = np.where(height > 0, above, _GROUND)
    image = np.repeat(row_colours[:, None, :], 2 * rows, axis=1)
    return Environment(image=image.astype(np.float32), scale=scale, name="sky")
