"""What the threads of a GPU share: which samples to render, counters, and the order of the pixels."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import cuda, types
from numpy.typing import NDArray

from ...kernels.vectors import black
from ...lang import INF, i32, kernel, struct, u32

# Slots of `Work.counters`.
REJECTED = i32(0)
SHADOWS = i32(1)
FETCHED_PATHS = i32(2)
FETCHED_SHADOWS = i32(3)
PATHS = i32(4)
"""Of two queues, which take turns."""

COUNTERS = 6

WARP = 32
BLOCK = 128
ALL_LANES = 0xFFFFFFFF


class Work(NamedTuple):
    """One launch of the megakernel: the samples first .. last - 1 of every pixel, some of them in each plane."""

    counters: NDArray[Any]  # (COUNTERS,) uint32
    tiles: u32  # of 8 x 4 pixels
    share: u32  # samples of a plane, but for the last one
    first: u32
    last: u32


WORK_TYPE = types.NamedTuple((types.Array(types.uint32, 1, "C"), *([types.uint32] * 4)), Work)


def item_count(width: int, height: int) -> int:
    """Work items of a film: the pixels of the tiles of 8 x 4 that cover it."""
    return -(-width // 8) * -(-height // 4) * WARP


@struct
class Tile:
    """What a warp renders: some samples of each pixel of a tile."""

    column: i32  # on the film, of the first pixel
    row: i32
    first: u32  # sample
    last: u32  # sample behind the last
    plane: i32  # number of the first pixel of the plane of sums


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
def tile_of(view, work, warp):
    """A warp's tile. Small films are rendered in several planes, each with its share of the samples."""
    plane = u32(warp // work.tiles)
    column, row = place_of(u32(u32(warp - plane * work.tiles) << u32(5)), view.film_width)
    first = u32(work.first + plane * work.share)
    last = min(u32(first + work.share), work.last)
    # Blocks are made full by warps that have no plane, and so no samples.
    return Tile(column, row, min(first, last), last, i32(plane) * view.film_width * view.film_height)


@kernel
def is_on_film(view, tile, which):
    """Whether a pixel of the tile is on the film; tiles reach over its edges."""
    return (tile.column + (which & 7) < view.film_width) & (tile.row + (which >> 3) < view.film_height)


@kernel
def place_in_tile(view, tile, which):
    """Number of a pixel of the tile in the planes of sums."""
    return i32(tile.plane + (tile.row + (which >> 3)) * view.film_width + tile.column + (which & 7))


@kernel
def lanes_before():
    """The bits of the lanes of a warp before this one."""
    return u32((u32(1) << u32(cuda.laneid)) - u32(1))


@kernel
def reserve(wanted, counters, which):
    """Different numbers, counted on, for the lanes that want one: one atomic a warp; all of its lanes must call it."""
    votes = u32(cuda.ballot_sync(ALL_LANES, wanted))
    first = i32(0)
    if cuda.laneid == 0 and votes != 0:
        first = i32(cuda.atomic.add(counters, which, u32(cuda.popc(votes))))
    first = cuda.shfl_sync(ALL_LANES, first, 0)
    return i32(first + i32(cuda.popc(u32(votes & lanes_before()))))


@kernel
def finite_or_counted(counters, light):
    """The light; where it is not finite, none, and one is added to the number of rejected samples."""
    if abs(light.x + light.y + light.z) < INF:
        return light
    cuda.atomic.add(counters, REJECTED, u32(1))
    return black()
