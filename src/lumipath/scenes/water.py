"""Water in a glass: dielectrics that overlap, so that no air is left between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Camera, Dielectric, Diffuse, Material, Mesh, Scene, Texture
from ..scene.shapes import smooth_normals
from ._build import floor, quads, rotate, sky, translate

Array = NDArray[np.float64]

_AROUND = 96

# Metres: the tumbler's foot and mouth, its bottom and wall.
_FOOT, _MOUTH, _HEIGHT = 0.030, 0.036, 0.125
_BOTTOM, _WALL = 0.014, 0.0025
_LEVEL = 0.092
# How deep the water reaches into the glass. Anything works that is less than the wall.
_OVERLAP = 0.0004


def _arc(centre: tuple[float, float], radius: float, start: float, end: float, count: int = 12) -> Array:
    """(count, 2) points of an arc; angles in degrees counter-clockwise from the direction away from the axis."""
    angle = np.radians(np.linspace(start, end, count))
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=-1)


def _line(start: tuple[float, float], end: tuple[float, float], count: int = 16) -> Array:
    """(count, 2) points of a line without its ends, dense towards them, so that smooth normals stay flat between."""
    share = (1 - np.cos(np.pi * (np.arange(count) + 1) / (count + 1))) / 2
    result: Array = np.add(start, share[:, None] * np.subtract(end, start))
    return result


def lathe(profile: Array, around: int = _AROUND) -> tuple[Array, NDArray[np.int64]]:
    """Turn a profile about the y axis.

    Args:
        profile: (N, 2) distances from the axis and heights, counter-clockwise, with its first and last point on the
            axis or not.
        around: vertices of a ring.

    Returns:
        (N * around, 3) vertices and (M, 3) faces, whose fronts look outwards.
    """
    angle = 2 * np.pi * np.arange(around) / around
    r, y = profile[:, :1], profile[:, 1:]
    rings = np.broadcast_arrays(r * np.sin(angle), y, r * np.cos(angle))
    index = np.arange(len(profile) * around).reshape(len(profile), around)
    right = np.roll(index, -1, axis=1)
    lower = np.stack([index[:-1], right[:-1], right[1:]], axis=-1)
    upper = np.stack([index[:-1], right[1:], index[1:]], axis=-1)
    faces = np.concatenate([lower, upper]).reshape(-1, 3)
    vertices = np.stack(rings, axis=-1).reshape(-1, 3)
    # Triangles on the axis have no area.
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return vertices, faces[areas > 0]


def _smooth(vertices: Array, faces: NDArray[np.int64], **options: Any) -> Mesh:
    normals = smooth_normals(vertices.astype(np.float32), faces.astype(np.int32))
    return Mesh(vertices=vertices, faces=faces, normals=normals, **options)


def _inner_radius(y: float) -> float:
    """Of the tumbler, above the rounding of its bottom."""
    return _FOOT + (_MOUTH - _FOOT) * y / _HEIGHT - _WALL


def _tumbler() -> Array:
    """The profile of the glass."""
    foot, fillet, rim = 0.003, 0.006, _WALL / 2
    inner = _inner_radius(_BOTTOM + fillet)
    return np.concatenate(
        [
            [(0.0, 0.0)],
            _line((0.0, 0.0), (_FOOT - foot, 0.0)),
            _arc((_FOOT - foot, foot), foot, -90, 0),
            _line((_FOOT, foot), (_MOUTH, _HEIGHT)),
            _arc((_MOUTH - rim, _HEIGHT), rim, 0, 180),
            _line((_MOUTH - _WALL, _HEIGHT), (inner, _BOTTOM + fillet)),
            _arc((inner - fillet, _BOTTOM + fillet), fillet, 0, -90),
            _line((inner - fillet, _BOTTOM), (0.0, _BOTTOM)),
            [(0.0, _BOTTOM)],
        ]
    )


def _water() -> Array:
    """The profile of the water, which reaches a little into the glass, and climbs it."""
    fillet = 0.006
    low, high = _BOTTOM + fillet, _LEVEL + 0.0012
    bottom, top = _inner_radius(low) + _OVERLAP, _inner_radius(high) + _OVERLAP
    from_wall = np.linspace(0, 0.012, 24)
    meniscus = np.stack([top - from_wall, _LEVEL + 0.0012 * np.exp(-from_wall / 0.0015)], axis=-1)
    return np.concatenate(
        [
            [(0.0, _BOTTOM - _OVERLAP)],
            _line((0.0, _BOTTOM - _OVERLAP), (bottom - fillet, _BOTTOM - _OVERLAP)),
            _arc((bottom - fillet, low - _OVERLAP), fillet, -90, 0),
            _line((bottom, low), (top, high)),
            meniscus,
            _line((top - 0.012, _LEVEL), (0.0, _LEVEL)),
            [(0.0, _LEVEL)],
        ]
    )


def _checkers(squares: int = 24) -> Texture:
    """A cloth of two colours."""
    odd = (np.arange(squares)[:, None] + np.arange(squares)) % 2 == 1
    image = np.where(odd[..., None], (0.75, 0.72, 0.66), (0.12, 0.22, 0.3))
    fine = np.repeat(np.repeat(image, 16, axis=0), 16, axis=1)
    return Texture(image=fine.astype(np.float32), name="cloth")


def _straw() -> Mesh:
    """A tube that leans against the mouth of the glass."""
    vertices, faces = lathe(_line((0.003, 0.0), (0.003, 0.175), 8), 48)
    lean = translate(-0.019, 0.0165, 0.0) @ rotate("z", -22)
    red = Diffuse(reflectance=(0.85, 0.12, 0.08), name="straw")
    return _smooth(vertices @ lean[:3, :3].T + lean[:3, 3], faces, material=red, name="straw")


def glass_of_water() -> Scene:
    """A tumbler of water with a straw on a cloth, by a window; the water overlaps the glass and has less priority."""
    green: Any = {"attenuation_color": (0.8, 0.95, 0.88), "attenuation_distance": 0.1}
    glass: Any = Dielectric(ior=1.52, priority=2, name="glass", **green)
    water: Any = Dielectric(ior=1.333, priority=1, name="water")
    window = quads(
        ((-0.35, 0.1, -0.1), (-0.35, 0.1, 0.2), (-0.35, 0.4, 0.2), (-0.35, 0.4, -0.1)),
        material=Material(emission=(9.0, 8.5, 7.5), name="window"),
        name="window",
    )
    shapes = [
        floor(0.4, material=Diffuse(reflectance=_checkers(), name="cloth")),
        _smooth(*lathe(_tumbler()), material=glass, name="tumbler"),
        _smooth(*lathe(_water()), material=water, name="water"),
        _straw(),
        window,
    ]
    camera = Camera.look_at((0.06, 0.17, 0.36), (0.0, 0.066, 0.0), fov=30.0, aspect=1.0)
    return Scene(shapes=shapes, cameras=[camera], environment=sky(0.5), name="glass-of-water")
