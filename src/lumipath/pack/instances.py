"""What of a scene is stored, and where it stands: shapes of their own, and shapes that are placed many times.

Emissive parts of instances become shapes of their own, since lights are drawn from a table in world space. So do
instances of what stands at one place only: walking a tree within a tree would cost time and save no memory.
"""

from __future__ import annotations

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from ..scene import Instance, Mesh, Scene, Shape
from . import layout
from .materials import MaterialTable

Floats = NDArray[np.float64]

# Along each axis: a target is bounded by the boxes around what is in the cells of such a grid.
_CELLS = 8
# Boxes that are moved at a time.
_CHUNK = 1 << 18


@frozen(eq=False)
class Piece:
    """A shape of its own: `part` of the scene's shape of that number, which is an instance or the part itself."""

    number: int
    part: Shape
    instance: Instance | None = None

    def shape(self) -> Shape:
        """The part in world space."""
        return self.part if self.instance is None else self.instance.copy(self.part)


@frozen(eq=False)
class Place:
    """Where a target stands: by which instance, the scene's shape of that number."""

    number: int
    instance: Instance


@frozen(eq=False)
class Target:
    """Shapes that are stored once and placed together, in coordinates of their own."""

    parts: tuple[Shape, ...]
    places: list[Place] = field(factory=list)


@frozen(eq=False)
class Arrangement:
    """All that is stored of a scene."""

    pieces: list[Piece]
    targets: list[Target]


def arrange(scene: Scene) -> Arrangement:
    """Decide what is stored once and placed often, and what stands alone; shapes without a face are left out."""
    pieces: list[Piece] = []
    targets: dict[tuple[int, ...], Target] = {}
    for number, shape in enumerate(scene.shapes):
        if not isinstance(shape, Instance):
            pieces.append(Piece(number, shape))
            continue
        placed = []
        for part in shape.parts:
            if any(material.is_emissive for material in shape.materials_of(part)):
                pieces.append(Piece(number, part, shape))
            elif not isinstance(part, Mesh) or len(part.faces):
                placed.append(part)
        if placed:
            # Of equal parts, whether or not their groups are one object.
            target = targets.setdefault(tuple(map(id, placed)), Target(tuple(placed)))
            target.places.append(Place(number, shape))
    shared = []
    for target in targets.values():
        if len(target.places) > 1:
            shared.append(target)
        else:
            place = target.places[0]
            pieces += [Piece(place.number, part, place.instance) for part in target.parts]
    return Arrangement([piece for piece in pieces if not isinstance(piece.part, Mesh) or len(piece.part.faces)], shared)


@frozen(eq=False)
class Instancing:
    """The instances of a scene, and the primitives that they place.

    Args:
        alone: numbers of the primitives that stand alone, int32; all others belong to a target.
        members: for each target the numbers of its primitives, int32.
        targets: (I,) int32: which target an instance places.
        rows: (I, 20) float32: the records of the instances, see `layout`.
        boxes: (I, 2, 3) float32: boxes around the instances, world space.
    """

    alone: NDArray[np.int32]
    members: list[NDArray[np.int32]]
    targets: NDArray[np.int32]
    rows: NDArray[np.float32]
    boxes: NDArray[np.float32]


def instance_rows(places: list[Place], table: MaterialTable) -> NDArray[np.float32]:
    """(I, 20) float32: the records of instances, but for the links to trees, which each device has for itself."""
    rows = np.zeros((len(places), int(layout.INSTANCE_SIZE)), np.float32)
    if not places:
        return rows
    words = rows.view(np.int32)
    transforms = np.array([place.instance.transform for place in places])
    inverses = np.linalg.inv(transforms)
    rows[:, :12] = inverses[:, :3].reshape(-1, 12)
    materials = [place.instance.material for place in places]
    words[:, layout.INSTANCE_MATERIAL] = [-1 if one is None else table.number(one) for one in materials]
    words[:, layout.INSTANCE_SHAPE] = [place.number for place in places]
    linear = np.abs(transforms[:, :3, :3])
    rows[:, layout.INSTANCE_SCALE] = linear.sum(axis=2).max(axis=1)
    rows[:, layout.INSTANCE_SHIFT] = np.abs(transforms[:, :3, 3]).max(axis=1)
    # Skeel's condition number: by how much more than its own coordinates a point's rounding may move it on the way to
    # the instance and back (Higham 2002, Accuracy and Stability of Numerical Algorithms, section 7.2).
    rows[:, layout.INSTANCE_SPREAD] = (linear @ np.abs(inverses[:, :3, :3])).sum(axis=2).max(axis=1)
    return rows


def cluster_boxes(points: NDArray[np.float32]) -> Floats:
    """(B, 2, 3): boxes that together contain all points (N, 3), one for each filled cell of a grid."""
    lower = points.min(axis=0).astype(np.float64)
    extent = np.maximum(points.max(axis=0) - lower, 1e-30)
    cells = np.minimum(((points - lower) / extent * _CELLS).astype(np.int32), _CELLS - 1) @ (1, _CELLS, _CELLS**2)
    order = np.argsort(cells, kind="stable")
    starts = np.flatnonzero(np.diff(cells[order], prepend=-1))
    sorted_points = points[order]
    boxes = [reduction.reduceat(sorted_points, starts) for reduction in (np.minimum, np.maximum)]
    return np.stack(boxes, axis=1).astype(np.float64)


def placed_boxes(boxes: Floats, places: list[Place]) -> NDArray[np.float32]:
    """(I, 2, 3): the box around `boxes` (B, 2, 3) at each place, rounded outwards."""
    centre, half = boxes.mean(axis=1), (boxes[:, 1] - boxes[:, 0]) / 2
    placed = np.empty((len(places), 2, 3), np.float32)
    step = max(1, _CHUNK // len(boxes))
    for first in range(0, len(places), step):
        transforms = np.array([place.instance.transform for place in places[first : first + step]])
        linear = transforms[:, :3, :3]
        middle = centre @ linear.transpose(0, 2, 1) + transforms[:, None, :3, 3]
        reach = half @ np.abs(linear).transpose(0, 2, 1)
        lower, upper = (middle - reach).min(axis=1), (middle + reach).max(axis=1)
        # Rays find what is in the box in coordinates of its own, with roundings of their own.
        slack = 1e-6 * (np.abs(lower) + np.abs(upper) + (upper - lower))
        placed[first : first + step, 0] = lower - slack
        placed[first : first + step, 1] = upper + slack
    return placed
