"""The polymesh of .ray files."""

from __future__ import annotations

from typing import Any

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from ...scene import Material, Mesh, Texture, smooth_normals, transform_mesh
from .materials import Materials
from .nodes import Block, offset_of
from .number_lists import Tuples, counted, read_tuples
from .polygons import triangulate
from .source import Source
from .values import Reader, read_fields, read_switch, read_text, required

_TEXTURABLE = ("emission", "diffuse", "specular", "reflective", "transmissive", "ambient")
_CORNER_UVS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))


@frozen(eq=False)
class _Parts:
    """What a mesh is made of, in object space: the arguments of `Mesh`, in double precision."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[Any] | None
    vertex_materials: tuple[Material, ...] | None
    material: Material
    name: str
    uvs: NDArray[np.float64] | None = None

    @property
    def materials(self) -> set[Material]:
        """Those that a ray can meet."""
        return {self.material} if self.vertex_materials is None else set(self.vertex_materials)

    @property
    def is_textured(self) -> bool:
        """Whether a material has a map."""
        return any(isinstance(getattr(one, lobe), Texture) for one in self.materials for lobe in _TEXTURABLE)


def read_mesh(source: Source, block: Block, materials: Materials, transform: Any, default: Material) -> Mesh:
    """A polymesh in world space.

    It is two-sided unless all its materials are one-sided. The language has no texture coordinates: where a material
    has a map, each triangle gets vertices of its own with uv (0,0), (1,0), (0,1) at its corners, so that the map lies
    on every triangle. `gennormals` makes normals even where the file gives some.

    Args:
        source: the file.
        block: the polymesh.
        materials: those defined so far.
        transform: 4 x 4 float64, object to world.
        default: the material where the mesh names none.

    Raises:
        SceneError: a part is missing or wrong; placed at the culprit.
    """
    parts = _read_parts(source, block, materials, default)
    if parts.is_textured:
        parts = _with_uvs(parts)
    with source.placing(offset_of(block)):
        vertices, faces, normals = transform_mesh(parts.vertices, parts.faces, transform, parts.normals)
        return Mesh(
            vertices=vertices,
            faces=faces,
            normals=normals,
            uvs=parts.uvs,
            material=parts.material,
            vertex_materials=parts.vertex_materials,
            two_sided=not all(material.is_one_sided for material in parts.materials),
            name=parts.name,
        )


def _read_parts(source: Source, block: Block, materials: Materials, default: Material) -> _Parts:
    readers: dict[str, Reader] = {
        "points": read_tuples,
        "faces": read_tuples,
        "normals": read_tuples,
        "materials": materials.read_list,
        "gennormals": read_switch,
        "material": materials.read,
        "name": read_text,
    }
    what = str(block.name)
    fields = read_fields(source, block, readers, what)
    points = required(source, fields, "points", block, what).rows(3, "(x, y, z)")
    faces = _triangles(required(source, fields, "faces", block, what), points)
    normals: Any = _normals(source, fields.get("normals"), len(points))
    if fields.get("gennormals"):
        normals = smooth_normals(points, faces)
    return _Parts(
        vertices=points,
        faces=faces,
        normals=normals,
        vertex_materials=_vertex_materials(source, fields.get("materials"), len(points)),
        material=fields.get("material", default),
        name=fields.get("name", ""),
    )


def _triangles(faces: Tuples, points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Triangles of the polygons in `faces`, whose indices are checked here: (M, 3) int32."""
    small = np.flatnonzero(faces.counts < 3)
    if len(small):
        corners = counted(faces.counts[small[0]], "corner")
        raise faces.tuple_error(small[0], f"has {corners}: a face needs 3 or more")
    values = faces.values
    broken = np.flatnonzero(values != np.floor(values))
    if len(broken):
        value = values[broken[0]]
        raise faces.number_error(
            broken[0], f"has the corner {value:g}: give whole numbers, which count the points from 0"
        )
    outside = np.flatnonzero((values < 0) | (values >= len(points)))
    if len(outside):
        there = f"there are {len(points)} points (0 to {len(points) - 1})" if len(points) else "there are no points"
        raise faces.number_error(outside[0], f"names the point {values[outside[0]]:.0f}, but {there}")
    return triangulate(points, values.astype(np.int64), faces.counts)


def _normals(source: Source, normals: Tuples | None, count: int) -> NDArray[np.float64] | None:
    if normals is None:
        return None
    rows = normals.rows(3, "(x, y, z)")
    if len(rows) != count:
        message = f"{counted(len(rows), 'normal')} for {counted(count, 'point')}: give one each, or use gennormals"
        raise source.error(message, normals.start - 1)
    return rows


def _vertex_materials(
    source: Source, listed: tuple[tuple[Material, ...], int] | None, count: int
) -> tuple[Material, ...] | None:
    if listed is None:
        return None
    materials, offset = listed
    if len(materials) != count:
        message = f"{counted(len(materials), 'material')} for {counted(count, 'point')}: give one each, or use material"
        raise source.error(message, offset)
    return materials


def _with_uvs(parts: _Parts) -> _Parts:
    """The same mesh with three vertices for each triangle, so that each has its own uv."""
    corners = parts.faces.ravel()
    materials = parts.vertex_materials
    return evolve(
        parts,
        vertices=parts.vertices[corners],
        faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        normals=None if parts.normals is None else parts.normals[corners],
        vertex_materials=None if materials is None else tuple(materials[corner] for corner in corners),
        uvs=np.tile(_CORNER_UVS, (len(parts.faces), 1)),
    )
