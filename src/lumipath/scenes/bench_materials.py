"""The benchmark scenes with everything that costs: textures, rough metal and glass, smooth normals, a sky with a sun.

Published figures depend on them, as on those of `bench`.
"""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from ..scene import Conductor, Dielectric, Environment, Mesh, Principled, Scene, Texture, smooth_normals
from . import bench

_WALLS = ("floor", "ceiling", "back wall")
_GLASS = ("blob", "tall block", "short block")

# Radiance above; it falls off towards the horizon to a tenth.
_SKY = (0.3, 0.4, 0.6)
_SUN = 60.0
# Of the sky's picture: the sun stands behind the camera, on the right, 48 degrees high.
_SUN_ROW, _SUN_COLUMN, _SUN_RADIUS = 60, 428, 40**0.5


def _chequered() -> Texture:
    """The white of the walls, in squares of two shades."""
    y, x = np.mgrid[:256, :256]
    shade = np.where((x // 32 + y // 32) % 2 == 1, 1.0, (155 / 255) ** 2)
    return Texture(image=(shade[..., None] * bench.WHITE.diffuse).astype(np.float32), name="chequers")


def _sky() -> Environment:
    y, x = np.mgrid[:256, :512]
    image = np.clip(1 - y / 256, 0.1, 1)[..., None] * _SKY
    image[(x - _SUN_COLUMN) ** 2 + (y - _SUN_ROW) ** 2 < _SUN_RADIUS**2] = _SUN
    return Environment(image=image.astype(np.float32), name="sky")


def _uvs(mesh: Mesh) -> np.ndarray:
    """(N, 2): texture coordinates that run along every wall."""
    x, y, z = mesh.vertices.T
    return np.stack([2 * x + y, 2 * z + y], axis=-1)


def _with_materials(scene: Scene, name: str) -> Scene:
    """Walls become principled and chequered, the left one a rough metal, and what stands inside rough glass."""
    white: Any = Principled(base_color=_chequered(), metallic=0.3, roughness=0.4, name="walls")
    red: Any = Conductor(reflectance=bench.RED.diffuse, roughness=0.2**0.5, name="left wall")
    glass: Any = Dielectric(
        roughness=0.05**0.5, ior=1.5, attenuation_color=tuple(np.exp((-0.3, -0.1, -0.6))), attenuation_distance=1.0
    )
    shapes = []
    for shape in scene.shapes:
        assert isinstance(shape, Mesh)
        if shape.name in _WALLS:
            shape = attrs.evolve(shape, material=white, uvs=_uvs(shape))
        elif shape.name in _GLASS:
            # Blocks keep their edges.
            normals = smooth_normals(shape.vertices, shape.faces) if shape.name == "blob" else None
            shape = attrs.evolve(shape, material=glass, normals=normals)
        elif shape.name == "left wall":
            shape = attrs.evolve(shape, material=red)
        shapes.append(shape)
    return attrs.evolve(scene, shapes=shapes, environment=_sky(), name=name)


def bench_materials_cornell() -> Scene:
    """`bench-cornell` of all materials."""
    return _with_materials(bench.bench_cornell(), "bench-materials-cornell")


def bench_materials_blob100k() -> Scene:
    """`bench-blob100k` of all materials."""
    return _with_materials(bench.bench_blob100k(), "bench-materials-blob100k")


def bench_materials_blob1m() -> Scene:
    """`bench-blob1m` of all materials."""
    return _with_materials(bench.bench_blob1m(), "bench-materials-blob1m")
