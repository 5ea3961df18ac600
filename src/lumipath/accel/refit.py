"""Trees of meshes that deform: their shape stays, their boxes are fitted to where the primitives are now.

Refitting (van den Bergen 1997, "Efficient collision detection of complex deformable models using AABB trees") is done
in the trees that devices walk, which hold all that it takes: numbers of primitives in their leaves, and children behind
their parents. So one loop from the last node to the first one finds every box below before the one around it, those of
the targets of instances before that of the world.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..lang import aligned, compiled
from .bvh4 import INSTANCE_COUNT, TreeGPU, quantise, triangle_rows
from .bvh8 import BVH8, EMPTY, INSTANCE_LINK, PRIMITIVE_MASK, sorting_grid, write_group

WORST = 1.2
"""Trees are built anew when the cost of one has grown by more than this factor since (decision 0022)."""


class Moved(NamedTuple):
    """Where primitives are now.

    vertices: (V, 3) positions; faces: (T, 3) vertex numbers; two_sided and solid: (T,), as in `widen`.
    boxes: (P, 6) around all primitives, where they are stored: lower corner, upper corner.
    placed: (I, 6) around the instances.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    two_sided: NDArray[np.bool_]
    solid: NDArray[np.bool_]
    boxes: NDArray[np.float32]
    placed: NDArray[np.float32]


def moved(geometry: Any) -> Moved:
    """Where the primitives of a scene's geometry are."""
    instancing = geometry.instancing
    return Moved(
        geometry.vertices,
        geometry.faces,
        geometry.two_sided,
        geometry.solid(),
        np.concatenate(geometry.bounds(), axis=1),
        np.zeros((0, 6), np.float32) if instancing is None else instancing.boxes.reshape(-1, 6),
    )


def refit_cpu(tree: BVH8, now: Moved) -> BVH8:
    """The CPU's trees with new boxes and corners; the ones given stay as they are."""
    if not len(now.boxes):
        return tree
    nodes, groups = aligned(tree.nodes), aligned(tree.groups)
    _move_groups(groups, now.vertices, now.faces, now.two_sided, now.solid)
    root = _refit_8(nodes, groups, now.boxes, now.placed)
    return BVH8(nodes, groups, sorting_grid(root[:3], root[3:]))


def refit_gpu(tree: TreeGPU, now: Moved, *, wide: bool) -> TreeGPU:
    """The GPU's trees with new boxes and corners; the ones given stay as they are. `wide` as for `gpu_tree`."""
    if not len(now.boxes):
        return tree
    nodes, order = aligned(tree.nodes), tree.triangles.view(np.int32)[:, 3]
    _refit_4(nodes, order, now.boxes, now.placed, wide)
    return TreeGPU(nodes, aligned(triangle_rows(order, now.vertices, now.faces, now.two_sided, now.solid)))


def cpu_costs(tree: BVH8, roots: NDArray[np.int32]) -> NDArray[np.float64]:
    """Cost of each of the CPU's trees, that of the world first; `roots` of the others. See `_costs`."""
    # Axis, lower or upper, child.
    boxes = tree.nodes[:, :48].reshape(-1, 3, 2, 8)
    there = tree.nodes.view(np.int32)[:, 48:56] != EMPTY
    return _costs(boxes[:, :, 0], boxes[:, :, 1], there.astype(np.float64), roots)


def gpu_costs(tree: TreeGPU, roots: NDArray[np.int32], *, wide: bool) -> NDArray[np.float64]:
    """The same of the GPU's trees, `wide` as for `gpu_tree`, where boxes are those of 8 bits."""
    nodes = tree.nodes
    if wide:
        steps = nodes.view(np.uint8)[:, 24:48].reshape(-1, 3, 2, 4)
        boxes = nodes[:, :3, None, None] + nodes[:, 3:6, None, None] * steps
    else:
        sides = nodes[:, :8].reshape(-1, 2, 2, 2)
        boxes = np.concatenate([sides.transpose(0, 2, 3, 1), nodes[:, 8:12].reshape(-1, 1, 2, 2).swapaxes(2, 3)], 1)
    links = nodes.view(np.int32)[:, 12 : 16 if wide else 14]
    counts = np.where(~links & 15 == INSTANCE_COUNT, 1, ~links & 15)
    return _costs(boxes[:, :, 0], boxes[:, :, 1], np.where(links >= 0, 1.0, counts), roots)


def is_worn(costs: NDArray[np.float64], built: NDArray[np.float64]) -> bool:
    """Whether refitting has made any tree so much worse than it was when it was built that it had better be built anew.

    Args:
        costs: of the trees as they are.
        built: the same when they were built.
    """
    return bool((costs > WORST * built).any())


def _costs(
    lower: NDArray[np.float32], upper: NDArray[np.float32], weights: NDArray[np.float64], roots: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Cost of a random line that meets the box of each tree, by the surface area heuristic; 0 for a box without area.

    Args:
        lower: (N, 3, W) least corners of the boxes of each node's children.
        upper: (N, 3, W) greatest ones.
        weights: (N, W) the cost of going into a child that is hit; 0 where there is none.
        roots: of the trees of targets, which follow that of the world.
    """
    there = weights > 0
    low, high = (np.where(there[:, None], corner, 0).astype(np.float64) for corner in (lower, upper))
    sums = (_half_areas(high - low) * weights).sum(axis=1)
    starts = np.concatenate([[0], np.unique(roots)])
    at_roots = there[starts][:, None]
    least = np.where(at_roots, lower[starts], np.inf).min(axis=2)
    greatest = np.where(at_roots, upper[starts], -np.inf).max(axis=2)
    whole = _half_areas(greatest - least)
    return np.divide(np.add.reduceat(sums, starts), whole, out=np.zeros(len(starts)), where=whole > 0)


def _half_areas(extent: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the surface of boxes of these extents (N, 3, ...)."""
    x, y, z = extent[:, 0], extent[:, 1], extent[:, 2]
    return x * y + y * z + z * x


@compiled
def _move_groups(groups, vertices, faces, two_sided, solid):
    """Write the corners of the primitives in the leaves of the CPU's trees anew."""
    numbers = groups.view(np.int32)
    order = np.empty(8, np.int32)
    for group in range(len(groups)):
        count = 0
        for k in range(8):
            number = numbers[group, 72 + k]
            if number != EMPTY:
                order[count] = number & PRIMITIVE_MASK
                count += 1
        write_group(groups[group], numbers[group, 72:], order, 0, count, vertices, faces, two_sided, solid)


@compiled
def _clear(box):
    """Make a box (6,) empty."""
    for k in range(3):
        box[k] = np.float32(np.inf)
        box[3 + k] = np.float32(-np.inf)


@compiled
def _extend(box, other):
    """Extend a box (6,) by another one."""
    for k in range(3):
        box[k] = min(box[k], other[k])
        box[3 + k] = max(box[3 + k], other[3 + k])


@compiled
def _refit_8(nodes, groups, boxes, placed):
    """Fit the boxes in 8-wide nodes; returns the box (6,) of the world."""
    links = nodes.view(np.int32)
    numbers = groups.view(np.int32)
    around = np.empty((len(nodes), 6), np.float32)
    box = np.empty(6, np.float32)
    for node in range(len(nodes) - 1, -1, -1):
        _clear(around[node])
        for slot in range(8):
            link = links[node, 48 + slot]
            if link == EMPTY:
                continue
            _clear(box)
            if link >= 0:
                _extend(box, around[link])
            elif link <= INSTANCE_LINK:
                _extend(box, placed[INSTANCE_LINK - link])
            else:
                for k in range(8):
                    number = numbers[-2 - link, 72 + k]
                    if number != EMPTY:
                        _extend(box, boxes[number & PRIMITIVE_MASK])
            for axis in range(3):
                nodes[node, 16 * axis + slot] = box[axis]
                nodes[node, 16 * axis + 8 + slot] = box[3 + axis]
            _extend(around[node], box)
    return around[0]


@compiled
def _refit_4(nodes, order, boxes, placed, wide):
    """Fit the boxes in 4-wide or binary nodes; `order` has the primitives' numbers in the order of the leaves."""
    links = nodes.view(np.int32)
    words = nodes.view(np.uint32)
    around = np.empty((len(nodes), 6), np.float32)
    # The children's boxes, and behind them the node's own one.
    box = np.empty((5, 6), np.float32)
    children = np.arange(4).astype(np.int32)
    for node in range(len(nodes) - 1, -1, -1):
        found = 0
        for k in range(4 if wide else 2):
            link = links[node, 12 + k]
            first = ~link >> 4
            count = ~link & 15
            if link < 0 and count == 0:
                continue
            found = k + 1
            _clear(box[k])
            if link >= 0:
                _extend(box[k], around[link])
            elif count == INSTANCE_COUNT:
                _extend(box[k], placed[first])
            else:
                for i in range(first, first + count):
                    _extend(box[k], boxes[order[i]])
        _clear(around[node])
        for k in range(found):
            _extend(around[node], box[k])
        box[4] = around[node]
        if wide:
            quantise(box[:, :3], box[:, 3:], 4, children, found, nodes[node], words[node])
            continue
        for k in range(found):
            for axis in range(2):
                nodes[node, 4 * k + 2 * axis] = box[k, axis]
                nodes[node, 4 * k + 2 * axis + 1] = box[k, 3 + axis]
            nodes[node, 8 + 2 * k] = box[k, 2]
            nodes[node, 9 + 2 * k] = box[k, 5]
