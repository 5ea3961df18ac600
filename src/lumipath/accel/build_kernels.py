"""The compiled loops of the tree builder in `build.py`: boxes into bins, bins into a split, a whole sub-tree.

A box is six numbers here, (lower, -upper), so that the union of two boxes is six minima and nothing else. Twice its
centre is then `box[k] - box[k + 3]`. A node's `ranges` are twelve numbers: the union of its boxes, then the extent of
their doubled centres in the same form.

Primitives lie in the order of the nodes: each split copies a node's rows from one of two arrays to the other, left half
first, so that every pass streams through memory and nothing is gathered. The array that holds a node is its `side`.

Nothing but minima, counts and stable copies depends on how a node's rows are cut into chunks, and these do not depend
on it at all, so any number of threads makes the same tree. Boxes are float32; areas and costs are float64, because
coordinates of 1e18 have float32 areas near the greatest number and those of 1e-18 near zero.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..lang import compiled

MAX_DEPTH = 64
"""Levels of the deepest tree, the root's included: traversal stacks have a fixed size."""

MIN_BINS, MAX_BINS = 16, 256
"""Bins an axis. Large nodes get many: next to their primitives these are free, and they isolate walls in scenes."""

LIMIT = np.float32(1e29)
"""Coordinates must be smaller in magnitude."""

EMPTY = np.float32(1e30)
"""Each number of an empty box: greater than any coordinate or doubled centre, so a union with it changes nothing."""

_FLAT = np.float32(1e-30)
_BELOW_ONE = np.float32(0.99999)


class Rows(NamedTuple):
    """The primitives in two places; a node's rows are valid on the side that the node names."""

    boxes: NDArray[np.float32]
    """(2, p, 6): lower, -upper."""
    ids: NDArray[np.int32]
    """(2, p): numbers of the primitives."""


class Rules(NamedTuple):
    """What leaves may hold and what the tree costs; see `build_tree`."""

    max_leaf: int
    block: int
    traversal_cost: float


class Nodes(NamedTuple):
    """Node arrays of a sub-tree; the fields are those of `BinaryTree`."""

    lower: NDArray[np.float32]
    upper: NDArray[np.float32]
    child: NDArray[np.int32]
    first: NDArray[np.int32]
    count: NDArray[np.int32]


@compiled
def load(lower, upper, start, stop, rows):
    """Copy the primitives `start : stop` to side 0; False if one of their boxes is not finite or inside out."""
    boxes, ids = rows.boxes, rows.ids
    valid = True
    for i in range(start, stop):
        ids[0, i] = i
        for k in range(3):
            low, high = lower[i, k], upper[i, k]
            valid = valid & (low > -LIMIT) & (low <= high) & (high < LIMIT)
            # Adding to zero and subtracting from it turn -0 into 0: of these two a minimum may be either.
            boxes[0, i, k] = low + np.float32(0)
            boxes[0, i, k + 3] = np.float32(0) - high
    return valid


@compiled
def measure(boxes, side, start, stop, ranges):
    """Write the `ranges` (12,) of the rows `start : stop`."""
    for k in range(12):
        ranges[k] = EMPTY
    for i in range(start, stop):
        for k in range(3):
            low, high = boxes[side, i, k], boxes[side, i, k + 3]
            ranges[k] = min(ranges[k], low)
            ranges[k + 3] = min(ranges[k + 3], high)
            ranges[k + 6] = min(ranges[k + 6], low - high)
            ranges[k + 9] = min(ranges[k + 9], high - low)


@compiled
def place_bins(ranges, count, frame):
    """Lay bins over the centres of a node of `count` primitives; returns their number on each axis.

    Writes `frame` (2, 3): on each axis the first bin's beginning and the bins in a unit of length, 0 if all centres are
    equal there.
    """
    bins = min(MAX_BINS, max(MIN_BINS, count >> 3))
    for k in range(3):
        extent = -(ranges[k + 6] + ranges[k + 9])
        frame[0, k] = ranges[k + 6]
        # Slightly fewer than `bins`, so that the last centre falls into the last bin whatever the rounding.
        frame[1, k] = np.float32(bins) * _BELOW_ONE / extent if extent > _FLAT else np.float32(0)
    return bins


@compiled
def fill_bins(boxes, side, start, stop, frame, bins, unions, counts):
    """Put the rows `start : stop` into bins by their centres, on all three axes.

    Writes `unions` (3, bins, 6), the union of the boxes in each bin, and `counts` (3, bins).
    """
    for axis in range(3):
        for b in range(bins):
            counts[axis, b] = 0
            for k in range(6):
                unions[axis, b, k] = EMPTY
    for i in range(start, stop):
        # All six numbers are read first: the compiler cannot know that bins and boxes do not overlap.
        x, y, z = boxes[side, i, 0], boxes[side, i, 1], boxes[side, i, 2]
        u, v, w = boxes[side, i, 3], boxes[side, i, 4], boxes[side, i, 5]
        for axis in range(3):
            b = int((boxes[side, i, axis] - boxes[side, i, axis + 3] - frame[0, axis]) * frame[1, axis])
            counts[axis, b] += 1
            unions[axis, b, 0] = min(unions[axis, b, 0], x)
            unions[axis, b, 1] = min(unions[axis, b, 1], y)
            unions[axis, b, 2] = min(unions[axis, b, 2], z)
            unions[axis, b, 3] = min(unions[axis, b, 3], u)
            unions[axis, b, 4] = min(unions[axis, b, 4], v)
            unions[axis, b, 5] = min(unions[axis, b, 5], w)


@compiled
def union(box, unions, axis, b):
    """The union of `box`, a tuple of six, and the boxes in one bin."""
    return (
        min(box[0], unions[axis, b, 0]),
        min(box[1], unions[axis, b, 1]),
        min(box[2], unions[axis, b, 2]),
        min(box[3], unions[axis, b, 3]),
        min(box[4], unions[axis, b, 4]),
        min(box[5], unions[axis, b, 5]),
    )


@compiled
def half_area(box):
    """Half the surface of a box of six numbers, float64."""
    x = -(np.float64(box[0]) + np.float64(box[3]))
    y = -(np.float64(box[1]) + np.float64(box[4]))
    z = -(np.float64(box[2]) + np.float64(box[5]))
    return x * y + y * z + z * x


@compiled
def cheapest_border(unions, counts, bins, block, costs):
    """The best of all borders between two bins: (axis, bin right of it, cost); axis -1 if no axis has two filled bins.

    The cost is that of the children in units of half a surface: area times blocks of primitives, left plus right.
    `costs` (bins,) is scratch.
    """
    nothing = (EMPTY, EMPTY, EMPTY, EMPTY, EMPTY, EMPTY)
    best_axis, best_border, best_cost = -1, 0, np.inf
    for axis in range(3):
        # Sweep from the right: the cost of each right half, which empty bins do not change.
        box, total, cost = nothing, 0, np.inf
        for b in range(bins - 1, 0, -1):
            if counts[axis, b] > 0:
                box = union(box, unions, axis, b)
                total += counts[axis, b]
                cost = half_area(box) * ((total + block - 1) // block)
            costs[b] = cost
        # Sweep from the left; a border behind an empty bin makes the same halves as the border before it.
        box, total = nothing, 0
        for b in range(1, bins):
            if counts[axis, b - 1] == 0:
                continue
            box = union(box, unions, axis, b - 1)
            total += counts[axis, b - 1]
            cost = half_area(box) * ((total + block - 1) // block) + costs[b]
            if cost < best_cost:
                best_axis, best_border, best_cost = axis, b, cost
    return best_axis, best_border, best_cost


@compiled
def levels_of_halving(count):
    """Levels below a node of `count` primitives if every split halves: the logarithm to base 2, rounded up."""
    levels = 0
    while (1 << levels) < count:
        levels += 1
    return levels


@compiled
def choose_split(unions, counts, bins, ranges, count, depth, rules, costs):
    """How to split a node of `count` primitives: (axis, first bin of the right half).

    The axis is -1 if no border is worth it: the node should be a leaf then, or be halved if a leaf cannot hold it.
    """
    axis, border, cost = cheapest_border(unions, counts, bins, rules.block, costs)
    area = half_area(ranges)
    leaf_cost = area * ((count + rules.block - 1) // rules.block)
    if (count <= rules.max_leaf) & (leaf_cost <= rules.traversal_cost * area + cost):
        axis = -1
    # Surfaces of zero cannot tell borders apart, and the first might cut off one primitive at a time.
    if area <= 0.0:
        axis = -1
    # A split may leave all but one primitive on one side: below it there must be levels enough to halve them.
    if depth + 1 + levels_of_halving(count) >= MAX_DEPTH:
        axis = -1
    return axis, border


@compiled
def join_bins(unions, axis, border, bins, halves):
    """Write the boxes left and right of the border to `halves[:, 0:6]`."""
    for half in range(2):
        for k in range(6):
            halves[half, k] = EMPTY
    for b in range(bins):
        half = int(b >= border)
        for k in range(6):
            halves[half, k] = min(halves[half, k], unions[axis, b, k])


@compiled
def partition(rows, side, start, stop, left, right, frame, axis, border, halves):
    """Copy the rows `start : stop` to the other side in order: left half to `left` onwards, right half to `right`.

    Writes the extent of the doubled centres of each half to `halves[:, 6:12]`.
    """
    boxes, ids = rows.boxes, rows.ids
    other = 1 - side
    for half in range(2):
        for k in range(6, 12):
            halves[half, k] = EMPTY
    for i in range(start, stop):
        b = int((boxes[side, i, axis] - boxes[side, i, axis + 3] - frame[0, axis]) * frame[1, axis])
        # No branch on the half: it would be mispredicted every other time.
        half = int(b >= border)
        to = right if half else left
        left += 1 - half
        right += half
        ids[other, to] = ids[side, i]
        for k in range(3):
            low, high = boxes[side, i, k], boxes[side, i, k + 3]
            boxes[other, to, k] = low
            boxes[other, to, k + 3] = high
            halves[half, k + 6] = min(halves[half, k + 6], low - high)
            halves[half, k + 9] = min(halves[half, k + 9], high - low)


@compiled
def put_node(nodes, node, ranges, start, stop):
    """Write a node, a leaf until it gets children."""
    for k in range(3):
        nodes.lower[node, k] = ranges[k]
        nodes.upper[node, k] = np.float32(0) - ranges[k + 3]
    nodes.child[node] = -1
    nodes.first[node] = start
    nodes.count[node] = stop - start


@compiled
def build_subtree(rows, order, side, start, stop, depth, ranges, rules, nodes):
    """Build the tree over the rows `start : stop`.

    Args:
        rows: the primitives; those in the range are moved about.
        order: (p,) int32; filled in the range with the numbers of the primitives in the order of the leaves.
        side: where the rows are.
        start: the first row.
        stop: the row behind the last.
        depth: level of the sub-tree's root, 0 for the root of the whole tree.
        ranges: (12,) float32 of the rows, as `measure` writes them.
        rules: `Rules`.
        nodes: `Nodes` with room for 2 (stop - start) - 1; its node 0 becomes the root.

    Returns:
        The number of nodes.

    """
    boxes, ids = rows.boxes, rows.ids
    unions, counts = np.empty((3, MAX_BINS, 6), np.float32), np.empty((3, MAX_BINS), np.int32)
    costs, frame, halves = np.empty(MAX_BINS, np.float64), np.empty((2, 3), np.float32), np.empty((2, 12), np.float32)
    # A split takes one node off the stack and puts two on, so at most one waits on each level, and two on the last.
    waiting, extents = np.empty((MAX_DEPTH + 1, 3), np.int64), np.empty((MAX_DEPTH + 1, 12), np.float32)
    used = np.int64(0)
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = used, depth, side
    for k in range(12):
        extents[0, k] = ranges[k]
    put_node(nodes, used, ranges, start, stop)
    size, used = 1, used + 1
    while size > 0:
        # Take the next node.
        size -= 1
        node, depth, side = waiting[size, 0], waiting[size, 1], waiting[size, 2]
        start, count = np.int64(nodes.first[node]), np.int64(nodes.count[node])
        stop = start + count
        # Choose its split, unless it may be a leaf that is no dearer than one step down, which no split can beat.
        fits = count <= rules.max_leaf
        axis, border, bins = -1, 0, 0
        if not (fits & ((count + rules.block - 1) // rules.block <= rules.traversal_cost)):
            bins = place_bins(extents[size], count, frame)
            fill_bins(boxes, side, start, stop, frame, bins, unions, counts)
            axis, border = choose_split(unions, counts, bins, extents[size], count, depth, rules, costs)
        # Make it a leaf.
        if fits & (axis < 0):
            for i in range(start, stop):
                order[i] = ids[side, i]
            continue
        # Or split its rows: at the border between two bins, or else in the middle of their order.
        if axis >= 0:
            middle = start
            for b in range(border):
                middle += counts[axis, b]
            partition(rows, side, start, stop, start, middle, frame, axis, border, halves)
            join_bins(unions, axis, border, bins, halves)
            side = 1 - side
        else:
            middle = (start + stop) // 2
            measure(boxes, side, start, middle, halves[0])
            measure(boxes, side, middle, stop, halves[1])
        # Put the children on the stack, the left one last: it comes next, while its rows are in the cache.
        nodes.child[node] = used
        put_node(nodes, used, halves[0], start, middle)
        put_node(nodes, used + 1, halves[1], middle, stop)
        for half in range(1, -1, -1):
            waiting[size, 0], waiting[size, 1], waiting[size, 2] = used + half, depth + 1, side
            for k in range(12):
                extents[size, k] = halves[half, k]
            size += 1
        used += 2
    return used
