"""Shapes that stand at many places and are stored once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from ..errors import SceneError
from .bsdfs import AnyMaterial, checked_material
from .shapes import Cone, Mesh, Shape, Sphere, transform_mesh
from .values import affine


def _members(value: Any) -> tuple[Shape, ...]:
    if not isinstance(value, Iterable) or isinstance(value, (str, bytes)):
        raise SceneError(f"a group is made of a list of shapes, not of {_called(value)}")
    shapes = tuple(value)
    for index, shape in enumerate(shapes):
        if isinstance(shape, (Group, Instance)):
            raise SceneError(
                f"item {index} of a group is {_called(shape)}: groups do not nest; give its shapes at their places"
            )
        if not isinstance(shape, (Mesh, Sphere, Cone)):
            raise SceneError(f"item {index} of a group is {_called(shape)}; it must be a Mesh, Sphere or Cone")
    return shapes


def _called(value: Any) -> str:
    """The value as messages name it: `an Instance`."""
    kind = type(value).__name__
    return f"{'an' if kind[0] in 'AEIOaeio' else 'a'} {kind}"


@frozen(eq=False)
class Group:
    """Several shapes that are placed together by each `Instance` of them, such as trunk and leaves of a tree.

    Args:
        shapes: meshes, spheres and cones, in coordinates of their own.
        name: for messages.

    Raises:
        SceneError: something else is among them; groups and instances in groups are not possible.
    """

    shapes: tuple[Shape, ...] = field(converter=_members)
    name: str = field(default="", kw_only=True)


def _target(value: Any) -> Any:
    if isinstance(value, Instance):
        raise SceneError("an instance of an instance is not possible: make one of its shape, by both transforms")
    if isinstance(value, (Mesh, Sphere, Cone, Group)):
        return value
    if isinstance(value, (tuple, list)):
        return Group(value)
    raise SceneError(f"an instance is made of a Mesh, Sphere, Cone or Group, not of {_called(value)}")


def _identity() -> NDArray[np.float64]:
    return np.eye(4)


def _transform(value: Any) -> NDArray[np.float64]:
    return affine(value, "transform of an instance")


def _material(value: Any) -> AnyMaterial | None:
    return None if value is None else checked_material(value)


@frozen(eq=False)
class Instance:
    """A shape, or a group of shapes, at a place: all instances of one shape share what is stored of it.

    Args:
        shape: a mesh, sphere or cone, a `Group`, or a list of shapes, which becomes a group.
        transform: from the shape's coordinates to the world, 4 x 4; it may mirror, scale and shear.
        material: of everything in it, in place of what the shapes have, or None.
        name: for messages and layers.

    Raises:
        SceneError: a singular transform, or something that cannot be placed, such as another instance.
    """

    shape: Mesh | Sphere | Cone | Group = field(converter=_target)
    transform: NDArray[np.float64] = field(factory=_identity, converter=_transform, kw_only=True)
    material: AnyMaterial | None = field(default=None, converter=_material, kw_only=True)
    name: str = field(default="", kw_only=True)

    @property
    def parts(self) -> tuple[Shape, ...]:
        """The shapes that it places, as they are before that."""
        return self.shape.shapes if isinstance(self.shape, Group) else (self.shape,)

    def materials_of(self, part: Shape) -> tuple[AnyMaterial, ...]:
        """The materials that a part has here: one for all of it, or one a vertex."""
        return materials_of(part) if self.material is None else (self.material,)

    def copy(self, part: Shape) -> Shape:
        """A part as a shape of its own, in world space.

        Raises:
            SceneError: its coordinates are too large for a shape.
        """
        changes: dict[str, Any] = {} if self.material is None else {"material": self.material}
        if not isinstance(part, Mesh):
            return attrs.evolve(part, transform=self.transform @ part.transform, **changes)
        if changes:
            changes["vertex_materials"] = None
        vertices, faces, normals = transform_mesh(part.vertices, part.faces, self.transform, part.normals)
        return attrs.evolve(part, vertices=vertices, faces=faces, normals=normals, **changes)

    def copies(self) -> list[Shape]:
        """All parts as shapes of their own, in world space."""
        return [self.copy(part) for part in self.parts]


def materials_of(shape: Shape | Instance) -> tuple[AnyMaterial, ...]:
    """The materials of a shape: one for all of it, or one a vertex; those of an instance as it has them."""
    if isinstance(shape, Instance):
        return tuple(material for part in shape.parts for material in shape.materials_of(part))
    if isinstance(shape, Mesh) and shape.vertex_materials is not None:
        return shape.vertex_materials
    return (shape.material,)
