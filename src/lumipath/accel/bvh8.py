"""The CPU's tree: 8-wide nodes and groups of up to 8 primitives, both as structures of arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..lang import aligned, compiled
from .build import BinaryTree
from .two_level import NO_INSTANCES, Trees

WIDTH = 8
CELLS = 4
"""Cells along each axis by which rays are sorted."""
NODE_SIZE = 64
GROUP_SIZE = 80
EMPTY = np.int32(-1)
TWO_SIDED = np.int32(1 << 30)
"""Set in a group's primitive number where the triangle is seen from behind; without it, it is not."""
PRIMITIVE_MASK = np.int32((1 << 30) - 1)
INSTANCE_LINK = np.int32(-(1 << 30))
"""Less this link by k: to instance k. Groups have links above it."""
LEAVE = np.int32(-(1 << 31))
"""No link in a tree, but one on the stack of a traversal: where an instance is left again."""


class BVH8(NamedTuple):
    """An 8-wide tree.

    nodes: (N, 64) float32: lower x of 8 children, upper x, lower y, upper y, lower z, upper z, then 8 links as bits and
        8 unused. A link is the number of a node, -1 for no child, -2 - g for the group g, or `INSTANCE_LINK` - k for
        instance k.
    groups: (G, 80) float32: for the 8 primitives of a leaf the x of the first corner, y, z, x of the second, ..., z of
        the third, then 8 primitive numbers as bits: -1 for none, `TWO_SIDED` set where it holds. A quadric has a
        triangle without area, which nothing hits.
    bounds: (8,) float32: the lower corner of everything and 0, then cells per metre along each axis and 0, where
        `CELLS` cells span everything.

    In scenes with instances the trees of the targets follow that of the world.
    """

    nodes: NDArray[Any]
    groups: NDArray[Any]
    bounds: NDArray[Any]


NO_TREE = BVH8(np.zeros((0, NODE_SIZE), np.float32), np.zeros((0, GROUP_SIZE), np.float32), np.zeros(8, np.float32))
"""Nothing but the types of a tree."""


@compiled
def _choose_children(tree_child, lower, upper, node, children):
    """Open the child of the largest area until there are eight; returns their number."""
    count = 1
    children[0] = node
    while count < 8:
        best = -1
        best_area = np.float32(-1.0)
        for k in range(count):
            c = children[k]
            if tree_child[c] >= 0:
                x = upper[c, 0] - lower[c, 0]
                y = upper[c, 1] - lower[c, 1]
                z = upper[c, 2] - lower[c, 2]
                area = x * y + y * z + z * x
                if area > best_area or best < 0:
                    best_area = area
                    best = k
        if best < 0:
            break
        left = tree_child[children[best]]
        children[best] = left
        children[count] = left + 1
        count += 1
    return count


@compiled
def _sort_by_octant(lower, upper, node, children, count, slots):
    """Give each child a slot whose bits say on which side of the node it lies (x: 4, y: 2, z: 1), best fits first.

    Then slot order, with the bits of the ray's direction flipped, is near to far (Ylitie et al. 2017, section 3.2).
    """
    taken = np.zeros(8, np.bool_)
    for k in range(8):
        slots[k] = -1
    for _ in range(count):
        best = np.inf
        best_child = -1
        best_slot = -1
        for k in range(count):
            if taken[k]:
                continue
            c = children[k]
            x = np.float64(lower[c, 0]) + upper[c, 0] - lower[node, 0] - upper[node, 0]
            y = np.float64(lower[c, 1]) + upper[c, 1] - lower[node, 1] - upper[node, 1]
            z = np.float64(lower[c, 2]) + upper[c, 2] - lower[node, 2] - upper[node, 2]
            for slot in range(8):
                if slots[slot] >= 0:
                    continue
                cost = (-x if slot & 4 else x) + (-y if slot & 2 else y) + (-z if slot & 1 else z)
                if cost < best or best_child < 0:
                    best = cost
                    best_child = k
                    best_slot = slot
        taken[best_child] = True
        slots[best_slot] = children[best_child]


@compiled
def write_group(group, numbers, order, first, count, vertices, faces, two_sided, solid):
    """Corners and numbers of a leaf's primitives; what is no triangle, or has no area, gets corners at 0."""
    for k in range(8):
        numbers[k] = EMPTY
    for k in range(72):
        group[k] = np.float32(0.0)
    for k in range(count):
        p = order[first + k]
        if p >= len(faces):
            numbers[k] = p | TWO_SIDED
            continue
        numbers[k] = p | TWO_SIDED if two_sided[p] else p
        if not solid[p]:
            continue
        for corner in range(3):
            for axis in range(3):
                group[24 * corner + 8 * axis + k] = vertices[faces[p, corner], axis]


@compiled
def _widen(lower, upper, child, first, count, order, vertices, faces, two_sided, solid, first_instance, nodes, groups):
    """Fill nodes and groups, depth first; returns how many of each."""
    links = nodes.view(np.int32)
    numbers = groups.view(np.int32)
    children = np.empty(8, np.int32)
    slots = np.empty(8, np.int32)
    source = np.empty(512, np.int32)
    target = np.empty(512, np.int32)
    source[0] = 0
    target[0] = 0
    waiting = 1
    node_count = 1
    group_count = 0
    while waiting > 0:
        waiting -= 1
        node = source[waiting]
        row = target[waiting]
        found = _choose_children(child, lower, upper, node, children)
        _sort_by_octant(lower, upper, node, children, found, slots)
        for slot in range(7, -1, -1):
            c = slots[slot]
            links[row, 48 + slot] = EMPTY
            links[row, 56 + slot] = EMPTY
            for axis in range(3):
                nodes[row, 16 * axis + slot] = lower[c, axis] if c >= 0 else np.float32(np.inf)
                nodes[row, 16 * axis + 8 + slot] = upper[c, axis] if c >= 0 else np.float32(-np.inf)
            if c < 0:
                continue
            if child[c] >= 0:
                links[row, 48 + slot] = node_count
                source[waiting] = c
                target[waiting] = node_count
                waiting += 1
                node_count += 1
            elif count[c] > 0 and order[first[c]] >= first_instance:
                links[row, 48 + slot] = INSTANCE_LINK - (order[first[c]] - first_instance)
            else:
                links[row, 48 + slot] = -2 - group_count
                write_group(
                    groups[group_count],
                    numbers[group_count, 72:],
                    order,
                    first[c],
                    count[c],
                    vertices,
                    faces,
                    two_sided,
                    solid,
                )
                group_count += 1
    return node_count, group_count


def widen(
    trees: Trees,
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    two_sided: NDArray[np.bool_],
    solid: NDArray[np.bool_],
) -> tuple[BVH8, list[int]]:
    """The 8-wide form of a scene's trees, and for each target the node that is the root of its tree.

    Args:
        trees: over all primitives, triangles first; their leaves hold at most 8.
        vertices: (V, 3) positions.
        faces: (T, 3) vertex numbers of the triangles; primitives from T on are quadrics.
        two_sided: (T,) whether a triangle is seen from behind.
        solid: (T,) whether a triangle has an area; without one it is never hit.
    """
    shapes = (vertices, faces, two_sided, solid)
    nodes, groups = _widened(trees.world, shapes, trees.first_instance)
    roots = []
    if trees.targets:
        parts = [(nodes, groups), *(_widened(tree, shapes, int(NO_INSTANCES)) for tree in trees.targets)]
        nodes, groups, roots = _concatenated(parts)
    return BVH8(aligned(nodes), aligned(groups), sorting_grid(trees.world.lower[0], trees.world.upper[0])), roots


def _widened(tree: BinaryTree, shapes: tuple[NDArray[Any], ...], first_instance: int) -> tuple[NDArray, NDArray]:
    """Nodes and groups of one tree."""
    size = len(tree.child) // 2 + 1
    nodes = np.empty((size, NODE_SIZE), np.float32)
    groups = np.empty((size, GROUP_SIZE), np.float32)
    node_count, group_count = _widen(*tree, *shapes, first_instance, nodes, groups)
    return nodes[:node_count], groups[:group_count]


def _concatenated(parts: list[tuple[NDArray, NDArray]]) -> tuple[NDArray, NDArray, list[int]]:
    """One array of nodes and one of groups, with links into them, and the first node of each part but the first."""
    firsts = np.cumsum([(0, 0), *((len(nodes), len(groups)) for nodes, groups in parts)], axis=0)
    for (nodes, _), (node, group) in zip(parts, firsts):
        links = nodes.view(np.int32)[:, 48:56]
        is_group = (links < EMPTY) & (links > INSTANCE_LINK)
        links += np.where(links >= 0, np.int32(node), np.where(is_group, np.int32(-group), np.int32(0)))
    nodes, groups = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    return nodes, groups, [int(node) for node in firsts[1:-1, 0]]


def sorting_grid(lower: NDArray[np.float32], upper: NDArray[np.float32]) -> NDArray[np.float32]:
    """`BVH8.bounds` of a scene in a box from `lower` to `upper`, (3,) each."""
    extent = np.maximum(upper.astype(np.float64) - lower, 1e-30)
    grid = np.zeros(8, np.float32)
    grid[:3] = lower
    grid[4:7] = np.minimum(CELLS / extent, 1e30)
    return aligned(grid)
