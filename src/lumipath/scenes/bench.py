"""The benchmark scenes: one box room, diffuse only, with two blocks or with a bumpy sphere of many small triangles.

Their float32 values and the order of their triangles are fixed: published figures depend on them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Camera, Material, Mesh, Scene
from ._build import quads

WHITE = Material(diffuse=(0.885809, 0.698859, 0.666422), name="white")
RED = Material(diffuse=(0.570068, 0.0430135, 0.0443706), name="red")
GREEN = Material(diffuse=(0.105421, 0.37798, 0.076425), name="green")
LAMP = Material(emission=(18.387, 13.9873, 6.75357), name="lamp")

_FLOOR = ((-1, -1, -1), (-1, -1, 1), (1, -1, 1), (1, -1, -1))
_CEILING = ((-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1))
_BACK = ((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1))
_LEFT = ((-1, -1, -1), (-1, 1, -1), (-1, 1, 1), (-1, -1, 1))
_RIGHT = ((1, -1, -1), (1, -1, 1), (1, 1, 1), (1, 1, -1))
_LAMP = ((-0.23, 0.99, -0.19), (0.23, 0.99, -0.19), (0.23, 0.99, 0.19), (-0.23, 0.99, 0.19))

_FLOOR_Y = -1.0
# Vertices of a block: 0 to 3 round the bottom, 4 to 7 above them.
_BLOCK_FACES = (
    *((0, 1, 2), (0, 2, 3)),
    *((4, 6, 5), (4, 7, 6)),
    *((0, 4, 5), (0, 5, 1)),
    *((1, 5, 6), (1, 6, 2)),
    *((2, 6, 7), (2, 7, 3)),
    *((3, 7, 4), (3, 4, 0)),
)


def _room() -> list[Mesh]:
    """Five walls, open to the camera, and a lamp that shines downwards only."""
    return [
        quads(_FLOOR, material=WHITE, name="floor"),
        quads(_CEILING, material=WHITE, name="ceiling"),
        quads(_BACK, material=WHITE, name="back wall"),
        quads(_LEFT, material=RED, name="left wall"),
        quads(_RIGHT, material=GREEN, name="right wall"),
        quads(_LAMP, material=LAMP, two_sided=False, name="lamp"),
    ]


def _block(centre_x: float, centre_z: float, half_width: float, height: float, angle: float, name: str) -> Mesh:
    """A block on the floor, turned by `angle` radians about y."""
    sine, cosine = math.sin(angle), math.cos(angle)
    around = (
        (-half_width, -half_width),
        (half_width, -half_width),
        (half_width, half_width),
        (-half_width, half_width),
    )
    vertices = [
        (centre_x + cosine * x + sine * z, y, centre_z - sine * x + cosine * z)
        for y in (_FLOOR_Y, _FLOOR_Y + height)
        for x, z in around
    ]
    return Mesh(vertices=vertices, faces=_BLOCK_FACES, material=WHITE, name=name)


def _blob_radius(longitude: NDArray[Any], latitude: NDArray[Any]) -> NDArray[np.float64]:
    """Large bumps, ripples and fine grain on a sphere of radius 0.6."""
    bumps = 0.12 * np.sin(9 * longitude) * np.sin(11 * latitude) ** 2
    ripples = 0.05 * np.sin(41 * longitude + 5 * np.cos(7 * latitude)) * np.sin(37 * latitude)
    grain = 0.02 * np.sin(160 * latitude) * np.sin(150 * longitude) * np.sin(latitude)
    radius: NDArray[np.float64] = 0.6 * (1 + bumps + ripples + grain)
    return radius


def _blob(triangles: int) -> Mesh:
    """A bumpy sphere of about this many triangles, on a grid of longitudes and latitudes; open at the poles."""
    columns = int(math.sqrt(triangles))
    rows = columns // 2
    longitudes = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    latitudes = np.linspace(1e-3, np.pi - 1e-3, rows)
    longitude, latitude = np.meshgrid(longitudes, latitudes)
    radius = _blob_radius(longitude, latitude)
    x = radius * np.sin(latitude) * np.cos(longitude)
    y = radius * np.cos(latitude)
    z = radius * np.sin(latitude) * np.sin(longitude)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3) + np.array((0.0, -0.3, 0.0))
    return Mesh(vertices=vertices, faces=_grid_faces(rows, columns), material=WHITE, name="blob")


def _grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Two triangles a cell of a grid that closes upon itself along its rows: all first ones, then all second ones."""
    row_start = np.arange(rows - 1)[:, None] * columns
    column = np.arange(columns)[None, :]
    next_column = (column + 1) % columns
    a, b = row_start + column, row_start + next_column
    c, d = a + columns, b + columns
    first = np.stack([a, c, b], axis=-1).reshape(-1, 3)
    second = np.stack([b, c, d], axis=-1).reshape(-1, 3)
    return np.concatenate([first, second]).astype(np.int32)


def _scene(name: str, *contents: Mesh) -> Scene:
    camera = Camera(position=(0.0, 0.0, 3.9), direction=(0.0, 0.0, -1.0), fov=39.3077, focus=3.9)
    return Scene(shapes=[*_room(), *contents], cameras=[camera], name=name)


def bench_cornell() -> Scene:
    """The room with two blocks: 36 triangles."""
    tall = _block(-0.335, -0.38, 0.3, 1.2, 0.3, "tall block")
    short = _block(0.33, 0.35, 0.3, 0.6, -0.3, "short block")
    return _scene("bench-cornell", tall, short)


def bench_blob100k() -> Scene:
    """The room with a bumpy sphere: 99,236 triangles."""
    return _scene("bench-blob100k", _blob(100_000))


def bench_blob1m() -> Scene:
    """The room with a bumpy sphere: 998,012 triangles."""
    return _scene("bench-blob1m", _blob(1_000_000))
