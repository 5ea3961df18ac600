"""Trees of scenes with instances: one for each target, in its own coordinates, and one over all that is in the world.

The tree of the world is that of the primitives that stand alone joined with a tree over the instances, each of which is
a leaf. Layouts that open the largest children first (`bvh8`, `bvh4`) leave nothing of the seam.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .build import BinaryTree, build_tree

NO_INSTANCES = np.iinfo(np.int32).max
"""Greater than any primitive's number."""


class Trees(NamedTuple):
    """The trees of a scene.

    world: over all that stands in the world; from `first_instance` on, the numbers in its order are those of instances.
    targets: over the primitives of each target.
    """

    world: BinaryTree
    targets: list[BinaryTree]
    first_instance: int


def build_trees(
    lower: NDArray[np.float32], upper: NDArray[np.float32], instancing: Any | None, **options: Any
) -> Trees:
    """Build the trees of a scene.

    Args:
        lower: (P, 3) least corners of the boxes of all primitives, where they are stored.
        upper: (P, 3) greatest corners.
        instancing: None, or what has `alone` (primitives of no target), `members` (those of each target), and `boxes`
            (I, 2, 3) around the instances.
        options: of `build_tree`.

    Raises:
        SceneError: a box is not finite.
    """
    if instancing is None:
        return Trees(build_tree(lower, upper, **options), [], int(NO_INSTANCES))

    def tree_over(numbers: NDArray[np.int32]) -> BinaryTree:
        tree = build_tree(lower[numbers], upper[numbers], **options)
        return tree._replace(order=numbers[tree.order])

    boxes = instancing.boxes
    instances = build_tree(boxes[:, 0], boxes[:, 1], **{**options, "max_leaf": 1, "block": 1})
    world = instances._replace(order=instances.order + np.int32(len(lower)))
    if len(instancing.alone):
        world = joined(tree_over(instancing.alone), world)
    return Trees(world, [tree_over(numbers) for numbers in instancing.members], len(lower))


def joined(a: BinaryTree, b: BinaryTree) -> BinaryTree:
    """A tree whose root has the roots of two trees as its children; primitives keep their numbers."""
    # New numbers of the nodes: both roots behind the new one, then the rest of `a`, then that of `b`.
    size = len(a.child)

    def moved(tree: BinaryTree, by: int) -> NDArray[np.int32]:
        return np.where(tree.child < 0, np.int32(-1), tree.child + np.int32(by))

    def merged(new: Any, first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([new[None], first[:1], second[:1], first[1:], second[1:]]).astype(first.dtype)

    total = np.int32(len(a.order) + len(b.order))
    return BinaryTree(
        merged(np.minimum(a.lower[0], b.lower[0]), a.lower, b.lower),
        merged(np.maximum(a.upper[0], b.upper[0]), a.upper, b.upper),
        merged(np.int32(1), moved(a, 2), moved(b, size + 1)),
        merged(np.int32(0), a.first, b.first + np.int32(len(a.order))),
        merged(total, a.count, b.count),
        np.concatenate([a.order, b.order]),
    )
