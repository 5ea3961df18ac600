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
from ...lang import Vec3, i32, kernel, stack_ints, u32
from ...lang.cuda import cuda_entry
from .film import add_samples, finite

_ALL = 0xFFFFFFFF
# The link of a lane that has no work any more.
IDLE = i32(-(2**31) + 1)
BLOCK = 128
TILE_WIDTH, TILE_HEIGHT = 16, 8
"""Pixels of a block: four warps of 8 x 4."""


@kernel
def place_of():
    """Column and row, on the film, of this thread's pixel: a warp covers 8 x 4 pixels, a block 16 x 8."""
    thread = i32(cuda.threadIdx.x)
    lane = thread & 31
    warp = thread >> 5
    column = i32(cuda.blockIdx.x) * TILE_WIDTH + (warp & 1) * 8 + (lane & 7)
    row = i32(cuda.blockIdx.y) * TILE_HEIGHT + (warp >> 1) * 4 + (lane >> 3)
    return i32(column), i32(row)


@kernel
def pixel_of(view):
    """Column and row, in the full image, of this thread's pixel."""
    column, row = place_of()
    return i32(view.left + column), i32(view.top + row)


@kernel
def idle(walk):
    """A walk of a lane without work."""
    return Walk(walk.ray, walk.inverse, walk.primitive, IDLE, walk.depth)


@kernel
def next_path(scene, view, path, sample):
    """The path itself while it lives, else that of the pixel's next sample."""
    if path.alive:
        return path, sample
    sample = u32(sample + u32(1))
    x, y = pixel_of(view)
    return start_path(scene, view, x, y, u32(y * view.width + x), sample), sample


@kernel
def walk_on(path, sample, last):
    """The walk of a path's ray, idle once all samples are done."""
    walk = start_walk(path.ray)
    return idle(walk) if sample >= u32(last) else walk


@kernel
def shade_lane(scene, view, walk, path, total, sample, last):
    """Shade what a walk found.

    Returns the walk to do next, the path, the sum of the pixel's light, the sample's number, whether the walk is a
    shadow ray's, and the light that this would bring.
    """
    x, y = pixel_of(view)
    pixel = u32(y * view.width + x)
    numbers = direction_numbers(scene, pixel, sample, view.seed, path.depth)
    step = shade(scene, view, path, Hit(walk.ray.tmax, walk.primitive), numbers, pixel, sample)
    total = total + finite(step.emitted)
    shadow = step.shadow.tmax > 0.0
    path = step.path
    if shadow:
        return start_walk(step.shadow), path, total, sample, True, step.direct
    path, sample = next_path(scene, view, path, sample)
    return walk_on(path, sample, last), path, total, sample, False, step.direct


@kernel
def end_shadow(scene, view, walk, path, total, sample, last, direct):
    """A shadow ray has ended: gather its light if it hit nothing, and go on with the path or the next sample."""
    if walk.primitive < 0:
        total = total + finite(direct)
    path, sample = next_path(scene, view, path, sample)
    return walk_on(path, sample, last), path, total, sample


@kernel
def first_walk(view, path):
    """The walk of a camera ray; idle outside of the film."""
    column, row = place_of()
    walk = start_walk(path.ray)
    return walk if (column < view.film_width) & (row < view.film_height) else idle(walk)


@kernel
def store_pixel(view, film, total):
    """Add a thread's sum to its pixel."""
    column, row = place_of()
    if (column < view.film_width) & (row < view.film_height):
        add_samples(film, i32(row * view.film_width + column), total)


def make_vote(stack_size: int, shade_at: int, leaf_at: int, node_steps: int) -> Any:
    """The voting kernel: shade once `shade_at` lanes wait for it, test a triangle once `leaf_at` do, else boxes."""

    def vote(scene, view, film, first, last):
        x, y = pixel_of(view)
        sample = u32(first)
        path = start_path(scene, view, x, y, u32(y * view.width + x), sample)
        total = Vec3(0, 0, 0)
        direct = Vec3(0, 0, 0)
        shadow = False
        stack = stack_ints(stack_size)
        walk = first_walk(view, path)
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
                    walk, path, total, sample, shadow, direct = shade_lane(
                        scene, view, walk, path, total, sample, last
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
                    walk, path, total, sample = end_shadow(scene, view, walk, path, total, sample, last, direct)
                    shadow = False
            cuda.syncwarp()
        store_pixel(view, film, total)

    return cuda_entry(vote)


def make_refill(stack_size: int, threshold: int) -> Any:
    """The refilling kernel: shade when fewer than `threshold` lanes still walk."""

    def refill(scene, view, film, first, last):
        x, y = pixel_of(view)
        sample = u32(first)
        path = start_path(scene, view, x, y, u32(y * view.width + x), sample)
        total = Vec3(0, 0, 0)
        direct = Vec3(0, 0, 0)
        shadow = False
        stack = stack_ints(stack_size)
        walk = first_walk(view, path)
        while True:
            walkers = cuda.popc(cuda.ballot_sync(_ALL, walk.link > IDLE))
            waiting = walk.link == DONE
            waiters = cuda.popc(cuda.ballot_sync(_ALL, waiting))
            if walkers + waiters == 0:
                break
            if waiters != 0 and walkers < threshold:
                if waiting:
                    walk, path, total, sample, shadow, direct = shade_lane(
                        scene, view, walk, path, total, sample, last
                    )
            elif walk.link > IDLE:
                while walk.link >= 0:
                    walk = node_step(scene, walk, stack)
                while (walk.link < 0) & (walk.link > IDLE):
                    walk = leaf_step(scene, walk, stack, shadow)
                if shadow and walk.link == DONE:
                    walk, path, total, sample = end_shadow(scene, view, walk, path, total, sample, last, direct)
                    shadow = False
            cuda.syncwarp()
        store_pixel(view, film, total)

    return cuda_entry(refill)
