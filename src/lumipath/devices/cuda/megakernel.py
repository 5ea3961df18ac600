"""One kernel for whole paths. A lane renders pixel after pixel, and the lanes of a warp take turns at what most need.

`vote` suits large scenes: each turn the warp votes on whether to shade, to test triangles, or to test boxes.
`refill` suits tiny scenes: traversal runs to its end, and lanes that are done wait until enough of them can shade.
"""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import DONE, Walk, leaf_step, node_step, start_walk
from ...kernels.path import shade, start_path
from ...kernels.rays import Hit
from ...kernels.sampler import direction_numbers
from ...kernels.vectors import black
from ...lang import Vec3, i32, kernel, stack_ints, struct, u32
from ...lang.cuda import cuda_entry
from .film import add_samples, finite

_ALL = 0xFFFFFFFF
# The link of a lane that has no work any more.
IDLE = i32(-(2**31) + 1)
BLOCK = 128
BLOCKS_PER_MULTIPROCESSOR = 16
"""Of `vote`: its grid is as large as the GPU, and lanes that are done take further pixels from a counter."""


@struct
class Lane:
    """What a lane works on: all samples of one pixel after the other."""

    pixel: u32  # number in the full image
    place: i32  # number on the film; behind the last: no work any more
    sample: u32
    light: Vec3  # sum of the pixel's samples


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
def lane_for(view, item, items, first):
    """A lane that begins a work item; without work if there is no such pixel."""
    column, row = place_of(item, view.film_width)
    # Tiles reach over the edges of the film.
    if (item < u32(items)) & (column < view.film_width) & (row < view.film_height):
        pixel = u32((view.top + row) * view.width + view.left + column)
        return Lane(pixel, i32(row * view.film_width + column), u32(first), black())
    return Lane(u32(0), i32(-1), u32(first), black())


@kernel
def next_item(view, counters, items, first):
    """A pixel that no lane has worked on yet."""
    item = u32(cuda.atomic.add(counters, 0, u32(1)))
    lane = lane_for(view, item, items, first)
    while (lane.place < 0) & (item < u32(items)):
        item = u32(cuda.atomic.add(counters, 0, u32(1)))
        lane = lane_for(view, item, items, first)
    return lane


@kernel
def camera_path(scene, view, lane):
    """The camera path of a lane's sample."""
    width = u32(view.width)
    row = u32(lane.pixel // width)
    return start_path(scene, view, i32(lane.pixel - row * width), i32(row), lane.pixel, lane.sample)


@kernel
def idle(walk):
    """A walk of a lane without work."""
    return Walk(walk.ray, walk.inverse, walk.primitive, IDLE, walk.depth)


@kernel
def begin(scene, view, lane):
    """The path and the walk of a lane's sample."""
    path = camera_path(scene, view, lane)
    walk = start_walk(path.ray)
    return path, (idle(walk) if lane.place < 0 else walk)


@kernel
def advance(scene, view, film, counters, items, first, last, path, lane):
    """Go on with the path while it lives, else with the next sample, else with another pixel."""
    if path.alive:
        return path, start_walk(path.ray), lane
    lane = Lane(lane.pixel, lane.place, u32(lane.sample + u32(1)), lane.light)
    if lane.sample >= u32(last):
        add_samples(film, lane.place, lane.light)
        lane = next_item(view, counters, items, first)
    path, walk = begin(scene, view, lane)
    return path, walk, lane


@kernel
def lit(lane, light):
    """The lane with more light; what is not finite is left out."""
    return Lane(lane.pixel, lane.place, lane.sample, lane.light + finite(light))


@kernel
def shade_lane(scene, view, film, counters, items, first, last, walk, path, lane):
    """Shade what a walk found.

    Returns the walk to do next, the path, the lane, whether the walk is a shadow ray's, and the light that it brings.
    """
    numbers = direction_numbers(scene, lane.pixel, lane.sample, view.seed, path.depth)
    hit = Hit(walk.ray.tmax, walk.primitive)
    step = shade(scene, view, path, hit, numbers, lane.pixel, lane.sample)
    lane = lit(lane, step.emitted)
    if step.shadow.tmax > 0.0:
        return start_walk(step.shadow), step.path, lane, True, step.direct
    path, walk, lane = advance(scene, view, film, counters, items, first, last, step.path, lane)
    return walk, path, lane, False, step.direct


@kernel
def end_shadow(scene, view, film, counters, items, first, last, walk, path, lane, direct):
    """A shadow ray has ended: gather its light if it hit nothing, and go on."""
    if walk.primitive < 0:
        lane = lit(lane, direct)
    path, walk, lane = advance(scene, view, film, counters, items, first, last, path, lane)
    return walk, path, lane


def make_vote(stack_size: int, shade_at: int, leaf_at: int, node_steps: int) -> Any:
    """The voting kernel: shade once `shade_at` lanes wait for it, test a triangle once `leaf_at` do, else boxes."""

    def vote(scene, view, film, counters, items, first, last):
        lane = lane_for(view, u32(cuda.grid(1)), items, first)
        path, walk = begin(scene, view, lane)
        direct = Vec3(0, 0, 0)
        shadow = False
        stack = stack_ints(stack_size)
        while True:
            at_node = walk.link >= 0
            at_leaf = (walk.link < 0) & (walk.link > IDLE)
            at_end = walk.link == DONE
            nodes = cuda.popc(cuda.ballot_sync(_ALL, at_node))
            leaves = cuda.popc(cuda.ballot_sync(_ALL, at_leaf))
            ends = cuda.popc(cuda.ballot_sync(_ALL, at_end))
            if nodes + leaves + ends == 0:
                break
            if ends >= shade_at or nodes + leaves == 0:
                if at_end:
                    walk, path, lane, shadow, direct = shade_lane(
                        scene, view, film, counters, items, first, last, walk, path, lane
                    )
            else:
                if leaves >= leaf_at or nodes < leaves:
                    if at_leaf:
                        walk = leaf_step(scene, walk, stack, shadow)
                else:
                    for _ in range(node_steps):
                        if walk.link >= 0:
                            walk = node_step(scene, walk, stack)
                if shadow and walk.link == DONE:
                    walk, path, lane = end_shadow(
                        scene, view, film, counters, items, first, last, walk, path, lane, direct
                    )
                    shadow = False
            cuda.syncwarp()

    return cuda_entry(vote)


def make_refill(stack_size: int, threshold: int) -> Any:
    """The refilling kernel: shade when fewer than `threshold` lanes still walk."""

    def refill(scene, view, film, counters, items, first, last):
        lane = lane_for(view, u32(cuda.grid(1)), items, first)
        path, walk = begin(scene, view, lane)
        direct = Vec3(0, 0, 0)
        shadow = False
        stack = stack_ints(stack_size)
        while True:
            walkers = cuda.popc(cuda.ballot_sync(_ALL, walk.link > IDLE))
            waiting = walk.link == DONE
            waiters = cuda.popc(cuda.ballot_sync(_ALL, waiting))
            if walkers + waiters == 0:
                break
            if waiters != 0 and walkers < threshold:
                if waiting:
                    walk, path, lane, shadow, direct = shade_lane(
                        scene, view, film, counters, items, first, last, walk, path, lane
                    )
            elif walk.link > IDLE:
                while walk.link >= 0:
                    walk = node_step(scene, walk, stack)
                while (walk.link < 0) & (walk.link > IDLE):
                    walk = leaf_step(scene, walk, stack, shadow)
                if shadow and walk.link == DONE:
                    walk, path, lane = end_shadow(
                        scene, view, film, counters, items, first, last, walk, path, lane, direct
                    )
                    shadow = False
            cuda.syncwarp()

    return cuda_entry(refill)
