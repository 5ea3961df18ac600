"""The top of a tree: large nodes, which all threads split together, level by level.

The rows of each node are cut into chunks. Every chunk is binned for itself; the bins of a node's chunks are merged and
tell the split; and since they also tell how many rows each chunk sends left, all chunks can then be moved at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import build_kernels as kernels
from .build_kernels import Nodes, Rows, Rules

CHUNK = 1 << 13
"""Fewest rows that are worth handing to another thread."""

TOP_SHARE = 32
"""A node with more than one in so many of all primitives belongs to the top. The number of threads must not come into
this: the numbers of the nodes depend on it."""


class Span(NamedTuple):
    """A node of the top: its number, its rows `start : stop` of `side`, its level, and the ranges of its rows."""

    node: int
    start: int
    stop: int
    side: int
    depth: int
    ranges: NDArray[np.float32]

    @property
    def size(self) -> int:
        """Primitives in the node."""
        return self.stop - self.start


class Crew:
    """Threads that share the loops of one build; a single one is the caller's own."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="lumipath-build") if threads > 1 else None

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool:
            self._pool.shutdown(cancel_futures=True)

    def run(self, tasks: Iterable[Callable[[], Any]]) -> list[Any]:
        """The results of the tasks, in their order, in which they are also begun."""
        tasks = list(tasks)
        if self._pool is None or len(tasks) < 2:
            return [task() for task in tasks]
        return list(self._pool.map(lambda task: task(), tasks))

    def cut(self, start: int, stop: int, total: int) -> list[tuple[int, int]]:
        """`start : stop` in chunks, of a size that gives every thread some if `total` rows are being cut."""
        size = max(total // (4 * self.threads), CHUNK) if self.threads > 1 else total
        parts = max((stop - start) // size, 1)
        borders = [start + (stop - start) * i // parts for i in range(parts + 1)]
        return [(borders[i], borders[i + 1]) for i in range(parts)]


class _Split:
    """The split of one node: `fill` for every chunk, then `choose`, then `move` for every chunk, then `halves`.

    It decides as `build_subtree` does, so the shape of the tree does not depend on where the top ends.
    """

    def __init__(self, rows: Rows, span: Span, rules: Rules, chunks: list[tuple[int, int]]) -> None:
        self.rows, self.span, self.rules, self.chunks = rows, span, rules, chunks
        self._frame = np.empty((2, 3), np.float32)
        self._bins = kernels.place_bins(span.ranges, span.size, self._frame)
        self._unions = np.empty((len(chunks), 3, self._bins, 6), np.float32)
        self._counts = np.empty((len(chunks), 3, self._bins), np.int32)
        self._extents = np.empty((len(chunks), 2, 12), np.float32)

    def fill(self, i: int) -> None:
        """Bin a chunk."""
        unions, counts = self._unions[i], self._counts[i]
        kernels.fill_bins(self.rows.boxes, self.span.side, *self.chunks[i], self._frame, self._bins, unions, counts)

    def choose(self) -> None:
        """Find the best split, and where it sends each chunk's rows."""
        span = self.span
        self._merged, counts = self._unions.min(axis=0), self._counts.sum(axis=0, dtype=np.int32)
        costs = np.empty(self._bins, np.float64)
        self.axis, self._border = kernels.choose_split(
            self._merged, counts, self._bins, span.ranges, span.size, span.depth, self.rules, costs
        )
        if self.axis < 0:
            self.middle = (span.start + span.stop) // 2
            return
        lefts = self._counts[:, self.axis, : self._border].sum(axis=1)
        self.middle = span.start + int(lefts.sum())
        self._left = [span.start + int(before) for before in np.cumsum(lefts) - lefts]

    def move(self, i: int) -> None:
        """Copy a chunk's rows to the other side."""
        start, stop = self.chunks[i]
        left = self._left[i]
        # Of the rows before this chunk, those that did not go left went right.
        right = self.middle + (start - self.span.start) - (left - self.span.start)
        where = self._frame, self.axis, self._border
        kernels.partition(self.rows, self.span.side, start, stop, left, right, *where, self._extents[i])

    def halves(self, left: int) -> list[Span]:
        """The two children, of which the left one gets the number `left`."""
        span, ranges = self.span, np.empty((2, 12), np.float32)
        parts = (span.start, self.middle), (self.middle, span.stop)
        if self.axis >= 0:
            kernels.join_bins(self._merged, self.axis, self._border, self._bins, ranges)
            ranges[:, 6:12] = self._extents[:, :, 6:12].min(axis=0)
        else:
            for half, part in enumerate(parts):
                kernels.measure(self.rows.boxes, span.side, *part, ranges[half])
        side = 1 - span.side if self.axis >= 0 else span.side
        return [Span(left + half, *parts[half], side, span.depth + 1, ranges[half]) for half in range(2)]


def build_top(rows: Rows, root: Span, rules: Rules, crew: Crew) -> tuple[Nodes, list[Span]]:
    """Split the root down to nodes that are small enough for one thread each.

    Returns:
        The nodes, those without children included, and a list of the latter in the order of their rows.

    """
    limit = max(root.size // TOP_SHARE, 2 * CHUNK, rules.max_leaf)
    nodes, child, level, small = [root], [-1], [root], []
    while level:
        # Set the nodes aside that are small enough.
        small += [span for span in level if span.size <= limit]
        level = [span for span in level if span.size > limit]
        total = sum(span.size for span in level)
        splits = [_Split(rows, span, rules, crew.cut(span.start, span.stop, total)) for span in level]
        # Bin all others, choose their splits and move their rows.
        crew.run(partial(split.fill, i) for split in splits for i in range(len(split.chunks)))
        for split in splits:
            split.choose()
        crew.run(partial(split.move, i) for split in splits if split.axis >= 0 for i in range(len(split.chunks)))
        # Their children are the next level.
        level = []
        for split in splits:
            child[split.span.node] = len(nodes)
            pair = split.halves(len(nodes))
            nodes += pair
            child += [-1, -1]
            level += pair
    small.sort(key=lambda span: span.start)
    return _as_arrays(nodes, child), small


def _as_arrays(spans: list[Span], child: list[int]) -> Nodes:
    """The spans as node arrays."""
    ranges = np.array([span.ranges for span in spans])
    first = np.array([span.start for span in spans], np.int32)
    count = np.array([span.size for span in spans], np.int32)
    return Nodes(ranges[:, 0:3], np.float32(0) - ranges[:, 3:6], np.array(child, np.int32), first, count)
