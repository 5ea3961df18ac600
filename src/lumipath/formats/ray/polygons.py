"""Polygons to triangles: a fan where a polygon is convex, ear clipping where it is not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_TOLERANCE = 1e-9

Indices = NDArray[np.int64]
Points = NDArray[np.float64]


def triangulate(points: Points, corners: Indices, counts: Indices) -> NDArray[np.int32]:
    """The triangles of polygons, in the order of the polygons and with their orientation.

    Args:
        points: (N, 3) float64 positions.
        corners: point indices of all polygons, one after the other, each in 0 .. N - 1.
        counts: how many corners each polygon has, 3 or more.

    Returns:
        (M, 3) int32 point indices; a polygon of n corners becomes n - 2 triangles.
    """
    corner_starts = np.cumsum(counts) - counts
    triangle_starts = np.cumsum(counts - 2) - (counts - 2)
    triangles = np.empty((int((counts - 2).sum()), 3), np.int32)
    for size in np.unique(counts):
        which = np.flatnonzero(counts == size)
        polygons = corners[corner_starts[which, None] + np.arange(size)]
        slots = triangle_starts[which, None] + np.arange(size - 2)
        first = np.broadcast_to(polygons[:, :1], (len(which), size - 2))
        triangles[slots] = np.stack((first, polygons[:, 1:-1], polygons[:, 2:]), axis=-1)
        if size > 3:
            for index in np.flatnonzero(~_are_convex(points[polygons])):
                triangles[slots[index]] = polygons[index][_clip_ears(points[polygons[index]])]
    return triangles


def _normals(polygons: Points) -> Points:
    """The normal of each polygon, of twice its area's length (Newell): (K, n, 3) to (K, 3)."""
    spokes = polygons - polygons[:, :1]
    return np.cross(spokes[:, :-1], spokes[:, 1:]).sum(axis=1)


def _are_convex(polygons: Points) -> NDArray[np.bool_]:
    """Whether no corner of a polygon turns inwards: (K, n, 3) to (K,)."""
    edges = np.roll(polygons, -1, axis=1) - polygons
    turns = np.cross(np.roll(edges, 1, axis=1), edges)
    normals = _normals(polygons)[:, None]
    along = (turns * normals).sum(axis=2)
    size = np.linalg.norm(turns, axis=2) * np.linalg.norm(normals, axis=2)
    return (along >= -_TOLERANCE * size).all(axis=1)


def _clip_ears(polygon: Points) -> Indices:
    """(n - 2, 3) corner indices that triangulate one simple polygon, (n, 3): cut off one ear after the other."""
    flat = _flattened(polygon)
    ring, triangles = list(range(len(flat))), []
    while len(ring) > 3:
        # A polygon that crosses itself may have no ear: then cut anywhere, so that this ends.
        ear = next((place for place in range(len(ring)) if _is_ear(flat, ring, place)), 0)
        triangles.append((ring[ear - 1], ring[ear], ring[(ear + 1) % len(ring)]))
        del ring[ear]
    triangles.append((ring[0], ring[1], ring[2]))
    return np.array(triangles)


def _flattened(polygon: Points) -> Points:
    """A polygon seen along its normal's main axis, counter-clockwise: (n, 3) to (n, 2)."""
    normal = _normals(polygon[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    across, up = (axis + 1) % 3, (axis + 2) % 3
    return polygon[:, [across, up] if normal[axis] > 0 else [up, across]]


def _is_ear(flat: Points, ring: list[int], place: int) -> bool:
    """Whether the corner at `place` can be cut off: it turns outwards, and no other corner lies in its triangle."""
    triangle = flat[[ring[place - 1], ring[place], ring[(place + 1) % len(ring)]]]
    edges = np.roll(triangle, -1, axis=0) - triangle
    if edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0] <= 0:
        return False
    others = flat[ring]
    others = others[(others[:, None] != triangle).any(axis=2).all(axis=1)]
    offsets = others[:, None] - triangle
    sides = edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0]
    return not (sides >= 0).all(axis=1).any()
