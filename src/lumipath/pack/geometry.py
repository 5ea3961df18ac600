"""Shapes as one set of flat arrays: triangles first, then quadrics."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import AnyMaterial, Appearance, Cone, Mesh, Scene, Shape, Sphere
from . import layout
from .instances import Arrangement, Instancing, arrange, cluster_boxes, instance_rows, placed_boxes
from .materials import MaterialTable


@frozen(eq=False)
class Geometry:
    """All shapes of a scene, concatenated: those that stand alone first, then those of targets, in their coordinates.

    vertices (V, 3) float32; normals (V, 3) float32, 0 where a mesh has none; uvs (V, 2) float32; faces (T, 3) int32;
    face_materials (T,) int32; two_sided (T,) bool; vertex_materials (V,) int32; vertex_colours (V, 4) float32, 1 where
    a mesh has none, or no rows where no mesh has any; quadrics: the shapes, with their records (Q, 16) float32 and
    quadric_materials (Q,) int32; instancing: what is placed where, or None; open_materials (M,) bool, whether rays may
    go through; features: bits of `layout`.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    faces: NDArray[np.int32]
    face_materials: NDArray[np.int32]
    two_sided: NDArray[np.bool_]
    vertex_materials: NDArray[np.int32]
    vertex_colours: NDArray[np.float32]
    quadrics: list[Sphere | Cone]
    quadric_rows: NDArray[np.float32]
    quadric_materials: NDArray[np.int32]
    instancing: Instancing | None
    open_materials: NDArray[np.bool_]
    features: int

    @property
    def lone_faces(self) -> int:
        """Number of the faces that stand alone."""
        return len(self.faces) if self.instancing is None else int((self.instancing.alone < len(self.faces)).sum())

    @property
    def lone_quadrics(self) -> int:
        """Number of the quadrics that stand alone."""
        return len(self.quadrics) if self.instancing is None else len(self.instancing.alone) - self.lone_faces

    def face_normals(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Unit normals (T, 3), 0 for triangles without area, and areas (T,) of the faces."""
        return self._face_normals

    @cached_property
    def _face_normals(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        # Three steps of packing ask for them, and they take longer than anything else in it.
        a, b, c = (self.vertices[self.faces[:, k]].astype(np.float64) for k in range(3))
        normals = np.cross(b - a, c - a)
        doubled = np.linalg.norm(normals, axis=1)
        unit = np.divide(normals, doubled[:, None], out=np.zeros_like(normals), where=doubled[:, None] > 0)
        return unit, doubled * 0.5

    def solid(self) -> NDArray[np.bool_]:
        """Whether each face has an area, (T,)."""
        return self.face_normals()[1] > 0

    def holes(self) -> NDArray[np.bool_]:
        """Whether rays may go through each primitive, (P,)."""
        through = self.open_materials[np.concatenate([self.face_materials, self.quadric_materials])]
        if len(self.vertex_colours):
            through[: len(self.faces)] |= (self.vertex_colours[:, 3] < 1)[self.faces].any(axis=1)
        return through

    def reach(self) -> NDArray[np.float64]:
        """Greatest coordinate of each primitive, (P,): what the rounding of a hit grows with."""
        corners = np.abs(self.vertices).max(axis=1) if len(self.vertices) else np.zeros(0)
        faces = corners[self.faces].max(axis=1) if len(self.faces) else np.zeros(0)
        return np.concatenate([faces, np.array([quadric_reach(shape) for shape in self.quadrics], np.float64)])

    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lower and upper corners of the boxes around all primitives, where they are stored, each (P, 3) float32."""
        return self._bounds

    @cached_property
    def _bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
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

    def world_bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The same of all primitives that stand alone and of all instances, in world space."""
        lower, upper = self.bounds()
        if self.instancing is None:
            return lower, upper
        alone, boxes = self.instancing.alone, self.instancing.boxes
        return np.concatenate([lower[alone], boxes[:, 0]]), np.concatenate([upper[alone], boxes[:, 1]])


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
    """Whether a shape is a sphere in world space too, and nothing is seen of its far side."""
    linear = shape.transform[:3, :3]
    square = linear.T @ linear
    size = np.trace(square) / 3
    hides = isinstance(shape, Sphere) and not _has_holes(shape.material)
    return hides and bool(np.abs(square - size * np.eye(3)).max() < 1e-5 * size)


def _has_holes(material: AnyMaterial) -> bool:
    return isinstance(material, Appearance) and material.has_holes


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
    arrangement = arrange(scene)
    shapes = [piece.shape() for piece in arrangement.pieces]
    shapes += [part for target in arrangement.targets for part in target.parts]
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    quadrics = [shape for shape in shapes if not isinstance(shape, Mesh)]
    vertices, normals, uvs, faces, face_materials, two_sided, vertex_materials, colours = ([] for _ in range(8))
    coloured = any(mesh.colours is not None for mesh in meshes)
    first = 0
    features = layout.VERTEX_COLOURS if coloured else 0
    for mesh in meshes:
        count = len(mesh.vertices)
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + np.int32(first))
        normals.append(mesh.normals if mesh.normals is not None else np.zeros((count, 3), np.float32))
        uvs.append(mesh.uvs if mesh.uvs is not None else np.zeros((count, 2), np.float32))
        seen_from_behind = mesh.two_sided and _is_two_sided(mesh.material)
        two_sided.append(np.full(len(mesh.faces), seen_from_behind))
        if coloured:
            colours.append(_vertex_colours(mesh))
        if mesh.vertex_materials is not None:
            numbers = np.array([table.number(material) for material in mesh.vertex_materials], np.int32)
            features |= layout.BLENDED_MATERIALS
        else:
            numbers = np.full(count, table.number(mesh.material), np.int32)
        vertex_materials.append(numbers)
        face_materials.append(_face_materials(numbers[mesh.faces], table))
        if mesh.normals is not None and _is_smooth(mesh):
            features |= layout.SMOOTH_NORMALS
        if not seen_from_behind:
            features |= layout.CULLING
        first += count
    if quadrics:
        features |= layout.QUADRICS
    quadric_materials = np.array([table.number(shape.material) for shape in quadrics], np.int32)
    instancing = _instancing(arrangement, shapes, table) if arrangement.targets else None
    if instancing is not None:
        features |= layout.INSTANCES
    return Geometry(
        _concatenate(vertices, (0, 3), np.float32),
        _concatenate(normals, (0, 3), np.float32),
        _concatenate(uvs, (0, 2), np.float32),
        _concatenate(faces, (0, 3), np.int32),
        _concatenate(face_materials, (0,), np.int32),
        _concatenate(two_sided, (0,), np.bool_),
        _concatenate(vertex_materials, (0,), np.int32),
        _concatenate(colours, (0, 4), np.float32),
        quadrics,
        np.array([_quadric_row(shape) for shape in quadrics], np.float32).reshape(-1, int(layout.QUADRIC_SIZE)),
        quadric_materials,
        instancing,
        np.array([_has_holes(material) for material in table.materials], np.bool_),
        features,
    )


def _instancing(arrangement: Arrangement, shapes: list[Shape], table: MaterialTable) -> Instancing:
    """The instances of an arrangement, whose pieces and parts of targets are `shapes`."""
    sizes = [(len(shape.faces), 0) if isinstance(shape, Mesh) else (0, 1) for shape in shapes]
    # Where the faces and the quadrics of each shape begin; quadrics are numbered after all faces.
    ends = np.cumsum([(0, 0), *sizes], axis=0) + (0, sum(faces for faces, _ in sizes))

    def numbers(first: int, last: int) -> NDArray[np.int32]:
        """The primitives of the shapes first .. last - 1."""
        return np.concatenate([np.arange(*ends[[first, last], kind], dtype=np.int32) for kind in (0, 1)])

    at = len(arrangement.pieces)
    alone, members, boxes = numbers(0, at), [], []
    for target in arrangement.targets:
        members.append(numbers(at, at + len(target.parts)))
        at += len(target.parts)
        boxes.append(placed_boxes(np.concatenate([_part_boxes(part) for part in target.parts]), target.places))
    places = [place for target in arrangement.targets for place in target.places]
    owners = np.repeat(np.arange(len(members)), [len(target.places) for target in arrangement.targets])
    # As in the scene, so that numbers and records do not depend on which targets there are.
    order = np.argsort([place.number for place in places], kind="stable")
    places = [places[k] for k in order]
    rows = instance_rows(places, table)
    return Instancing(alone, members, owners[order].astype(np.int32), rows, np.concatenate(boxes)[order])


def _part_boxes(part: Shape) -> NDArray[np.float64]:
    """(B, 2, 3): boxes that together contain a part of a target."""
    if isinstance(part, Mesh):
        return cluster_boxes(part.vertices[np.unique(part.faces)])
    return quadric_box(part)[None].astype(np.float64)


def _is_two_sided(material: AnyMaterial) -> bool:
    return material.two_sided if isinstance(material, Appearance) else True


def _vertex_colours(mesh: Mesh) -> NDArray[np.float32]:
    """(N, 4) float32: the colours of a mesh, 1 where it has none."""
    made = np.ones((len(mesh.vertices), 4), np.float32)
    if mesh.colours is not None:
        made[:, : mesh.colours.shape[1]] = mesh.colours
    return made


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
    """(P,) int32: for each primitive, in the order of `flatten`, which shape of the scene it is; -1 in a target."""
    arrangement = arrange(scene)
    parts = [(piece.number, piece.part) for piece in arrangement.pieces]
    parts += [(-1, part) for target in arrangement.targets for part in target.parts]
    meshes = [(number, len(part.faces)) for number, part in parts if isinstance(part, Mesh)]
    quadrics = [(number, 1) for number, part in parts if not isinstance(part, Mesh)]
    numbers, lengths = np.array([*meshes, *quadrics], np.int64).reshape(-1, 2).T
    return np.repeat(numbers, lengths).astype(np.int32)


def vertex_rows(geometry: Geometry) -> NDArray[np.float32]:
    """(V, 8) float32: the records of all vertices."""
    return np.concatenate(
        [geometry.vertices, geometry.uvs[:, :1], geometry.normals, geometry.uvs[:, 1:]], axis=1, dtype=np.float32
    )
