"""The GPU's trees: binary nodes for small scenes, 4-wide nodes with 8-bit boxes for large ones, triangles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..lang import aligned, compiled
from .build import BinaryTree
from .two_level import NO_INSTANCES, Trees

MAX_LEAF = 4
INSTANCE_COUNT = np.int32(15)
"""In place of the number of triangles in a link: `first` is an instance."""
LEAVE_COUNT = np.int32(14)
"""In place of the number of triangles in a link on the stack of a traversal: an instance is left again."""
WORLD_RAY = 7
"""Entries of that stack for the ray outside of an instance, and the link to leave it by."""


class TreeGPU(NamedTuple):
    """A tree and its triangles.

    nodes: (N, 16) float32.
        Binary: lower x, upper x, lower y, upper y of the left child, the same of the right one, lower z, upper z of the
        left, of the right, two links as bits, 2 unused.
        4-wide (WIDE_TREE): origin xyz, step x, step y, step z, then words of four bytes, one for each child: lower x,
        upper x, lower y, upper y, lower z, upper z; then four links as bits.
        A link is the number of a node, ~(first * 16 + count) for the triangles of a leaf, or ~(k * 16 + 15) for
        instance k.
    triangles: (T, 12) float32: three corners; behind the first its primitive number as bits, behind the second 1 if it
        is seen from both sides. A quadric has its number and 2 there.

    In scenes with instances the trees of the targets follow that of the world.
    """

    nodes: NDArray[Any]
    triangles: NDArray[Any]


NO_TREE = TreeGPU(np.zeros((0, 16), np.float32), np.zeros((0, 12), np.float32))
"""Nothing but the types of a tree."""


@compiled
def _leaf_link(first, count):
    """Link to a leaf."""
    return np.int32(~((first << 4) | count))


@compiled
def _link_to(first, count, order, first_instance):
    """Link to a leaf, or to the instance that is all of it."""
    if count > 0 and order[first] >= first_instance:
        return _leaf_link(order[first] - first_instance, INSTANCE_COUNT)
    return _leaf_link(first, count)


@compiled
def _binary_nodes(lower, upper, child, first, count, order, first_instance, nodes):
    """Fill binary nodes, depth first; returns how many and how deep a stack traversal needs."""
    links = nodes.view(np.int32)
    source = np.empty(160, np.int32)
    target = np.empty(160, np.int32)
    level = np.empty(160, np.int32)
    source[0] = 0
    target[0] = 0
    level[0] = 1
    waiting = 1
    made = 1
    deepest = 1
    while waiting > 0:
        waiting -= 1
        node = source[waiting]
        row = target[waiting]
        depth = level[waiting]
        deepest = max(deepest, depth)
        for side in range(2):
            c = child[node] + side
            nodes[row, 4 * side] = lower[c, 0]
            nodes[row, 4 * side + 1] = upper[c, 0]
            nodes[row, 4 * side + 2] = lower[c, 1]
            nodes[row, 4 * side + 3] = upper[c, 1]
            nodes[row, 8 + 2 * side] = lower[c, 2]
            nodes[row, 9 + 2 * side] = upper[c, 2]
            if child[c] >= 0:
                links[row, 12 + side] = made
                source[waiting] = c
                target[waiting] = made
                level[waiting] = depth + 1
                waiting += 1
                made += 1
            else:
                links[row, 12 + side] = _link_to(first[c], count[c], order, first_instance)
    return made, deepest


@compiled
def quantise(lower, upper, node, children, found, row, words):
    """Write the boxes of a node's children as bytes on a grid over the node, rounded outwards."""
    for axis in range(3):
        extent = np.float64(upper[node, axis]) - lower[node, axis]
        step = np.float32(max(extent * 1.0001 / 254.0, 1e-30, abs(np.float64(lower[node, axis])) * 2e-7))
        origin = np.float32(lower[node, axis] - np.float32(0.5) * step)
        row[axis] = origin
        row[3 + axis] = step
        low = np.uint32(0)
        high = np.uint32(0)
        for k in range(4):
            a = np.uint32(255)
            b = np.uint32(0)
            if k < found:
                c = children[k]
                a = np.uint32(max(0.0, np.floor((np.float64(lower[c, axis]) - origin) / step - 0.01)))
                b = np.uint32(min(255.0, np.ceil((np.float64(upper[c, axis]) - origin) / step + 0.01)))
            low |= np.uint32(a << np.uint32(8 * k))
            high |= np.uint32(b << np.uint32(8 * k))
        words[6 + 2 * axis] = low
        words[7 + 2 * axis] = high


@compiled
def _wide_nodes(lower, upper, child, first, count, order, first_instance, nodes):
    """Fill 4-wide nodes, depth first; returns how many and how deep a stack traversal needs."""
    links = nodes.view(np.int32)
    words = nodes.view(np.uint32)
    children = np.empty(4, np.int32)
    source = np.empty(260, np.int32)
    target = np.empty(260, np.int32)
    level = np.empty(260, np.int32)
    source[0] = 0
    target[0] = 0
    level[0] = 0
    waiting = 1
    made = 1
    deepest = 0
    while waiting > 0:
        waiting -= 1
        node = source[waiting]
        row = target[waiting]
        # Open the child of the largest area until there are four.
        found = 1
        children[0] = node
        while found < 4:
            best = -1
            best_area = np.float32(-1.0)
            for k in range(found):
                c = children[k]
                if child[c] >= 0:
                    x = upper[c, 0] - lower[c, 0]
                    y = upper[c, 1] - lower[c, 1]
                    z = upper[c, 2] - lower[c, 2]
                    area = x * y + y * z + z * x
                    if area > best_area or best < 0:
                        best_area = area
                        best = k
            if best < 0:
                break
            left = child[children[best]]
            children[best] = left
            children[found] = left + 1
            found += 1
        quantise(lower, upper, node, children, found, nodes[row], words[row])
        depth = level[waiting] + found - 1
        deepest = max(deepest, depth)
        for k in range(4):
            links[row, 12 + k] = _leaf_link(0, 0)
            if k >= found:
                continue
            c = children[k]
            if child[c] >= 0:
                links[row, 12 + k] = made
                source[waiting] = c
                target[waiting] = made
                level[waiting] = depth
                waiting += 1
                made += 1
            else:
                links[row, 12 + k] = _link_to(first[c], count[c], order, first_instance)
    return made, deepest


def triangle_rows(
    order: NDArray[np.int32],
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    two_sided: NDArray[np.bool_],
    solid: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """The records of all primitives, in the order of the leaves; what has no area gets corners at 0."""
    rows = np.zeros((len(order), 12), np.float32)
    is_triangle = order < len(faces)
    numbers = order[is_triangle]
    for corner in range(3):
        rows[is_triangle, 4 * corner : 4 * corner + 3] = vertices[faces[numbers, corner]] * solid[numbers, None]
    rows.view(np.int32)[:, 3] = order
    rows[is_triangle, 7] = two_sided[numbers]
    rows[~is_triangle, 7] = 2.0
    return rows


def gpu_tree(
    trees: Trees,
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    two_sided: NDArray[np.bool_],
    solid: NDArray[np.bool_],
    *,
    wide: bool,
) -> tuple[TreeGPU, list[int], int]:
    """The GPU's form of a scene's trees.

    Args:
        trees: over all primitives, triangles first; their leaves hold at most 13.
        vertices: (V, 3) positions.
        faces: (T, 3) vertex numbers; primitives from T on are quadrics.
        two_sided: (T,) whether a triangle is seen from behind.
        solid: (T,) whether a triangle has an area; without one it is never hit.
        wide: 4-wide with 8-bit boxes instead of binary.

    Returns:
        The trees, for each target the node that is the root of its tree, and the number of links that a traversal may
        have to remember.
    """
    nodes, deepest = _nodes(trees.world, trees.first_instance, wide)
    orders = [tree.order for tree in (trees.world, *trees.targets)]
    roots = []
    if trees.targets:
        below = [_nodes(tree, int(NO_INSTANCES), wide) for tree in trees.targets]
        nodes, roots = _concatenated([nodes, *(part for part, _ in below)], orders)
        deepest += WORLD_RAY + max(depth for _, depth in below)
    rows = triangle_rows(np.concatenate(orders), vertices, faces, two_sided, solid)
    return TreeGPU(aligned(nodes), aligned(rows)), roots, deepest


def _nodes(tree: BinaryTree, first_instance: int, wide: bool) -> tuple[NDArray[np.float32], int]:
    """The nodes of one tree, and how many links its traversal may have to remember."""
    nodes = np.zeros((max(1, len(tree.child) // 2 + 1), 16), np.float32)
    if tree.child[0] < 0:
        # A single leaf becomes the only child of a root.
        _single_leaf(tree, nodes, wide, first_instance)
        return nodes[:1], 4
    fill = _wide_nodes if wide else _binary_nodes
    made, deepest = fill(*tree[:5], tree.order, first_instance, nodes)
    return nodes[:made], int(deepest)


def _concatenated(
    parts: list[NDArray[np.float32]], orders: list[NDArray[np.int32]]
) -> tuple[NDArray[np.float32], list[int]]:
    """One array of nodes with links into it and into one of all triangles, and the first node of all but the first."""
    nodes = np.cumsum([0, *map(len, parts)])
    triangles = np.cumsum([0, *map(len, orders)])
    for part, node, triangle in zip(parts, nodes, triangles):
        links = part.view(np.int32)[:, 12:16]
        is_leaf = (links < 0) & (~links & 15 != INSTANCE_COUNT)
        links += np.where(links >= 0, np.int32(node), np.where(is_leaf, np.int32(-16 * triangle), np.int32(0)))
    return np.concatenate(parts), [int(node) for node in nodes[1:-1]]


def _single_leaf(tree: BinaryTree, nodes: NDArray[np.float32], wide: bool, first_instance: int) -> None:
    leaf = np.int32(_link_to(int(tree.first[0]), int(tree.count[0]), tree.order, first_instance))
    links = nodes.view(np.int32)
    if wide:
        quantise(tree.lower, tree.upper, 0, np.zeros(4, np.int32), 1, nodes[0], nodes.view(np.uint32)[0])
        links[0, 12:16] = leaf, -1, -1, -1
        return
    (x0, y0, z0), (x1, y1, z1) = tree.lower[0], tree.upper[0]
    nodes[0, :4] = x0, x1, y0, y1
    nodes[0, 4:8] = np.inf, -np.inf, np.inf, -np.inf
    nodes[0, 8:12] = z0, z1, np.inf, -np.inf
    links[0, 12:14] = leaf, -1
