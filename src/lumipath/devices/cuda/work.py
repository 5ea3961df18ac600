"""What the threads of a GPU share: which samples to render, counters, and the order of the pixels."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import cuda, types
from numpy.typing import NDArray

from ...kernels.vectors import black
from ...lang import INF, i32, kernel, u32

# Slots of `Work.counters`.
REJECTED = i32(0)
SHADOWS = i32(1)
FETCHED_PATHS = i32(2)
FETCHED_SHADOWS = i32(3)
PATHS = i32(4)
"""Of two queues, which take turns."""

COUNTERS = 8


class Work(NamedTuple):
    """One launch of the megakernel: the samples first .. last - 1 of every pixel."""

    counters: NDArray[Any]  # (COUNTERS,) uint32
    first: u32
    last: u32


WORK_TYPE = types.NamedTuple((types.Array(types.uint32, 1, "C"), *([types.uint32] * 2)), Work)


def item_count(width: int, height: int) -> int:
    """Work items of a film: the pixels of the tiles of 8 x 4 that cover it."""
    return -(-width // 8) * 8 * (-(-height // 4) * 4)


@kernel
def place_of(item, width):
    """Column and row on the film of a work item; items run through tiles of 8 x 4 pixels: warps stay together."""
    tile = u32(item >> u32(5))
    within = i32(item & u32(31))
    across = u32((u32(width) + u32(7)) >> u32(3))
    column = i32(tile % across) * 8 + (within & 7)
    row = i32(tile // across) * 4 + (within >> 3)
    return i32(column), i32(row)


@kernel
def lanes_before():
    """The bits of the lanes of a warp before this one."""
    return u32((u32(1) << u32(cuda.laneid)) - u32(1))


@kernel
def finite_or_counted(counters, light):
    """The light; where it is not finite, none, and one is added to the number of rejected samples."""
    if abs(light.x + light.y + light.z) < INF:
        return light
    cuda.atomic.add(counters, REJECTED, u32(1))
    return black()
