"""Builds binary bounding volume hierarchies by the surface area heuristic, on all cores.

The method is Wald's (2007), "On fast construction of SAH-based bounding volume hierarchies": the centres of a node's
boxes are counted into bins, and of all borders between bins on all three axes the one of the lowest expected cost
becomes the split. The work has three stages:

1. The top: all threads together split the large nodes (`build_top.py`).
2. The sub-trees below: each is built by one thread, the largest first.
3. The tree: the nodes of all sub-trees are copied behind those of the top.

`build_kernels.py` holds the compiled loops and says how rows and boxes are laid out.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError, UsageError
from ..lang.host import usable_cores
from . import build_kernels as kernels
from .build_kernels import LIMIT, MAX_DEPTH, Nodes, Rows, Rules
from .build_top import CHUNK, Crew, Span, build_top

__all__ = ["MAX_DEPTH", "BinaryTree", "build_tree", "sah_cost"]


class BinaryTree(NamedTuple):
    """A bounding volume hierarchy over p primitives; n nodes, node 0 the root, children behind their parents."""

    lower: NDArray[np.float32]
    """(n, 3): least corners of the nodes' boxes."""
    upper: NDArray[np.float32]
    """(n, 3): greatest corners of the nodes' boxes."""
    child: NDArray[np.int32]
    """(n,): the left child, the right one being the next node; -1 for a leaf."""
    first: NDArray[np.int32]
    """(n,): where the node's primitives begin in `order`."""
    count: NDArray[np.int32]
    """(n,): how many primitives are in the node, or below it."""
    order: NDArray[np.int32]
    """(p,): the primitives' numbers in the order of the leaves."""


def build_tree(
    lower: ArrayLike,
    upper: ArrayLike,
    *,
    max_leaf: int = 8,
    block: int = 8,
    traversal_cost: float = 1.0,
    threads: int | None = None,
) -> BinaryTree:
    """Build a tree over boxes. The result does not depend on the number of threads, down to the last bit.

    The tree has at most `MAX_DEPTH` levels, and no leaf holds more than `max_leaf` primitives: where boxes cannot be
    told apart (equal centres, no area) or the levels run out, a node is split in the middle of its order.

    Args:
        lower: (p, 3) least corners of the primitives' boxes, of magnitude below 1e29.
        upper: (p, 3) greatest corners, nowhere less than `lower`.
        max_leaf: most primitives in a leaf.
        block: primitives that are intersected at the cost of one; a leaf of n costs ceil(n / block).
        traversal_cost: cost of a step through an inner node, in units of one block.
        threads: threads to use; by default every core that the process may use.

    Returns:
        The tree. Without primitives it is a single leaf of none, whose box is the origin.

    Raises:
        SceneError: a box is not finite or inside out, or the arrays' shapes are wrong.
        UsageError: an option is out of its range.

    """
    low, high = _corners(lower, "lower"), _corners(upper, "upper")
    if low.shape != high.shape:
        raise SceneError(f"lower and upper must have the same shape, not {low.shape} and {high.shape}")
    if max_leaf < 1 or block < 1 or not 0.0 <= traversal_cost < np.inf or (threads is not None and threads < 1):
        raise UsageError(
            f"max_leaf {max_leaf}, block {block} and threads {threads} must be at least 1, "
            f"traversal_cost {traversal_cost} finite and not negative"
        )
    p = len(low)
    if p == 0:
        corner, none = np.zeros((1, 3), np.float32), np.zeros(1, np.int32)
        return BinaryTree(corner, corner.copy(), none - 1, none, none.copy(), np.empty(0, np.int32))
    rules = Rules(int(max_leaf), int(block), float(traversal_cost))
    rows = Rows(np.empty((2, p, 6), np.float32), np.empty((2, p), np.int32))
    # Small trees are done before a second thread would have started.
    with Crew((threads or usable_cores()) if p > 2 * CHUNK else 1) as crew:
        root = _load(low, high, rows, crew)
        top, spans = build_top(rows, root, rules, crew)
        subtrees, order = _build_subtrees(rows, spans, rules, crew)
        return BinaryTree(*_assemble(top, spans, subtrees, crew), order)


def sah_cost(tree: BinaryTree, block: int = 8, traversal_cost: float = 1.0) -> float:
    """Expected cost of a random line that meets the root's box, in units of intersecting one block of primitives.

    Every node counts with its surface over the root's: inner nodes `traversal_cost`, leaves of n primitives
    ceil(n / block). A root without surface costs 0.
    """
    x, y, z = (tree.upper.astype(np.float64) - tree.lower).T
    area = x * y + y * z + z * x
    cost = np.where(tree.child < 0, -(-tree.count // block), traversal_cost)
    return float(area @ cost / area[0]) if area[0] > 0.0 else 0.0


def _corners(points: ArrayLike, name: str) -> NDArray[np.float32]:
    """`points` as contiguous float32 of shape (p, 3)."""
    array = np.ascontiguousarray(points, np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise SceneError(f"{name} must have the shape N x 3, not {' x '.join(map(str, array.shape))}")
    return array


def _load(lower: NDArray[np.float32], upper: NDArray[np.float32], rows: Rows, crew: Crew) -> Span:
    """Fill side 0 of the rows; returns the root."""
    chunks = crew.cut(0, len(lower), len(lower))
    ranges = np.empty((len(chunks), 12), np.float32)

    def load(i: int) -> bool:
        valid = kernels.load(lower, upper, *chunks[i], rows)
        kernels.measure(rows.boxes, 0, *chunks[i], ranges[i])
        return valid

    if not all(crew.run(partial(load, i) for i in range(len(chunks)))):
        bad = int(np.argmin(((np.abs(lower) < LIMIT) & (lower <= upper) & (np.abs(upper) < LIMIT)).all(axis=1)))
        raise SceneError(
            f"the box of primitive {bad} reaches from {lower[bad].tolist()} to {upper[bad].tolist()}: "
            f"numbers must be below {LIMIT:g} in magnitude, the first three nowhere greater than the others"
        )
    return Span(0, 0, len(lower), 0, 0, ranges.min(axis=0))


def _build_subtrees(rows: Rows, spans: list[Span], rules: Rules, crew: Crew) -> tuple[list[Nodes], NDArray[np.int32]]:
    """Build the tree below each span; returns these trees, and the order of the primitives."""
    order = np.empty(rows.ids.shape[1], np.int32)

    def build(i: int) -> Nodes:
        _, start, stop, side, depth, ranges = spans[i]
        # Room for one primitive a leaf; memory that is not written costs nothing.
        nodes = _empty_nodes(2 * spans[i].size - 1)
        used = kernels.build_subtree(rows, order, side, start, stop, depth, ranges, rules, nodes)
        return Nodes(*(column[:used] for column in nodes))

    # The largest first: so the threads end at about the same time.
    by_size = sorted(range(len(spans)), key=lambda i: -spans[i].size)
    trees = dict(zip(by_size, crew.run(partial(build, i) for i in by_size), strict=True))
    return [trees[i] for i in range(len(spans))], order


def _assemble(top: Nodes, spans: list[Span], subtrees: list[Nodes], crew: Crew) -> Nodes:
    """One tree: the top, then the nodes of every sub-tree but its root, which the top has already."""
    sizes = [len(subtree.child) - 1 for subtree in subtrees]
    ends = [len(top.child) + int(end) for end in np.cumsum(sizes)]
    tree = _empty_nodes(ends[-1])
    for whole, part in zip(tree, top, strict=True):
        whole[: len(part)] = part

    def place(i: int) -> None:
        start, subtree = ends[i] - sizes[i], subtrees[i]
        # The root's first child, node 1 of the sub-tree, becomes node `start`.
        child = np.where(subtree.child < 0, np.int32(-1), subtree.child + np.int32(start - 1))
        tree.child[spans[i].node] = child[0]
        for whole, part in zip(tree, subtree._replace(child=child), strict=True):
            whole[start : ends[i]] = part[1:]

    crew.run(partial(place, i) for i in range(len(spans)))
    return tree


def _empty_nodes(size: int) -> Nodes:
    """Node arrays of undefined content."""
    lower, upper = np.empty((size, 3), np.float32), np.empty((size, 3), np.float32)
    return Nodes(lower, upper, *(np.empty(size, np.int32) for _ in range(3)))
