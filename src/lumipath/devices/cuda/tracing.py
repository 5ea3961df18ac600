"""The stages of the wavefront that trace rays: one for small trees, one for large ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import cuda

from ...accel.walk import DONE, IDLE, go_on, idle, leaf_step, node_step, start_walk
from ...kernels.rays import Hit, no_ray
from ...lang import i32, kernel, stack_ints, u32
from .work import ALL_LANES, BLOCK, WARP, lanes_before, reserve

# Rays of a warp in small trees, and how many of its lanes are done when it goes on to the next ones (measured).
_CHUNK, _REFILL_AT = 256, 8
# When the lanes of a voting warp fetch further rays, and when they test triangles (measured).
_FETCH_AT, _LEAF_AT, _NODE_STEPS = 8, 8, 2
_BLOCKS_PER_MULTIPROCESSOR = 16


class Rays(NamedTuple):
    """Rays that wait, and what becomes of them; the functions are kernels, and take a `Wave` first.

    any_hit: whether any hit will do, not only the nearest.
    count: how many there are.
    ray: one of them, by its number.
    hand_in: what is done with its hit; it takes the scene, the wave, its number and the hit.
    clear: what begins anew when they are traced.
    fetched: counter of those that somebody has taken on.
    """

    any_hit: bool
    count: Any
    ray: Any
    hand_in: Any
    clear: Any
    fetched: int


def tracing_blocks(rays: int, voting: bool, multiprocessors: int) -> int:
    """Blocks of threads to launch for so many rays."""
    if voting:
        return min(-(-rays // BLOCK), multiprocessors * _BLOCKS_PER_MULTIPROCESSOR)
    return -(-rays // (BLOCK // WARP * _CHUNK))


@kernel
def no_walk():
    """What a lane begins with: a walk that has come to its end."""
    return go_on(start_walk(no_ray()), DONE, i32(0))


def make_refilling_trace(stack_size: int, rays: Rays) -> Callable[..., None]:
    """Rays are walked to their ends, some steps at a time; in between, lanes that are done go on to the next ray.

    Each warp has some rays of its own. In small trees votes on each step cost more than they save.

    Args:
        stack_size: links on the stack of a walk.
        rays: what to trace.
    """
    any_hit, count, ray, hand_in, clear = rays[:5]

    def wf_refill(scene, view, film, wave):
        if cuda.grid(1) == 0:
            clear(wave)
        following = i32((i32(cuda.grid(1)) >> 5) * _CHUNK)
        behind = min(i32(following + _CHUNK), count(wave))
        number = i32(-1)
        walk = no_walk()
        stack = stack_ints(stack_size)
        while True:
            at_end = walk.link == DONE
            ended = u32(cuda.ballot_sync(ALL_LANES, at_end))
            walkers = cuda.popc(cuda.ballot_sync(ALL_LANES, walk.link > IDLE))
            if walkers == 0 and ended == 0:
                break
            if cuda.popc(ended) >= _REFILL_AT or walkers == 0:
                if at_end:
                    if number >= 0:
                        hand_in(scene, wave, number, Hit(walk.ray.tmax, walk.primitive, walk.instance))
                    number = i32(following + i32(cuda.popc(u32(ended & lanes_before()))))
                    walk = start_walk(ray(wave, number)) if number < behind else idle(walk)
                following = i32(following + i32(cuda.popc(ended)))
            while walk.link >= 0:
                walk = node_step(scene, walk, stack)
            while (walk.link < 0) & (walk.link > IDLE):
                walk = leaf_step(scene, walk, stack, any_hit)
            cuda.syncwarp()

    return wf_refill


def make_voting_trace(stack_size: int, rays: Rays) -> Callable[..., None]:
    """Rays are walked by as many threads as the GPU holds; each warp votes on what to do next: fetch, boxes, triangles.

    Args:
        stack_size: links on the stack of a walk.
        rays: what to trace.
    """
    any_hit, count, ray, hand_in, clear, fetched = rays

    def wf_vote(scene, view, film, wave):
        if cuda.grid(1) == 0:
            clear(wave)
        behind = count(wave)
        number = i32(-1)
        walk = no_walk()
        stack = stack_ints(stack_size)
        while True:
            at_leaf = (walk.link < 0) & (walk.link > IDLE)
            at_end = walk.link == DONE
            nodes = cuda.popc(cuda.ballot_sync(ALL_LANES, walk.link >= 0))
            leaves = cuda.popc(cuda.ballot_sync(ALL_LANES, at_leaf))
            ends = cuda.popc(cuda.ballot_sync(ALL_LANES, at_end))
            if nodes + leaves + ends == 0:
                break
            if ends >= _FETCH_AT or nodes + leaves == 0:
                following = reserve(at_end, wave.counters, fetched)
                if at_end:
                    if number >= 0:
                        hand_in(scene, wave, number, Hit(walk.ray.tmax, walk.primitive, walk.instance))
                    number = following
                    walk = start_walk(ray(wave, number)) if number < behind else idle(walk)
            elif leaves >= _LEAF_AT or nodes < leaves:
                if at_leaf:
                    walk = leaf_step(scene, walk, stack, any_hit)
            else:
                for _ in range(_NODE_STEPS):
                    if walk.link >= 0:
                        walk = node_step(scene, walk, stack)
            cuda.syncwarp()

    return wf_vote
