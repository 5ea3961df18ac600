"""Meshes that take other vertices: scenes stay as they are, new ones are made of them."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
from numpy.typing import ArrayLike

from ..errors import UsageError
from .instances import Group, Instance
from .scene import Scene
from .shapes import Mesh, Shape, smooth_normals
from .values import float_array


def deformed_meshes(
    scene: Scene,
    now: Mapping[Mesh, Mesh],
    vertices: Mapping[Mesh, ArrayLike],
    normals: Mapping[Mesh, ArrayLike] | None = None,
) -> dict[Mesh, Mesh]:
    """What the meshes of a scene are, `now` and then deformed: `now` with the meshes of `vertices` replaced.

    Args:
        scene: as it is at rest.
        now: what its meshes have become already.
        vertices: for each mesh, as it is at rest or as it is now, new positions (N, 3), metres.
        normals: for some of them, new shading normals (N, 3). A mesh that has normals and is given none gets those of
            its faces, averaged around each vertex.

    Raises:
        UsageError: something that is no mesh of the scene, or normals without vertices.
        SceneError: wrong shapes, or numbers that are not finite.
    """
    for name, value in (("vertices", vertices), ("normals", normals or {})):
        if not isinstance(value, Mapping):
            raise UsageError(
                f"{name} must be a dictionary of meshes, as {{mesh: positions}}, not {type(value).__name__}"
            )
    given = dict(normals or {})
    at_rest = {part: part for part in scene.parts() if isinstance(part, Mesh)}
    at_rest |= {mesh: rest for rest, mesh in now.items()}
    made = dict(now)
    for mesh, positions in vertices.items():
        _require_known(mesh, at_rest)
        made[at_rest[mesh]] = _moved(mesh, positions, given.pop(mesh, None))
    for mesh in given:
        _require_known(mesh, at_rest)
        raise UsageError(f"{_called(mesh)} is given normals, but no vertices; give both")
    return made


def with_meshes(scene: Scene, meshes: Mapping[Mesh, Mesh]) -> Scene:
    """The scene with some of its meshes replaced, wherever they stand: alone, in groups, in instances."""
    groups: dict[Group, Group] = {}

    def replaced(shape: Shape | Group) -> Shape | Group:
        if isinstance(shape, Mesh):
            return meshes.get(shape, shape)
        if isinstance(shape, Group) and not meshes.keys().isdisjoint(shape.shapes):
            # One group stays one, so that its instances go on sharing it.
            if shape not in groups:
                groups[shape] = attrs.evolve(shape, shapes=[replaced(part) for part in shape.shapes])
            return groups[shape]
        return shape

    shapes: list[Shape | Instance] = []
    for shape in scene.shapes:
        if isinstance(shape, Instance):
            target = replaced(shape.shape)
            shapes.append(shape if target is shape.shape else attrs.evolve(shape, shape=target))
        else:
            shapes.append(replaced(shape))  # type: ignore[arg-type]
    return attrs.evolve(scene, shapes=shapes)


def _require_known(mesh: object, known: Mapping[Mesh, Mesh]) -> None:
    if not isinstance(mesh, Mesh):
        raise UsageError(f"deform takes meshes, not a {type(mesh).__name__}; move other shapes by their transforms")
    if mesh not in known:
        raise UsageError(f"{_called(mesh)} is not in the scene; name one of its meshes, or a mesh of its instances")


def _moved(mesh: Mesh, vertices: ArrayLike, normals: ArrayLike | None) -> Mesh:
    """A mesh with as many other vertices."""
    positions = float_array(vertices, (len(mesh.vertices), 3), f"{_called(mesh)}: vertices")
    if normals is None and mesh.normals is not None:
        normals = smooth_normals(positions, mesh.faces)
    return attrs.evolve(mesh, vertices=positions, normals=normals)


def _called(mesh: Mesh) -> str:
    """The mesh as messages name it."""
    return f"mesh {mesh.name!r}" if mesh.name else "a mesh"
