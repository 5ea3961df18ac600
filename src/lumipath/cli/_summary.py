"""Facts about a scene, for `lumipath info`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..scene import AnyMaterial, Appearance, Cone, Environment, Instance, Mesh, Scene, Shape, Sky, Texture, materials_of

# Triangle record, its share of the tree's nodes, and the vertex data that shading reads.
_BYTES_PER_TRIANGLE = 160

Bounds = tuple[NDArray[np.float64], NDArray[np.float64]]


def summarise(scene: Scene) -> dict[str, Any]:
    """Counts, sizes and bounds of a scene, ready for JSON; lengths in metres, memory in bytes."""
    materials = scene.materials()
    textures = {id(texture): texture for material in materials for texture in _textures(material)}
    bounds = scene_bounds(scene)
    environment = scene.environment
    return {
        "name": scene.name,
        "triangles": scene.triangle_count,
        "stored triangles": scene.stored_triangle_count,
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
    """Axis-aligned box around all shapes, as two (3,) float64 corners in metres; None without shapes.

    It is the smallest, but for instances that are turned: of those it holds the box that was turned.
    """
    known: dict[int, Bounds] = {}
    boxes = [box for shape in scene.shapes for box in _boxes(shape, known)]
    if not boxes:
        return None
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def _boxes(shape: Shape | Instance, known: dict[int, Bounds]) -> Iterator[Bounds]:
    """Boxes around a shape, or around the boxes of what an instance places; `known` has those of shapes seen before."""
    for part in shape.parts if isinstance(shape, Instance) else (shape,):
        if isinstance(part, Mesh) and not len(part.vertices):
            continue
        if id(part) not in known:
            known[id(part)] = shape_bounds(part)
        low, high = known[id(part)]
        if isinstance(shape, Instance):
            linear = shape.transform[:3, :3]
            middle, reach = linear @ (low + high) / 2 + shape.transform[:3, 3], np.abs(linear) @ (high - low) / 2
            low, high = middle - reach, middle + reach
        yield low, high


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
    # Views of one image share it.
    images = sum({id(texture.image): texture.image.nbytes for texture in textures}.values())
    environment = scene.environment.image.nbytes if isinstance(scene.environment, Environment) else 0
    return math.ceil(scene.stored_triangle_count * _BYTES_PER_TRIANGLE + images + environment)


def _count(items: list[Any]) -> dict[str, int]:
    return dict(Counter(type(item).__name__ for item in items))


def _textures(material: AnyMaterial) -> Iterator[Texture]:
    values = [getattr(material, field.name) for field in attrs.fields(type(material))]
    yield from (value for value in values if isinstance(value, Texture))
    for part in values:
        if isinstance(part, Appearance):
            yield from _textures(part)


def _emits(shape: Shape | Instance) -> bool:
    return any(material.is_emissive for material in materials_of(shape))


def _environment(environment: Environment | Sky) -> str:
    if isinstance(environment, Sky):
        return f"sky, sun at {environment.elevation:g} degrees, turbidity {environment.turbidity:g}"
    height, width, _ = environment.image.shape
    return f"{environment.name or 'image'}, {width} x {height} pixels"
