"""Facts about a scene, for `lumipath info`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Cone, Environment, Material, Mesh, Scene, Shape, Sky, Texture

# Triangle record, its share of the tree's nodes, and the vertex data that shading reads.
_BYTES_PER_TRIANGLE = 160
_LOBES = ("emission", "diffuse", "specular", "reflective", "transmissive", "ambient")

Bounds = tuple[NDArray[np.float64], NDArray[np.float64]]


def summarise(scene: Scene) -> dict[str, Any]:
    """Counts, sizes and bounds of a scene, ready for JSON; lengths in metres, memory in bytes."""
    materials = _materials(scene)
    textures = {id(texture): texture for material in materials for texture in _textures(material)}
    bounds = scene_bounds(scene)
    environment = scene.environment
    return {
        "name": scene.name,
        "triangles": scene.triangle_count,
        "shapes": _count(scene.shapes),
        "lights": {**_count(scene.lights), "emissive shapes": sum(map(_emits, scene.shapes))},
        "cameras": [camera.name or str(index) for index, camera in enumerate(scene.cameras)],
        "materials": len(materials),
        "textures": len(textures),
        "environment": None if environment is None else _environment(environment),
        "bounds": None if bounds is None else {"min": bounds[0].tolist(), "max": bounds[1].tolist()},
        "memory_bytes": memory_estimate(scene, list(textures.values())),
    }


def scene_bounds(scene: Scene) -> Bounds | None:
    """Smallest axis-aligned box around all shapes, as two (3,) float64 corners in metres; None without shapes."""
    boxes = [shape_bounds(shape) for shape in scene.shapes if not isinstance(shape, Mesh) or len(shape.vertices)]
    if not boxes:
        return None
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def shape_bounds(shape: Shape) -> Bounds:
    """Smallest axis-aligned box around one shape, as two (3,) float64 corners in metres."""
    if isinstance(shape, Mesh):
        return shape.vertices.min(axis=0).astype(np.float64), shape.vertices.max(axis=0).astype(np.float64)
    linear, centre = shape.transform[:3, :3], shape.transform[:3, 3]
    if isinstance(shape, Cone):
        discs = ((shape.bottom_radius, 0.0), (shape.top_radius, shape.height))
        ends = [_disc_bounds(linear, centre + linear[:, 2] * z, radius) for radius, z in discs]
        return np.minimum(ends[0][0], ends[1][0]), np.maximum(ends[0][1], ends[1][1])
    # The farthest point of a transformed unit sphere along an axis lies at the length of that row of the matrix.
    reach = np.linalg.norm(linear, axis=1)
    return centre - reach, centre + reach


def _disc_bounds(linear: NDArray[np.float64], centre: NDArray[np.float64], radius: float) -> Bounds:
    reach = radius * np.linalg.norm(linear[:, :2], axis=1)
    return centre - reach, centre + reach


def memory_estimate(scene: Scene, textures: list[Texture]) -> int:
    """About how many bytes the scene takes while it is rendered, without the film."""
    images = sum(texture.image.nbytes for texture in textures)
    environment = scene.environment.image.nbytes if isinstance(scene.environment, Environment) else 0
    return math.ceil(scene.triangle_count * _BYTES_PER_TRIANGLE + images + environment)


def _count(items: list[Any]) -> dict[str, int]:
    return dict(Counter(type(item).__name__ for item in items))


def _shape_materials(shape: Shape) -> tuple[Material, ...]:
    if isinstance(shape, Mesh) and shape.vertex_materials is not None:
        return shape.vertex_materials
    return (shape.material,)


def _materials(scene: Scene) -> list[Material]:
    """Every material once; two with equal values are still two."""
    return list({id(material): material for shape in scene.shapes for material in _shape_materials(shape)}.values())


def _textures(material: Material) -> Iterator[Texture]:
    return (value for lobe in _LOBES if isinstance(value := getattr(material, lobe), Texture))


def _emits(shape: Shape) -> bool:
    return any(material.is_emissive for material in _shape_materials(shape))


def _environment(environment: Environment | Sky) -> str:
    if isinstance(environment, Sky):
        return f"sky, sun at {environment.elevation:g} degrees, turbidity {environment.turbidity:g}"
    height, width, _ = environment.image.shape
    return f"{environment.name or 'image'}, {width} x {height} pixels"
