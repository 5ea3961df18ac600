"""Shapes as one set of flat arrays: triangles first, then quadrics."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import Cone, Mesh, Scene, Sphere
from . import layout
from .materials import MaterialTable


@frozen(eq=False)
class Geometry:
    """All shapes of a scene, concatenated.

    vertices (V, 3) float32; normals (V, 3) float32, 0 where a mesh has none; uvs (V, 2) float32; faces (T, 3) int32;
    face_materials (T,) int32; two_sided (T,) bool; vertex_materials (V,) int32; quadrics: the shapes, with their
    records (Q, 16) float32 and quadric_materials (Q,) int32; features: bits of `layout`.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    faces: NDArray[np.int32]
    face_materials: NDArray[np.int32]
    two_sided: NDArray[np.bool_]
    vertex_materials: NDArray[np.int32]
    quadrics: list[Sphere | Cone]
    quadric_rows: NDArray[np.float32]
    quadric_materials: NDArray[np.int32]
    features: int

    def face_normals(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Unit normals (T, 3), 0 for triangles without area, and areas (T,) of the faces."""
        a, b, c = (self.vertices[self.faces[:, k]].astype(np.float64) for k in range(3))
        normals = np.cross(b - a, c - a)
        doubled = np.linalg.norm(normals, axis=1)
        unit = np.divide(normals, doubled[:, None], out=np.zeros_like(normals), where=doubled[:, None] > 0)
        return unit, doubled * 0.5

    def solid(self) -> NDArray[np.bool_]:
        """Whether each face has an area, (T,)."""
        return self.face_normals()[1] > 0

    def reach(self) -> NDArray[np.float64]:
        """Greatest coordinate of each primitive, (P,): what the rounding of a hit grows with."""
        corners = np.abs(self.vertices).max(axis=1) if len(self.vertices) else np.zeros(0)
        faces = corners[self.faces].max(axis=1) if len(self.faces) else np.zeros(0)
        return np.concatenate([faces, np.array([quadric_reach(shape) for shape in self.quadrics], np.float64)])

    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lower and upper corners of the boxes around all primitives, each (P, 3) float32."""
        lower = np.minimum(
            np.minimum(*(self.vertices[self.faces[:, k]] for k in (0, 1))), self.vertices[self.faces[:, 2]]
        )
        upper = np.maximum(
            np.maximum(*(self.vertices[self.faces[:, k]] for k in (0, 1))), self.vertices[self.faces[:, 2]]
        )
        if not self.quadrics:
            return lower, upper
        boxes = np.array([quadric_box(shape) for shape in self.quadrics])
        return np.concatenate([lower, boxes[:, 0]]), np.concatenate([upper, boxes[:, 1]])


def quadric_reach(shape: Sphere | Cone) -> float:
    """A bound of the coordinates of a quadric's points."""
    size = 1.0 if isinstance(shape, Sphere) else max(shape.bottom_radius, shape.top_radius, shape.height)
    linear = np.linalg.norm(shape.transform[:3, :3], axis=0).max() * size
    return float(np.abs(shape.transform[:3, 3]).max() + linear)


def quadric_box(shape: Sphere | Cone) -> NDArray[np.float32]:
    """The tight axis-parallel box around a quadric: (2, 3) float32, rounded outwards."""
    linear, origin = shape.transform[:3, :3], shape.transform[:3, 3]
    if isinstance(shape, Sphere):
        reach = np.linalg.norm(linear, axis=1)
        lower, upper = origin - reach, origin + reach
    else:
        ring = np.linalg.norm(linear[:, :2], axis=1)
        top = origin + linear[:, 2] * shape.height
        lower = np.minimum(origin - ring * shape.bottom_radius, top - ring * shape.top_radius)
        upper = np.maximum(origin + ring * shape.bottom_radius, top + ring * shape.top_radius)
    # Rays find a quadric in object space, with roundings of its own.
    slack = 1e-6 * (np.abs(lower) + np.abs(upper) + (upper - lower))
    return np.array([lower - slack, upper + slack], np.float32)


def is_round(shape: Sphere | Cone) -> bool:
    """Whether a shape is a sphere in world space too."""
    linear = shape.transform[:3, :3]
    square = linear.T @ linear
    size = np.trace(square) / 3
    return isinstance(shape, Sphere) and bool(np.abs(square - size * np.eye(3)).max() < 1e-5 * size)


def _quadric_row(shape: Sphere | Cone) -> NDArray[np.float32]:
    row = np.zeros(int(layout.QUADRIC_SIZE), np.float32)
    row[:12] = np.linalg.inv(shape.transform)[:3].reshape(-1)
    if isinstance(shape, Sphere):
        row.view(np.int32)[12] = layout.SPHERE
        row[13] = is_round(shape)
    else:
        row.view(np.int32)[12] = layout.CAPPED_CONE if shape.capped else layout.OPEN_CONE
        row[13:16] = shape.bottom_radius, shape.top_radius, shape.height
    return row


def _concatenate(parts: list[NDArray], shape: tuple[int, ...], dtype: type) -> NDArray:
    return np.concatenate(parts).astype(dtype, copy=False) if parts else np.zeros(shape, dtype)


def flatten(scene: Scene, table: MaterialTable) -> Geometry:
    """Concatenate the shapes of a scene; materials get their numbers from `table`."""
    meshes = [shape for shape in scene.shapes if isinstance(shape, Mesh) and len(shape.faces)]
    quadrics = [shape for shape in scene.shapes if not isinstance(shape, Mesh)]
    vertices, normals, uvs, faces, face_materials, two_sided, vertex_materials = ([] for _ in range(7))
    first = 0
    features = 0
    for mesh in meshes:
        count = len(mesh.vertices)
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + np.int32(first))
        normals.append(mesh.normals if mesh.normals is not None else np.zeros((count, 3), np.float32))
        uvs.append(mesh.uvs if mesh.uvs is not None else np.zeros((count, 2), np.float32))
        two_sided.append(np.full(len(mesh.faces), mesh.two_sided))
        if mesh.vertex_materials is not None:
            numbers = np.array([table.number(material) for material in mesh.vertex_materials], np.int32)
            features |= layout.BLENDED_MATERIALS
        else:
            numbers = np.full(count, table.number(mesh.material), np.int32)
        vertex_materials.append(numbers)
        face_materials.append(_face_materials(numbers[mesh.faces], table))
        if mesh.normals is not None and _is_smooth(mesh):
            features |= layout.SMOOTH_NORMALS
        if not mesh.two_sided:
            features |= layout.CULLING
        first += count
    if quadrics:
        features |= layout.QUADRICS
    return Geometry(
        _concatenate(vertices, (0, 3), np.float32),
        _concatenate(normals, (0, 3), np.float32),
        _concatenate(uvs, (0, 2), np.float32),
        _concatenate(faces, (0, 3), np.int32),
        _concatenate(face_materials, (0,), np.int32),
        _concatenate(two_sided, (0,), np.bool_),
        _concatenate(vertex_materials, (0,), np.int32),
        quadrics,
        np.array([_quadric_row(shape) for shape in quadrics], np.float32).reshape(-1, int(layout.QUADRIC_SIZE)),
        np.array([table.number(shape.material) for shape in quadrics], np.int32),
        features,
    )


def _face_materials(numbers: NDArray[np.int32], table: MaterialTable) -> NDArray[np.int32]:
    """The material that stands for each face, of those of its corners (M, 3): a blend that is partly glass is glass."""
    glass = np.array([material.is_dielectric for material in table.materials])[numbers]
    return np.take_along_axis(numbers, glass.argmax(axis=1)[:, None], axis=1)[:, 0]


def _is_smooth(mesh: Mesh) -> bool:
    """Whether the vertex normals differ from those of the faces anywhere."""
    assert mesh.normals is not None
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(face, axis=1, keepdims=True)
    face = np.divide(face, length, out=np.zeros_like(face), where=length > 0)
    agreement = np.abs((mesh.normals[mesh.faces] * face[:, None]).sum(2))
    return bool((agreement[length[:, 0] > 0] < 1 - 1e-6).any())


def shape_numbers(scene: Scene) -> NDArray[np.int32]:
    """(P,) int32: for each primitive, in the order of `flatten`, which shape of the scene it belongs to."""
    meshes = [(number, len(shape.faces)) for number, shape in enumerate(scene.shapes) if isinstance(shape, Mesh)]
    quadrics = [(number, 1) for number, shape in enumerate(scene.shapes) if not isinstance(shape, Mesh)]
    numbers, lengths = np.array([*meshes, *quadrics], np.int64).reshape(-1, 2).T
    return np.repeat(numbers, lengths).astype(np.int32)


def vertex_rows(geometry: Geometry) -> NDArray[np.float32]:
    """(V, 8) float32: the records of all vertices."""
    return np.concatenate(
        [geometry.vertices, geometry.uvs[:, :1], geometry.normals, geometry.uvs[:, 1:]], axis=1, dtype=np.float32
    )
