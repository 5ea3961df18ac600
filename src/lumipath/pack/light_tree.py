"""A tree over the lights that are near, so that what lights a point most is chosen most often.

Conty Estevez and Kulla 2018, Importance Sampling of Many Lights with Adaptive Tree Splitting; pbrt, 4th edition,
section 12.6.3. Each node knows a box around its lights, a cone around their normals, and the sum of their intensities.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..lang import compiled
from . import layout

# A row of what is known of a light, or of several: box, axis of the normals, angle between axis and normals, angle
# between a normal and the light that leaves, intensity, 1 if light leaves in both directions of the axis.
BOUNDS = 13
_BUCKETS = 12

# Roundings of a cosine on the way to a leaf: light that barely grazes must not be missed.
_SLACK = 2e-6


@compiled
def _wider_cone(a, b):
    """Let the cone of normals in row `a` hold that of row `b` as well (pbrt, section 3.8.4)."""
    sign = 1.0
    cosine = a[6] * b[6] + a[7] * b[7] + a[8] * b[8]
    # With light in both directions in one of them, the cone of both stands for its mirror image as well.
    if cosine < 0.0 and a[12] + b[12] > 0.0:
        sign, cosine = -1.0, -cosine
    between = math.acos(min(max(cosine, -1.0), 1.0))
    if min(between + b[9], math.pi) <= a[9]:
        return
    if min(between + a[9], math.pi) <= b[9]:
        a[6], a[7], a[8], a[9] = sign * b[6], sign * b[7], sign * b[8], b[9]
        return
    angle = (a[9] + between + b[9]) / 2
    # The axis turns from one to the other, within their plane.
    across = math.sin(between)
    if angle >= math.pi or across < 1e-9:
        a[9] = math.pi
        return
    turn = angle - a[9]
    stay, go = math.sin(between - turn) / across, sign * math.sin(turn) / across
    for k in range(6, 9):
        a[k] = stay * a[k] + go * b[k]
    size = math.sqrt(a[6] ** 2 + a[7] ** 2 + a[8] ** 2)
    for k in range(6, 9):
        a[k] /= size
    a[9] = angle


@compiled
def _add(a, b):
    """Let row `a` hold the lights of row `b` as well; an intensity of 0 means that it holds none yet."""
    if b[11] == 0.0:
        return
    if a[11] == 0.0:
        a[:] = b
        return
    for k in range(3):
        a[k] = min(a[k], b[k])
        a[k + 3] = max(a[k + 3], b[k + 3])
    _wider_cone(a, b)
    a[10] = max(a[10], b[10])
    a[11] += b[11]
    a[12] = max(a[12], b[12])


@compiled
def _cost(a):
    """Intensity times extent times spread of directions (Conty Estevez and Kulla 2018, equation 1)."""
    if a[11] == 0.0:
        return 0.0
    o = a[9]
    w = min(o + a[10], math.pi)
    spread = 2 * math.pi * (1 - math.cos(o)) + math.pi / 2 * (
        2 * w * math.sin(o) - math.cos(o - 2 * w) - 2 * o * math.sin(o) + math.cos(o)
    )
    # The square of the diagonal, unlike the surface of a box, tells lamps along a line apart.
    extent = (a[3] - a[0]) ** 2 + (a[4] - a[1]) ** 2 + (a[5] - a[2]) ** 2
    return a[11] * spread * extent


@compiled
def _bucket(bounds, axis, low, size):
    """Which bucket the middle of a light falls into."""
    middle = 0.5 * (bounds[axis] + bounds[axis + 3])
    return min(int(_BUCKETS * (middle - low) / size), _BUCKETS - 1)


@compiled
def _best_split(bounds, order, first, last):
    """Axis and bucket after which to cut the lights order[first:last], for the least cost; axis -1: all in one place.

    Returns the axis, the bucket, and where the buckets begin and how far they reach.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(first, last):
        for k in range(3):
            middle = 0.5 * (bounds[order[i], k] + bounds[order[i], k + 3])
            low[k] = min(low[k], middle)
            high[k] = max(high[k], middle)
    longest = max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
    best, best_axis, best_bucket = np.inf, -1, 0
    buckets = np.empty((_BUCKETS, BOUNDS))
    before = np.empty(_BUCKETS)
    together = np.empty(BOUNDS)
    for axis in range(3):
        size = high[axis] - low[axis]
        if not size > 1e-9 * (abs(low[axis]) + abs(high[axis])):
            continue
        buckets[:] = 0.0
        for i in range(first, last):
            row = bounds[order[i]]
            _add(buckets[_bucket(row, axis, low[axis], size)], row)
        together[:] = 0.0
        for k in range(_BUCKETS - 1):
            _add(together, buckets[k])
            before[k] = _cost(together) if together[11] > 0.0 else np.inf
        together[:] = 0.0
        for k in range(_BUCKETS - 1, 0, -1):
            _add(together, buckets[k])
            # Thin slices are no good: the cost of cutting the long way is the true one.
            cost = (before[k - 1] + _cost(together)) * longest / size if together[11] > 0.0 else np.inf
            if cost < best:
                best, best_axis, best_bucket = cost, axis, k - 1
    if best_axis < 0:
        return -1, 0, 0.0, 1.0
    return best_axis, best_bucket, low[best_axis], high[best_axis] - low[best_axis]


@compiled
def _divide(bounds, order, first, last):
    """Order the lights order[first:last] so that those of the first child come first; how many they are, plus first."""
    axis, bucket, low, size = _best_split(bounds, order, first, last)
    if axis < 0:
        return (first + last) // 2
    i, j = first, last - 1
    while i <= j:
        if _bucket(bounds[order[i]], axis, low, size) <= bucket:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i


@compiled
def _grow(bounds, rows, links, parents, leaves):
    """Fill the nodes of the tree: rows (2N, BOUNDS), links, parents (2N,), and the leaf of each light (N,)."""
    count = len(bounds)
    order = np.arange(count)
    stack = np.empty((count + 1, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, 0, count
    waiting, used = 1, 2
    while waiting > 0:
        waiting -= 1
        node, first, last = stack[waiting, 0], stack[waiting, 1], stack[waiting, 2]
        if last - first == 1:
            light = order[first]
            links[node] = -1 - light
            leaves[light] = node
            rows[node] = bounds[light]
            continue
        middle = _divide(bounds, order, first, last)
        links[node] = used
        parents[used], parents[used + 1] = node, node
        stack[waiting, 0], stack[waiting, 1], stack[waiting, 2] = used, first, middle
        stack[waiting + 1, 0], stack[waiting + 1, 1], stack[waiting + 1, 2] = used + 1, middle, last
        waiting += 2
        used += 2
    # Children have higher numbers than their parents.
    for node in range(2 * count - 1, -1, -1):
        if node != 1 and links[node] >= 0:
            rows[node] = rows[links[node]]
            _add(rows[node], rows[links[node] + 1])


def build_light_tree(
    bounds: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int32]]:
    """The tree over lights, each one a leaf of its own.

    Args:
        bounds: (N, BOUNDS), N at least 1, intensities above 0.

    Returns:
        (2N, 12) float32: records of the nodes, as `layout` has them; (2N,) int32: their parents; (N,) int32: the leaf
        of each light.
    """
    count = len(bounds)
    rows = np.zeros((2 * count, BOUNDS))
    links, parents = np.full(2 * count, -1, np.int64), np.full(2 * count, -1, np.int64)
    leaves = np.zeros(count, np.int64)
    _grow(np.ascontiguousarray(bounds, np.float64), rows, links, parents, leaves)
    nodes = np.zeros((2 * count, int(layout.LIGHT_NODE_SIZE)), np.float32)
    nodes[:, :3] = (rows[:, :3] + rows[:, 3:6]) / 2
    # Rounded up, with the rounding of the middle.
    reach = np.abs(rows[:, :6]).max(axis=1)
    nodes[:, 3] = np.linalg.norm(rows[:, 3:6] - rows[:, :3], axis=1) / 2 * (1 + 1e-6) + reach * 2e-7
    nodes[:, 4:7], nodes[:, 7] = rows[:, 6:9], np.where(rows[:, 12] > 0, -rows[:, 11], rows[:, 11])
    nodes[:, 8] = np.maximum(np.cos(rows[:, 9]) - _SLACK, -1)
    nodes[:, 9] = np.sqrt(1 - nodes[:, 8].astype(np.float64) ** 2)
    nodes[:, 10] = np.cos(rows[:, 10]) - _SLACK
    nodes.view(np.int32)[:, 11] = links
    return nodes, parents.astype(np.int32), leaves.astype(np.int32)
