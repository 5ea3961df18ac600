"""Pieces of test scenes."""

from __future__ import annotations

from typing import Any

import numpy as np

from lumipath.scene import (
    Conductor,
    Cone,
    Dielectric,
    Diffuse,
    DirectionalLight,
    Environment,
    Instance,
    Material,
    Mesh,
    Mix,
    Principled,
    Scene,
    Shape,
    Sphere,
    Texture,
    ThinDielectric,
)


def moved(x: float, y: float, z: float) -> np.ndarray:
    """A translation, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaled(*factors: float) -> np.ndarray:
    """A scaling by one factor, or by three, (4, 4)."""
    return np.diag([*(factors * 3 if len(factors) == 1 else factors), 1.0])


def turned(axis: str, degrees: float) -> np.ndarray:
    """A rotation about x, y or z, counter-clockwise seen from its positive end, (4, 4)."""
    a, b = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.eye(4)
    matrix[[a, a, b, b], [a, b, a, b]] = c, -s, s, c
    return matrix


def sky(radiance: Any = 1.0, rows: int = 4) -> Environment:
    """The same radiance from everywhere."""
    return Environment(image=np.broadcast_to(np.float32(radiance), (rows, 2 * rows, 3)))


def sphere_mesh(rings: int = 32, *, smooth: bool = False, transform: Any = None, **options: Any) -> Mesh:
    """The unit sphere about the y axis as 2 * rings * (2 * rings - 2) triangles, under a similarity transform."""
    theta = np.pi * np.arange(rings + 1)[:, None] / rings
    phi = 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    parts = np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi))
    vertices = np.stack(parts, -1).reshape(-1, 3)
    index = np.arange(len(vertices)).reshape(rings + 1, -1)
    right = np.roll(index, -1, axis=1)
    upper = np.stack([index[1:-1], right[1:-1], right[:-2]], -1)
    lower = np.stack([index[1:-1], index[2:], right[1:-1]], -1)
    # At the poles all vertices of a row coincide; any of them will do.
    faces = np.concatenate([upper, lower]).reshape(-1, 3)
    matrix = np.eye(4) if transform is None else np.asarray(transform)
    placed = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return Mesh(vertices=placed, faces=faces, normals=vertices @ matrix[:3, :3].T if smooth else None, **options)


def quad(*corners: Any, uv: bool = False, **options: Any) -> Mesh:
    """A flat quad, its corners counter-clockwise seen from the front; uv from (0, 0) at the first to (0, 1)."""
    uvs = ((0, 0), (1, 0), (1, 1), (0, 1)) if uv else None
    return Mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)], uvs=uvs, **options)


def floor(half: float = 1.0, *, y: float = 0.0, **options: Any) -> Mesh:
    """A square floor that faces upwards; u along x, v along -z."""
    return quad((-half, y, half), (half, y, half), (half, y, -half), (-half, y, -half), **options)


HIDDEN = moved(0.0, -20.0, 0.0)
"""Far below everything: shapes there only make a scene use a feature, so that scenes share their kernels."""


def hidden(*names: str) -> list[Shape]:
    """Small shapes that nobody sees, each of which makes the scene use a feature."""
    small = HIDDEN @ scaled(1e-2)
    corners = (small @ np.array([(0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1)]).T).T[:, :3]

    def triangle(**options: Any) -> Mesh:
        return Mesh(vertices=corners, faces=[(0, 1, 2)], **options)

    dull, lamp = Material(diffuse=0.5), Material(emission=1e-3)
    shapes = {
        "mirror": lambda: triangle(material=Material(specular=0.5)),
        "glass": lambda: triangle(material=Material(transmissive=1.0)),
        "texture": lambda: triangle(material=Material(diffuse=Texture(image=np.full((1, 1, 3), 0.5)))),
        "smooth": lambda: triangle(material=dull, normals=[(0, 0, 1), (0, 1, 1), (1, 0, 1)]),
        "blend": lambda: triangle(vertex_materials=(dull, Material(diffuse=0.1), dull)),
        "one-sided": lambda: triangle(material=dull, two_sided=False),
        "quadric": lambda: Cone(transform=small, material=dull),
        "lamp": lambda: triangle(material=lamp),
        "many lamps": lambda: Mesh(vertices=corners, faces=[(0, 1, 2)] * 65, material=lamp),
        "quadric lamp": lambda: Sphere(transform=small, material=lamp),
    }
    return [shapes[name]() for name in names]


def hidden_surfaces() -> list[Shape | Instance]:
    """Shapes that nobody sees, with all that surfaces may have."""
    small = moved(0.0, -90.0, 0.0) @ scaled(0.01)
    flat = Texture(np.full((1, 1, 3), 0.5))
    mix = Mix(first=Conductor(anisotropy=0.5), second=Diffuse(roughness=1.0), weight=flat, opacity=flat)
    corners = (small @ np.array([(0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1)]).T).T[:, :3]
    uvs = [(0, 0), (1, 0), (0, 1)]
    tinted = Diffuse(normal_map=flat, emission=1e-6, two_sided=False)
    twice = Sphere()
    return [
        Sphere(transform=small, material=mix),
        Sphere(transform=small, material=Diffuse(emission=1e-6)),
        Mesh(vertices=corners, faces=[(0, 1, 2)], uvs=uvs, colours=np.ones((3, 4)), material=tinted),
        Mesh(vertices=corners, faces=[(0, 1, 2)], normals=np.eye(3) + 0.1, material=tinted),
        Mesh(vertices=corners, faces=[(0, 1, 2)], vertex_materials=(Material(), Material(diffuse=0.5), Material())),
        Sphere(transform=small, material=Dielectric(roughness=0.5, priority=1)),
        Sphere(transform=small, material=ThinDielectric()),
        Sphere(transform=small, material=Principled(transmission=0.5, clearcoat=1.0, specular=0.5)),
        *(Instance(twice, transform=small) for _ in range(2)),
    ]


def with_all_surfaces(scene: Scene) -> Scene:
    """The scene with all that surfaces may be, far away and faint: such scenes share their kernels."""
    return Scene(
        shapes=[*scene.shapes, *hidden_surfaces()],
        lights=[*scene.lights, DirectionalLight(direction=(0, -1, 0), colour=1e-9)],
        environment=scene.environment or sky(1e-9),
        cameras=scene.cameras,
        name=scene.name,
    )
