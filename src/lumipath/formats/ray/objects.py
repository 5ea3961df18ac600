"""Shapes, lights and cameras of .ray files: which keys each knows, and what becomes of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scene import (
    AmbientLight,
    Box,
    Camera,
    Cone,
    Cylinder,
    DirectionalLight,
    Light,
    Material,
    PointLight,
    Shape,
    Sphere,
    Square,
)
from .materials import Materials
from .meshes import read_mesh
from .nodes import Block, offset_of
from .source import Source
from .values import (
    Reader,
    read_colour,
    read_fields,
    read_number,
    read_point,
    read_switch,
    read_text,
    read_vector,
    required,
)

_CONE: dict[str, Reader] = {
    "capped": read_switch,
    "bottom_radius": read_number,
    "top_radius": read_number,
    "height": read_number,
}
# Keyword: the class, and the keys it knows besides material and name.
_PRIMITIVES: dict[str, tuple[Callable[..., Shape], dict[str, Reader]]] = {
    "sphere": (Sphere, {}),
    "box": (Box, {}),
    "square": (Square, {}),
    "cylinder": (Cylinder, {}),
    "cone": (Cone, _CONE),
}
_MESHES = ("polymesh", "trimesh")
SHAPES = (*_PRIMITIVES, *_MESHES)


def read_shape(
    source: Source, block: Block, materials: Materials, transform: NDArray[np.float64], default: Material
) -> Shape:
    """A shape in world space; `default` is its material where it names none.

    Raises:
        SceneError: an unknown key or a wrong value; placed at the culprit.
    """
    if block.name in _MESHES:
        return read_mesh(source, block, materials, transform, default)
    create, keys = _PRIMITIVES[str(block.name)]
    fields = read_fields(source, block, {"material": materials.read, "name": read_text, **keys}, str(block.name))
    fields.setdefault("material", default)
    with source.placing(offset_of(block)):
        return create(transform=transform, **fields)


_ATTENUATION = ("constant_attenuation_coeff", "linear_attenuation_coeff", "quadratic_attenuation_coeff")


def _point_light(source: Source, block: Block) -> PointLight:
    readers = {"position": read_point, "colour": read_colour, "group": read_text}
    readers |= dict.fromkeys(_ATTENUATION, read_number)
    fields = read_fields(source, block, readers, "point_light")
    required(source, fields, "position", block, "point_light")
    coefficients = [fields.pop(name, default) for name, default in zip(_ATTENUATION, (0.0, 0.0, 1.0), strict=True)]
    return PointLight(attenuation=tuple(coefficients), **fields)


def _directional_light(source: Source, block: Block) -> DirectionalLight:
    readers = {"direction": read_point, "colour": read_colour, "group": read_text}
    return DirectionalLight(**read_fields(source, block, readers, "directional_light"))


def _ambient_light(source: Source, block: Block) -> AmbientLight:
    return AmbientLight(**read_fields(source, block, {"colour": read_colour}, "ambient_light"))


_LIGHTS: dict[str, Callable[[Source, Block], Light]] = {
    "point_light": _point_light,
    "directional_light": _directional_light,
    "ambient_light": _ambient_light,
}
LIGHTS = tuple(_LIGHTS)


def read_light(source: Source, block: Block) -> Light:
    """A light.

    Raises:
        SceneError: an unknown key or a wrong value; placed at the culprit.
    """
    with source.placing(offset_of(block)):
        return _LIGHTS[str(block.name)](source, block)


_CAMERA: dict[str, tuple[str, Reader]] = {
    "position": ("position", read_point),
    "viewdir": ("direction", read_point),
    "updir": ("up", read_point),
    "fov": ("fov", read_number),
    "aspectratio": ("aspect", read_number),
    "name": ("name", read_text),
    "quaternian": ("quaternian", read_vector(4, "(x, y, z, w)")),
}


def read_camera(source: Source, block: Block) -> Camera:
    """A camera; its orientation is given by viewdir and updir, or by the quaternian (x, y, z, w).

    Raises:
        SceneError: an unknown key, a wrong value, or both kinds of orientation; placed at the culprit.
    """
    fields = read_fields(source, block, {key: reader for key, (_, reader) in _CAMERA.items()}, "camera")
    if "quaternian" in fields and ("viewdir" in fields or "updir" in fields):
        raise source.error("camera has a quaternian and a viewdir or updir: keep one of them", offset_of(block))
    options: dict[str, Any] = {_CAMERA[key][0]: value for key, value in fields.items()}
    with source.placing(offset_of(block)):
        if "quaternian" in options:
            options["direction"], options["up"] = _directions(options.pop("quaternian"))
        return Camera(**options)


def _directions(quaternion: tuple[float, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a camera that is rotated by a quaternion (x, y, z, w) looks, and its up; a zero quaternion gives zeros."""
    length = np.linalg.norm(quaternion)
    x, y, z, w = np.asarray(quaternion) / (length or 1.0)
    backward = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z])
    up = np.array([2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)])
    return -backward, up
