"""Building trees over nothing in particular, so that the compiled builder is on disk when a real one is built.

The builder is called with the same types whatever the scene; a second process can compile it before there is one.
"""

from __future__ import annotations

import numpy as np

from .build_top import CHUNK
from .bvh4 import MAX_LEAF, gpu_tree
from .bvh8 import WIDTH, widen
from .two_level import build_trees

LARGE = 2 * CHUNK
"""A tree over more primitives than this needs the loops for the top of a tree as well."""


def build_for_cpu(large: bool) -> None:
    """Build an 8-wide tree, with or without a top, as `with_cpu_tree` does."""
    lower, upper, *shapes = _row_of_triangles(LARGE + 1 if large else 1)
    widen(build_trees(lower, upper, None, max_leaf=WIDTH, block=WIDTH, threads=1), *shapes)


def build_for_gpu(large: bool, wide: bool) -> None:
    """Build a binary or a 4-wide tree, with or without a top, as `CudaDevice.upload` does."""
    lower, upper, *shapes = _row_of_triangles(LARGE + 1 if large else MAX_LEAF + 1)
    gpu_tree(build_trees(lower, upper, None, max_leaf=MAX_LEAF, block=1, threads=1), *shapes, wide=wide)


def _row_of_triangles(count: int) -> tuple[np.ndarray, ...]:
    """Boxes, lower and upper, of triangles side by side; then what `widen` and `gpu_tree` want to know of them."""
    vertices = np.zeros((count, 3, 3), np.float32)
    vertices[:, 1, 0] = vertices[:, 2, 1] = 0.5
    vertices[:, :, 0] += np.arange(count, dtype=np.float32)[:, None]
    faces = np.arange(3 * count, dtype=np.int32).reshape(count, 3)
    solid = np.ones(count, np.bool_)
    return vertices.min(axis=1), vertices.max(axis=1), vertices.reshape(-1, 3), faces, solid, solid
