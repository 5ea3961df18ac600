"""One kernel for whole paths: a thread renders a pixel, and the lanes of a warp take turns at what most of them need.

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
from ...lang import INF, Vec3, i32, kernel, load, stack_ints, store, u32
from ...lang.cuda import cuda_entry
from ...lang.maths import exact_add, exact_sub

_ALL = 0xFFFFFFFF
# The link of a lane that has no work any more.
IDLE = i32(-(2**31) + 1)
BLOCK = 128
TILE_WIDTH, TILE_HEIGHT = 16, 8
"""Pixels of a block: four warps of 8 x 4."""


@kernel
def place_of(thread, width):
    """Column and row, on the film, of a thread's pixel: warps cover 8 x 4 pixels, blocks 16 x 8."""
    warp = i32(thread >> 5)
    lane = i32(thread & 31)
    block = i32(warp >> 2)
    quarter = i32(warp & 3)
    across = i32((width + 15) >> 4)
    column = i32(((block % across) * 2 + (quarter & 1)) * 8 + (lane & 7))
    row = i32(((block // across) * 2 + (quarter >> 1)) * 4 + (lane >> 3))
    return column, row


@kernel
def add_exactly(film, i, value):
    """Add a number to the film, keeping the digits that float32 cannot hold (Knuth's two-sum)."""
    before = load(film.total, i)
    total = exact_add(before, value)
    c = exact_sub(total, before)
    lost = exact_add(exact_sub(before, exact_sub(total, c)), exact_sub(value, c))
    store(film.total, i, total)
    store(film.lost, i, load(film.lost, i) + lost)


@kernel
def add_samples(film, place, total):
    """Add the sum of a pixel's samples to the film."""
    add_exactly(film, place * 3, total.x)
    add_exactly(film, place * 3 + 1, total.y)
    add_exactly(film, place * 3 + 2, total.z)


@kernel
def shade_and_refill(scene, view, walk, path, gathered, column, row, pixel, sample):
    """Shade what a walk found; a path that ends makes room for the pixel's next sample.

    Returns the walk of the ray to trace next, the path, the light gathered by the sample so far, the sample's number,
    whether the walk is a shadow ray's, the light that it brings, and whether a sample was finished.
    """
    numbers = direction_numbers(scene, pixel, sample, view.seed, path.depth)
    step = shade(scene, view, path, Hit(walk.ray.tmax, walk.primitive), numbers, pixel, sample)
    gathered = gathered + step.emitted
    path = step.path
    shadow = step.shadow.tmax > 0.0
    ray = path.ray
    if shadow:
        ray = step.shadow
    return start_walk(ray), path, gathered, shadow, step.direct


@kernel
def finished(total, gathered, rejected):
    """The sum with one more sample; a sample that is not finite counts as black, and as rejected."""
    if abs(gathered.x + gathered.y + gathered.z) < INF:
        return total + gathered, rejected
    return total, i32(rejected + 1)


@kernel
def idle(walk):
    """A walk of a lane without work."""
    return Walk(walk.ray, walk.inverse, walk.primitive, IDLE, walk.depth)


def make_vote(stack_size: int, shade_at: int, leaf_at: int, node_steps: int) -> Any:
    """The voting kernel: shade once `shade_at` lanes wait for it, test a triangle once `leaf_at` do, else boxes."""

    def vote(scene, view, film, counters, first, last):
        column, row = place_of(cuda.grid(1), view.film_width)
        inside = (column < view.film_width) & (row < view.film_height)
        x = i32(view.left + column)
        y = i32(view.top + row)
        pixel = u32(y * view.width + x)
        sample = u32(first)
        path = start_path(scene, view, x, y, pixel, sample)
        total = Vec3(0, 0, 0)
        gathered = Vec3(0, 0, 0)
        direct = Vec3(0, 0, 0)
        rejected = i32(0)
        shadow = False
        stack = stack_ints(stack_size)
        walk = start_walk(path.ray)
        if not inside:
            walk = idle(walk)
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
                    walk, path, gathered, shadow, direct = shade_and_refill(
                        scene, view, walk, path, gathered, x, y, pixel, sample
                    )
                    if not path.alive and not shadow:
                        total, rejected = finished(total, gathered, rejected)
                        gathered = Vec3(0, 0, 0)
                        sample = u32(sample + u32(1))
                        path = start_path(scene, view, x, y, pixel, sample)
                        walk = start_walk(path.ray)
                        if sample >= u32(last):
                            walk = idle(walk)
            else:
                if leaves >= leaf_at or nodes < leaves:
                    if at_leaf:
                        walk = leaf_step(scene, walk, stack, shadow)
                else:
                    for _ in range(node_steps):
                        if walk.link >= 0:
                            walk = node_step(scene, walk, stack)
                if shadow and walk.link == DONE:
                    # The shadow ray has ended: gather its light, then go on with the path or the next sample.
                    if walk.primitive < 0:
                        gathered = gathered + direct
                    shadow = False
                    if not path.alive:
                        total, rejected = finished(total, gathered, rejected)
                        gathered = Vec3(0, 0, 0)
                        sample = u32(sample + u32(1))
                        path = start_path(scene, view, x, y, pixel, sample)
                    walk = start_walk(path.ray)
                    if sample >= u32(last):
                        walk = idle(walk)
            cuda.syncwarp()
        if inside:
            add_samples(film, i32(row * view.film_width + column), total)
            if rejected > 0:
                cuda.atomic.add(counters, 0, rejected)

    return cuda_entry(vote)


def make_refill(stack_size: int, threshold: int) -> Any:
    """The refilling kernel: shade when fewer than `threshold` lanes still walk."""

    def refill(scene, view, film, counters, first, last):
        column, row = place_of(cuda.grid(1), view.film_width)
        inside = (column < view.film_width) & (row < view.film_height)
        x = i32(view.left + column)
        y = i32(view.top + row)
        pixel = u32(y * view.width + x)
        sample = u32(first)
        path = start_path(scene, view, x, y, pixel, sample)
        total = Vec3(0, 0, 0)
        gathered = Vec3(0, 0, 0)
        direct = Vec3(0, 0, 0)
        rejected = i32(0)
        shadow = False
        stack = stack_ints(stack_size)
        walk = start_walk(path.ray)
        if not inside:
            walk = idle(walk)
        while True:
            walking = walk.link > IDLE
            waiting = walk.link == DONE
            walkers = cuda.popc(cuda.ballot_sync(_ALL, walking))
            waiters = cuda.ballot_sync(_ALL, waiting)
            if walkers == 0 and waiters == 0:
                break
            if waiters != 0 and walkers < threshold:
                if waiting:
                    walk, path, gathered, shadow, direct = shade_and_refill(
                        scene, view, walk, path, gathered, x, y, pixel, sample
                    )
                    if not path.alive and not shadow:
                        total, rejected = finished(total, gathered, rejected)
                        gathered = Vec3(0, 0, 0)
                        sample = u32(sample + u32(1))
                        path = start_path(scene, view, x, y, pixel, sample)
                        walk = start_walk(path.ray)
                        if sample >= u32(last):
                            walk = idle(walk)
            elif walking:
                while walk.link >= 0:
                    walk = node_step(scene, walk, stack)
                while (walk.link < 0) & (walk.link > IDLE):
                    walk = leaf_step(scene, walk, stack, shadow)
                if shadow and walk.link == DONE:
                    if walk.primitive < 0:
                        gathered = gathered + direct
                    shadow = False
                    if not path.alive:
                        total, rejected = finished(total, gathered, rejected)
                        gathered = Vec3(0, 0, 0)
                        sample = u32(sample + u32(1))
                        path = start_path(scene, view, x, y, pixel, sample)
                    walk = start_walk(path.ray)
                    if sample >= u32(last):
                        walk = idle(walk)
            cuda.syncwarp()
        if inside:
            add_samples(film, i32(row * view.film_width + column), total)
            if rejected > 0:
                cuda.atomic.add(counters, 0, rejected)

    return cuda_entry(refill)
