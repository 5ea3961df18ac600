"""The tree builder: every primitive once, boxes that hold, bounded leaves and depth, the same tree on any threads."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lumipath.accel.build import MAX_DEPTH, BinaryTree, build_tree, sah_cost
from lumipath.errors import SceneError, UsageError

Boxes = tuple[NDArray[np.float32], NDArray[np.float32]]


def random_boxes(count: int, seed: int = 0, size: float = 0.05) -> Boxes:
    """Boxes in the unit cube, some large, most small."""
    rng = np.random.default_rng(seed)
    lower = rng.random((count, 3), np.float32)
    extent = rng.random((count, 3), np.float32) ** 4 * np.float32(size)
    return lower, lower + extent


def depths(tree: BinaryTree) -> NDArray[np.int64]:
    """(n,) the level of every node; children come behind their parents."""
    depth = np.zeros(len(tree.child), np.int64)
    for node in np.flatnonzero(tree.child >= 0):
        depth[tree.child[node] : tree.child[node] + 2] = depth[node] + 1
    return depth


def check(tree: BinaryTree, lower: NDArray[np.float32], upper: NDArray[np.float32], max_leaf: int = 8) -> None:
    """Everything that a tree promises, whatever the boxes."""
    leaf, inner = np.flatnonzero(tree.child < 0), np.flatnonzero(tree.child >= 0)
    left, right = tree.child[inner], tree.child[inner] + 1
    # Types and shapes.
    nodes = len(tree.child)
    assert tree.lower.shape == tree.upper.shape == (nodes, 3)
    assert tree.lower.dtype == tree.upper.dtype == np.float32
    assert {column.dtype for column in tree[2:]} == {np.dtype(np.int32)}
    # Every node but the root is the child of one node before it.
    assert (left > inner).all()
    np.testing.assert_array_equal(np.sort(np.concatenate([[0], left, right])), np.arange(nodes))
    # Every primitive lies in one leaf; leaves are small and not empty; inner nodes hold what is below them.
    np.testing.assert_array_equal(np.sort(tree.order), np.arange(len(lower)))
    by_first = leaf[np.argsort(tree.first[leaf])]
    np.testing.assert_array_equal(tree.first[by_first], np.cumsum(tree.count[by_first]) - tree.count[by_first])
    assert tree.count[leaf].sum() == len(lower)
    assert 1 <= tree.count[leaf].min() <= tree.count[leaf].max() <= max_leaf
    np.testing.assert_array_equal(tree.first[left], tree.first[inner])
    np.testing.assert_array_equal(tree.first[right], tree.first[inner] + tree.count[left])
    np.testing.assert_array_equal(tree.count[inner], tree.count[left] + tree.count[right])
    assert depths(tree).max() < MAX_DEPTH
    # Boxes are the unions of what is in them, no larger.
    np.testing.assert_array_equal(tree.lower[inner], np.minimum(tree.lower[left], tree.lower[right]))
    np.testing.assert_array_equal(tree.upper[inner], np.maximum(tree.upper[left], tree.upper[right]))
    starts = tree.first[by_first]
    np.testing.assert_array_equal(tree.lower[by_first], np.minimum.reduceat(lower[tree.order], starts))
    np.testing.assert_array_equal(tree.upper[by_first], np.maximum.reduceat(upper[tree.order], starts))


def assert_equal_bits(a: BinaryTree, b: BinaryTree) -> None:
    for name, left, right in zip(BinaryTree._fields, a, b, strict=True):
        np.testing.assert_array_equal(left.view(np.int32), right.view(np.int32), err_msg=name)


def reference_cost(lower: NDArray[np.float32], upper: NDArray[np.float32], max_leaf: int, block: int) -> float:
    """The cost of a tree whose nodes are split where it is cheapest of all places, by sorting; slow and plain."""

    def area(low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.float64]:
        x, y, z = np.moveaxis(high.astype(np.float64) - low, -1, 0)
        return x * y + y * z + z * x

    def cost(low: NDArray[np.float32], high: NDArray[np.float32]) -> float:
        count, own = len(low), float(area(low.min(axis=0), high.max(axis=0)))
        blocks = -(-np.arange(1, count) // block)
        best, halves = np.inf, []
        for axis in range(3):
            order = np.argsort(low[:, axis] + high[:, axis], kind="stable")
            a, b = low[order], high[order]
            left = area(np.minimum.accumulate(a), np.maximum.accumulate(b))[:-1]
            right = area(np.minimum.accumulate(a[::-1]), np.maximum.accumulate(b[::-1]))[-2::-1]
            costs = left * blocks + right * blocks[::-1]
            if count > 1 and costs.min() < best:
                i = int(costs.argmin()) + 1
                best, halves = float(costs[i - 1]), [(a[:i], b[:i]), (a[i:], b[i:])]
        leaf = own * -(-count // block)
        if count <= max_leaf and leaf <= own + best:
            return leaf
        return own + sum(cost(*half) for half in halves)

    return cost(lower, upper) / float(area(lower.min(axis=0), upper.max(axis=0)))


@pytest.mark.parametrize(("max_leaf", "block"), [(8, 8), (4, 1), (1, 1), (16, 8), (3, 8)])
@pytest.mark.parametrize("count", [1, 2, 8, 9, 100, 5000])
def test_a_tree_holds_what_it_promises(count: int, max_leaf: int, block: int) -> None:
    boxes = random_boxes(count)
    check(build_tree(*boxes, max_leaf=max_leaf, block=block), *boxes, max_leaf)


def test_nothing_makes_one_empty_leaf() -> None:
    tree = build_tree(np.empty((0, 3)), np.empty((0, 3)))
    assert [column.tolist() for column in tree] == [[[0, 0, 0]], [[0, 0, 0]], [-1], [0], [0], []]
    assert sah_cost(tree) == 0.0


@pytest.mark.parametrize("threads", [2, 3, 8])
def test_threads_do_not_change_a_bit(threads: int) -> None:
    lower, upper = random_boxes(100_000)
    # Both zeros, large boxes among small ones, and a crowd in one place.
    lower[::7, 1], upper[::7, 1] = np.float32(-0.0), np.float32(0.0)
    lower[::1000], upper[::1001] = -5.0, 7.0
    lower[:3000], upper[:3000] = 0.25, 0.5
    tree = build_tree(lower, upper, threads=1)
    check(tree, lower, upper)
    assert_equal_bits(tree, build_tree(lower, upper, threads=threads))


def test_two_builds_are_equal() -> None:
    boxes = random_boxes(3000)
    assert_equal_bits(build_tree(*boxes), build_tree(*boxes))


@pytest.mark.parametrize("count", [7, 1000, 50_000])
def test_equal_boxes_are_halved(count: int) -> None:
    lower, upper = np.full((count, 3), 1.0, np.float32), np.full((count, 3), 2.0, np.float32)
    tree = build_tree(lower, upper)
    check(tree, lower, upper)
    assert depths(tree).max() == max(0, int(np.ceil(np.log2(count / 8))))


@pytest.mark.parametrize("flat", [(0,), (1, 2), (0, 1, 2)])
def test_boxes_without_extent(flat: tuple[int, ...]) -> None:
    lower, upper = random_boxes(2000)
    lower[:, flat] = upper[:, flat] = 0.5
    tree = build_tree(lower, upper)
    check(tree, lower, upper)
    assert depths(tree).max() < 24


def test_points() -> None:
    points, _ = random_boxes(2000)
    check(build_tree(points, points, max_leaf=1, block=1), points, points, 1)


def test_concentric_boxes() -> None:
    extent = np.linspace(1, 2, 500, dtype=np.float32)[:, None] * np.ones(3, np.float32)
    tree = build_tree(-extent, extent)
    check(tree, -extent, extent)
    assert depths(tree).max() == 6


@pytest.mark.parametrize("scale", [1e18, 1e-18, 9e28])
def test_extreme_scales_split_like_ordinary_ones(scale: float) -> None:
    boxes = random_boxes(2000)
    scaled = boxes[0] * np.float32(scale), boxes[1] * np.float32(scale) * np.float32(0.95)
    scaled = scaled[0] * np.float32(0.9), np.maximum(scaled[0] * np.float32(0.9), scaled[1])
    tree = build_tree(*scaled)
    check(tree, *scaled)
    assert depths(tree).max() < 24
    same_shape = tuple(corner.astype(np.float64) / scale for corner in scaled)
    assert sah_cost(tree) == pytest.approx(sah_cost(build_tree(*same_shape)), rel=0.01)


def test_depth_is_bounded_where_splits_by_cost_would_go_on() -> None:
    # Each power of two is a place of its own, and 16 bins can only cut off the last few places of a long row of them.
    rng = np.random.default_rng(1)
    lower = np.zeros((6000, 3), np.float32)
    lower[np.arange(6000), np.arange(6000) % 3] = np.float32(2.0) ** rng.uniform(-90, 90, 6000)
    upper = lower + np.where(lower > 0, lower * np.float32(1e-3), np.float32(0))
    tree = build_tree(lower, upper, max_leaf=1, block=1)
    check(tree, lower, upper, 1)
    assert depths(tree).max() > 40


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_boxes(data: st.DataObject) -> None:
    coordinate = st.one_of(
        st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e18, -1e18, 1e-18]),
        st.floats(-(2.0**60), 2.0**60, width=32),
        st.floats(-1.0, 1.0, width=32),
    )
    corners = data.draw(st.lists(st.tuples(*[coordinate] * 6), min_size=1, max_size=80))
    max_leaf = data.draw(st.integers(1, 9))
    block = data.draw(st.sampled_from([1, 4, 8]))
    points = np.array(corners, np.float32).reshape(-1, 2, 3)
    boxes = points.min(axis=1), points.max(axis=1)
    check(build_tree(*boxes, max_leaf=max_leaf, block=block), *boxes, max_leaf)


@pytest.mark.parametrize(("max_leaf", "block"), [(8, 8), (4, 1)])
def test_cost_is_near_that_of_trying_every_split(max_leaf: int, block: int) -> None:
    ratios = []
    for seed, size in [(0, 0.05), (1, 0.3), (2, 0.01)]:
        boxes = random_boxes(3000, seed, size)
        cost = sah_cost(build_tree(*boxes, max_leaf=max_leaf, block=block), block)
        ratios.append(cost / reference_cost(*boxes, max_leaf, block))
    assert np.mean(ratios) < 1.02
    assert max(ratios) < 1.04


def test_cost_of_a_tree_by_hand() -> None:
    lower = np.array([[0, 0, 0]] * 5 + [[3, 0, 0]] * 5, np.float32)
    tree = build_tree(lower, lower + np.float32(1))
    # A root of 4 x 1 x 1 (half a surface of 9) over two unit cubes (3 each), one block of primitives in each.
    assert len(tree.child) == 3
    assert sah_cost(tree) == pytest.approx(1 + 3 / 9 + 3 / 9)
    assert sah_cost(tree, block=4, traversal_cost=0.5) == pytest.approx(0.5 + 2 * 3 / 9 + 2 * 3 / 9)


def test_dear_steps_make_larger_leaves() -> None:
    boxes = random_boxes(2000)
    sizes = [len(build_tree(*boxes, max_leaf=8, block=1, traversal_cost=cost).child) for cost in (0.0, 1.0, 4.0, 100.0)]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > sizes[-1]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e29])
@pytest.mark.parametrize("count", [10, 40_000])
def test_bad_boxes_are_named(bad: float, count: int) -> None:
    lower, upper = random_boxes(count)
    upper[7, 1] = bad
    with pytest.raises(SceneError, match="primitive 7 "):
        build_tree(lower, upper)


def test_boxes_must_not_be_inside_out() -> None:
    lower, upper = random_boxes(10)
    with pytest.raises(SceneError, match="primitive 0 "):
        build_tree(upper, lower)


@pytest.mark.parametrize("shape", [(4, 2), (3,), (4, 3, 1)])
def test_wrong_shapes(shape: tuple[int, ...]) -> None:
    with pytest.raises(SceneError, match="shape N x 3"):
        build_tree(np.zeros(shape), np.zeros(shape))


def test_lower_and_upper_must_match() -> None:
    with pytest.raises(SceneError, match="same shape"):
        build_tree(np.zeros((4, 3)), np.zeros((5, 3)))


@pytest.mark.parametrize(
    "option", [{"max_leaf": 0}, {"block": 0}, {"threads": 0}, {"traversal_cost": -1.0}, {"traversal_cost": np.nan}]
)
def test_options_out_of_range(option: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=next(iter(option))):
        build_tree(*random_boxes(4), **option)
