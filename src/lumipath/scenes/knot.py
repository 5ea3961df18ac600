"""A mesh of many small triangles that is neither flat nor convex: a ribbed tube along a torus knot."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Material, Mesh, Scene
from ..scene.shapes import smooth_normals
from .cornell import camera, room

# Rings along the knot and vertices around each: two triangles a vertex make 40,000.
_RINGS, _AROUND = 500, 40

# The tube's centre runs 2 times around the axis of a torus and 3 times around its core (radius 1).
_TURNS, _WINDINGS = 2, 3
_CORE_DISTANCE = 0.46

_TUBE_RADIUS = 0.27
_RIBS, _RIB_TURNS, _RIB_DEPTH = 5, 11, 0.2
_SCALES, _SCALE_DEPTH = 48, 0.05

# Metres: where the knot hangs in the Cornell box, and how large it is.
_CENTRE = (0.278, 0.262, 0.29)
_SIZE = 0.128
_TILT = np.radians((62.0, 25.0))

Array = NDArray[np.float64]


def _centre_line(t: Array) -> tuple[Array, Array]:
    """(N, 3) points of the knot at the parameters `t`, and (N, 3) unit normals of the torus that it lies on."""
    around, winding = _TURNS * t, _WINDINGS * t
    outward = np.stack([np.cos(around), np.zeros_like(t), np.sin(around)], axis=-1)
    normal = np.cos(winding)[:, None] * outward + np.sin(winding)[:, None] * (0.0, 1.0, 0.0)
    return outward + _CORE_DISTANCE * normal, normal


def _tangents(points: Array) -> Array:
    """(N, 3) unit tangents of a closed line by central differences."""
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    return along / np.linalg.norm(along, axis=1, keepdims=True)


def _tube_radius(t: Array, angle: Array) -> Array:
    """Ribs that wind around the tube, and fine scales across them."""
    ribs = _RIB_DEPTH * np.cos(_RIBS * angle + _RIB_TURNS * t)
    scales = _SCALE_DEPTH * np.sin(_SCALES * t) * np.cos(_RIBS * angle + _RIB_TURNS * t)
    radius: Array = _TUBE_RADIUS * (1 + ribs + scales)
    return radius


def _knot_vertices() -> Array:
    """(_RINGS * _AROUND, 3), ring by ring."""
    t = 2 * np.pi * np.arange(_RINGS) / _RINGS
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    points, normal = _centre_line(t)
    binormal = np.cross(_tangents(points), normal)
    radius = _tube_radius(t[:, None], angle[None, :])[..., None]
    across = np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * binormal[:, None]
    return (points[:, None] + radius * across).reshape(-1, 3)


def _closed_grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """(2 * rows * columns, 3): two triangles a cell of a grid that closes upon itself both ways."""
    index = np.arange(rows * columns).reshape(rows, columns)
    below, right = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    diagonal = np.roll(below, -1, axis=1)
    cells = np.stack([index, diagonal, below, index, right, diagonal], axis=-1)
    return cells.reshape(-1, 3).astype(np.int32)


def _rotation() -> Array:
    """Tips the knot towards the camera, then turns it; 3 x 3."""
    (tip_sine, turn_sine), (tip_cosine, turn_cosine) = np.sin(_TILT), np.cos(_TILT)
    tip = np.array(((1, 0, 0), (0, tip_cosine, -tip_sine), (0, tip_sine, tip_cosine)))
    turn = np.array(((turn_cosine, 0, turn_sine), (0, 1, 0), (-turn_sine, 0, turn_cosine)))
    rotation: Array = turn @ tip
    return rotation


def knot_mesh(**options: Any) -> Mesh:
    """The knot as a closed mesh of 40,000 triangles with smooth normals, where it hangs in the box.

    Args:
        options: of `Mesh`.
    """
    vertices = (_knot_vertices() @ _rotation().T * _SIZE + _CENTRE).astype(np.float32)
    faces = _closed_grid_faces(_RINGS, _AROUND)
    return Mesh(vertices=vertices, faces=faces, normals=smooth_normals(vertices, faces), name="knot", **options)


def knot40k() -> Scene:
    """The knot in the Cornell box: 40,012 triangles, smooth normals, a diffuse lobe under a tinted mirror."""
    lacquer = Material(diffuse=(0.75, 0.4, 0.1), specular=(0.1, 0.2, 0.2), name="lacquer")
    return Scene(shapes=[*room(), knot_mesh(material=lacquer)], cameras=[camera()], name="knot40k")
