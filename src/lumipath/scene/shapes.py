"""Geometry: triangle meshes and exact quadrics, each with its material."""

from __future__ import annotations

from typing import Any

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from ..errors import SceneError
from .bsdfs import AnyMaterial, checked_material
from .material import Material
from .values import Floats, Ints, affine, float_array, index_array


def _given(value: Any) -> Any:
    """Whatever is given: shape and numbers are checked when all fields are known."""
    return value


@frozen(eq=False, kw_only=True)
class Mesh:
    """Triangles in world space.

    Args:
        vertices: (N, 3) float32 positions, metres.
        faces: (M, 3) int32 vertex indices, counter-clockwise seen from the front.
        normals: (N, 3) shading normals, normalised here, or None for flat faces.
        uvs: (N, 2) texture coordinates, or None.
        colours: (N, 3) linear colours that the material's own colour is multiplied by, or (N, 4) with an alpha that its
            opacity is multiplied by, each from 0 to 1; or None.
        material: of all faces, unless `vertex_materials` is given.
        vertex_materials: N materials, blended across each face by barycentric coordinates, or None.
        two_sided: whether faces are seen from behind; else from there they do not exist for any ray.
        name: for messages.

    Raises:
        SceneError: wrong shapes, indices out of range, numbers that are not finite.
    """

    vertices: Floats = field(converter=_given)
    faces: Ints = field(converter=_given)
    normals: Floats | None = field(default=None, converter=_given)
    uvs: Floats | None = field(default=None, converter=_given)
    colours: Floats | None = field(default=None, converter=_given)
    material: AnyMaterial = field(factory=Material, converter=checked_material)
    vertex_materials: tuple[Material, ...] | None = None
    two_sided: bool = True
    name: str = ""

    def __attrs_post_init__(self) -> None:
        where = f"mesh {self.name!r}" if self.name else "mesh"
        vertices = float_array(self.vertices, (None, 3), f"{where}: vertices")
        count = len(vertices)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", index_array(self.faces, 3, count, f"{where}: faces"))
        if self.normals is not None:
            normals = float_array(self.normals, (count, 3), f"{where}: normals").astype(np.float64)
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            unit = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
            object.__setattr__(self, "normals", unit.astype(np.float32))
        if self.uvs is not None:
            object.__setattr__(self, "uvs", float_array(self.uvs, (count, 2), f"{where}: uvs", limit=1e6))
        if self.colours is not None:
            object.__setattr__(self, "colours", _vertex_colours(self.colours, count, f"{where}: colours"))
        if self.vertex_materials is not None and len(self.vertex_materials) != count:
            raise SceneError(f"{where}: {len(self.vertex_materials)} materials for {count} vertices; give one each")
        if not all(isinstance(material, Material) for material in self.vertex_materials or ()):
            raise SceneError(f"{where}: only materials of the class Material can be blended between vertices")


def _vertex_colours(value: Any, count: int, name: str) -> Floats:
    """(N, 3) or (N, 4) float32, each from 0 to 1."""
    columns = 4 if np.ndim(value) == 2 and np.shape(value)[1] == 4 else 3
    colours = float_array(value, (count, columns), name)
    if (colours < 0).any() or (colours > 1).any():
        raise SceneError(f"{name} must be from 0 to 1")
    return colours


def smooth_normals(vertices: Floats, faces: Ints) -> Floats:
    """Vertex normals averaged from the faces around each vertex, weighted by their area; (N, 3) float32, unit or 0."""
    corners = vertices.astype(np.float64)[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros((len(vertices), 3))
    for axis in range(3):
        for corner in range(3):
            sums[:, axis] += np.bincount(faces[:, corner], face_normals[:, axis], len(vertices))
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0).astype(np.float32)


def _identity() -> NDArray[np.float64]:
    return np.eye(4)


def _transform(value: Any) -> NDArray[np.float64]:
    return affine(value, "transform")


@frozen(eq=False, kw_only=True)
class Sphere:
    """The sphere x^2 + y^2 + z^2 = 1 under an affine transform (object to world, 4 x 4), so also any ellipsoid."""

    transform: NDArray[np.float64] = field(factory=_identity, converter=_transform)
    material: AnyMaterial = field(factory=Material, converter=checked_material)
    name: str = ""


@frozen(eq=False, kw_only=True)
class Cone:
    """A cone or truncated cone about z, from z = 0 to `height`, under an affine transform (object to world, 4 x 4).

    Args:
        bottom_radius: radius at z = 0, metres before the transform.
        top_radius: radius at z = `height`; equal radii make a cylinder.
        height: extent along z, more than 0.
        capped: whether the ends are closed by discs.
    """

    bottom_radius: float = 1.0
    top_radius: float = 0.0
    height: float = 1.0
    capped: bool = True
    transform: NDArray[np.float64] = field(factory=_identity, converter=_transform)
    material: AnyMaterial = field(factory=Material, converter=checked_material)
    name: str = ""

    def __attrs_post_init__(self) -> None:
        where = f"cone {self.name!r}" if self.name else "cone"
        limits = (("bottom_radius", 0.0), ("top_radius", 0.0), ("height", 1e-12))
        for name, low in limits:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= 1e12:
                raise SceneError(f"{where}: {name} is {value!r}: it must be a number from {low:g} to 1e12")
        if self.bottom_radius == 0 and self.top_radius == 0:
            raise SceneError(f"{where}: both radii are 0; give at least one of them")


def Cylinder(  # noqa: N802 - a shape like the others, though a special case of Cone
    *, transform: Any = None, material: AnyMaterial | None = None, capped: bool = True, name: str = ""
) -> Cone:
    """The cylinder of radius 1 about z, from z = 0 to 1, under an affine transform."""
    return Cone(
        top_radius=1.0,
        capped=capped,
        transform=np.eye(4) if transform is None else transform,
        material=material or Material(),
        name=name,
    )


_BOX_CORNERS = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
# Each side as a quad, counter-clockwise seen from outside: -z +z -y +y -x +x.
_BOX_SIDES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
_QUAD_UVS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def transform_mesh(vertices: Any, faces: Any, transform: Any, normals: Any = None) -> tuple[Any, Any, Any]:
    """Mesh arrays under an affine transform; a mirroring one turns the faces over, so that fronts stay fronts."""
    matrix = affine(transform, "transform")
    moved = np.asarray(vertices, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = np.asarray(faces, np.int32)
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    if normals is not None:
        normals = np.asarray(normals, np.float64) @ np.linalg.inv(matrix[:3, :3])
    return moved, np.ascontiguousarray(faces), normals


def Box(*, transform: Any = None, material: AnyMaterial | None = None, name: str = "") -> Mesh:  # noqa: N802
    """The box from -0.5 to 0.5 on each axis under an affine transform, as 12 triangles; uv spans each side."""
    corners = _BOX_CORNERS[np.array(_BOX_SIDES).reshape(-1)]
    faces = [(4 * side, 4 * side + a, 4 * side + a + 1) for side in range(6) for a in (1, 2)]
    vertices, indices, _ = transform_mesh(corners, faces, np.eye(4) if transform is None else transform)
    return Mesh(
        vertices=vertices, faces=indices, uvs=np.array(_QUAD_UVS * 6), material=material or Material(), name=name
    )


def Square(*, transform: Any = None, material: AnyMaterial | None = None, name: str = "") -> Mesh:  # noqa: N802
    """The square from -0.5 to 0.5 in x and y, facing +z, under an affine transform; seen from both sides."""
    corners = np.array([(-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0)])
    vertices, indices, _ = transform_mesh(
        corners, [(0, 1, 2), (0, 2, 3)], np.eye(4) if transform is None else transform
    )
    return Mesh(vertices=vertices, faces=indices, uvs=np.array(_QUAD_UVS), material=material or Material(), name=name)


Shape = Mesh | Sphere | Cone
