"""Everything that varies across a surface: images, smooth normals, blended vertex materials."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scene import Box, Camera, Material, Mesh, Scene, Square, Texture, smooth_normals
from ._build import floor, rotate, scale, sky, translate


def _chequers(first: tuple[float, float, float], second: tuple[float, float, float], tiles: int, size: int) -> Texture:
    """A chequered square of `tiles` x `tiles` fields, each `size` x `size` texels; linear colours."""
    odd = np.add.outer(np.arange(tiles), np.arange(tiles)) % 2 == 1
    image = np.where(odd[:, :, None], np.asarray(second), np.asarray(first))
    return Texture(image.repeat(size, axis=0).repeat(size, axis=1).astype(np.float32), name="chequers")


def _gradient() -> Texture:
    """Red grows with u, green with v: shows which way round a texture lies."""
    v, u = np.meshgrid(np.linspace(1, 0, 32), np.linspace(0, 1, 32), indexing="ij")
    return Texture(np.stack([u, v, np.full_like(u, 0.2)], axis=-1).astype(np.float32), wrap="clamp", name="gradient")


def _wavy_vertices(side: int) -> NDArray[np.float64]:
    x, z = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    height = 0.15 * np.sin(3 * np.pi * x) * np.cos(2 * np.pi * z)
    return np.stack([x, height, z], axis=-1).reshape(-1, 3)


def _wavy_sheet(side: int = 24) -> Mesh:
    """A coarse wavy sheet that looks smooth through its vertex normals."""
    vertices = _wavy_vertices(side) + np.array((-1.4, 0.6, 0.0))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)[None, :]).reshape(-1, 1)
    faces = np.concatenate([corner + (0, side, 1), corner + (1, side, side + 1)])
    normals = smooth_normals(vertices.astype(np.float32), faces.astype(np.int32))
    material = Material(diffuse=(0.2, 0.45, 0.7), specular=(0.05, 0.05, 0.05), name="sheet")
    return Mesh(vertices=vertices, faces=faces, normals=normals, material=material, name="wavy sheet")


def _blended_triangle() -> Mesh:
    """Red, green and blue corners that blend across the face."""
    corners = ((0.3, 0.0, -0.8), (1.7, 0.0, -0.8), (1.0, 1.3, -0.8))
    colours = ((0.8, 0.05, 0.05), (0.05, 0.8, 0.05), (0.05, 0.05, 0.8))
    materials = tuple(Material(diffuse=colour) for colour in colours)
    return Mesh(vertices=corners, faces=[(0, 1, 2)], vertex_materials=materials, name="blended triangle")


def textures() -> Scene:
    """A textured floor and box, a smooth sheet, a blended triangle and a glowing picture."""
    ground = floor(4.0, material=Material(diffuse=_chequers((0.7, 0.7, 0.7), (0.15, 0.15, 0.18), 16, 8), name="floor"))
    box = Box(
        transform=translate(1.0, 0.35, 0.7) @ rotate("y", 25) @ scale(0.7),
        material=Material(diffuse=_gradient(), name="gradient"),
        name="box",
    )
    glow = _chequers((3.0, 1.5, 0.3), (0.0, 0.3, 1.5), 4, 4)
    picture = Square(
        transform=translate(-0.4, 1.6, -1.8) @ scale(1.6, 1.0, 1.0),
        material=Material(emission=glow, name="glowing picture"),
        name="picture",
    )
    return Scene(
        shapes=[ground, box, _wavy_sheet(), _blended_triangle(), picture],
        cameras=[Camera.look_at((0.0, 2.0, 5.0), (0.0, 0.6, 0.0), fov=40.0, aspect=1.6)],
        environment=sky(0.7),
        name="textures",
    )
