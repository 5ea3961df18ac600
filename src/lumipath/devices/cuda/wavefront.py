"""One kernel a stage: extend, shade, shadow. Paths wait in queues between them.

A slot belongs to a pixel and carries one path at a time; its state lies in global memory. Each stage works through a
queue of slots without gaps and fills the next one, so that all lanes of a warp do the same thing. Neighbours in the
image stay about neighbours in the queue, since their rays meet the same boxes. The stages that trace rays run as many
threads as the GPU holds: lanes that are done fetch further rays from the queue, and the warp votes on what to do next,
as in the megakernel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import cuda, types
from numpy.typing import NDArray

from ...accel.walk import DONE, IDLE, go_on, idle, leaf_step, node_step, start_walk
from ...kernels.path import Path, shade, start_path
from ...kernels.rays import Hit, Ray, endless_ray, no_ray
from ...kernels.sampler import camera_numbers, direction_numbers, sample_number
from ...kernels.vectors import black, xyz
from ...lang import INF, as_float, as_int, i32, kernel, load, read4, stack_ints, store, u32, write4
from ...lang.cuda import cuda_entry
from ...pack.layout import INSTANCES
from .film import add_samples
from .work import FETCHED_PATHS, FETCHED_SHADOWS, PATHS, SHADOWS, finite_or_counted, lanes_before, place_of

_ALL = 0xFFFFFFFF

# Rows of four floats of a slot: 0 origin, density; 1 direction, depth; 2 throughput, sample; 3 light, medium;
# 4 distance, primitive, instance where there are any. Rows of a shadow ray: 5 origin, end; 6 direction, slot; 7 light.
ROWS = 8
_HIT, _SHADOW = i32(4), i32(5)

BLOCKS_PER_MULTIPROCESSOR = 16
# When the lanes of a tracing warp fetch further rays, and when they test triangles (measured).
_FETCH_AT, _LEAF_AT, _NODE_STEPS = 8, 8, 2


class Wave(NamedTuple):
    """One launch of a stage: the samples first .. last - 1 of the pixels of `items` work items from `base` on."""

    counters: NDArray[Any]  # (COUNTERS,) uint32
    state: NDArray[Any]  # (slots * ROWS * 4,) float32
    queue: NDArray[Any]  # (2 * slots,) int32
    base: i32
    items: i32
    slots: i32  # some planes of items, each of which renders its share of the samples
    share: u32
    parity: i32  # which of the two queues is worked through; the other one is filled
    first: u32
    last: u32


WAVE_TYPE = types.NamedTuple(
    (
        *(types.Array(kind, 1, "C") for kind in (types.uint32, types.float32, types.int32)),
        *([types.int32] * 3),
        types.uint32,
        types.int32,
        *([types.uint32] * 2),
    ),
    Wave,
)


@kernel
def at(wave, row, slot):
    """Where a row of a slot begins."""
    return (row * wave.slots + slot) * 4


@kernel
def reserve(wanted, counters, which):
    """Different numbers, counted on, for the lanes that want one: one atomic a warp; all of its lanes must call it."""
    votes = cuda.ballot_sync(_ALL, wanted)
    lane = i32(cuda.laneid)
    base = i32(0)
    if lane == 0 and votes != 0:
        base = i32(cuda.atomic.add(counters, which, u32(cuda.popc(votes))))
    base = cuda.shfl_sync(_ALL, base, 0)
    return i32(base + i32(cuda.popc(u32(u32(votes) & lanes_before()))))


@kernel
def enqueue(wanted, wave, parity, slot):
    """Put the slots of the lanes that want it into one of the two queues."""
    k = reserve(wanted, wave.counters, i32(PATHS + parity))
    if wanted:
        store(wave.queue, parity * wave.slots + k, slot)


@kernel
def place_of_slot(view, wave, slot):
    """Column and row on the film of a slot's pixel."""
    return place_of(u32(wave.base + i32(u32(slot) % u32(wave.items))), view.film_width)


@kernel
def samples_of_slot(wave, slot):
    """The first sample of a slot, and that behind its last."""
    plane = u32(u32(slot) // u32(wave.items))
    first = min(u32(wave.first + plane * wave.share), wave.last)
    return first, min(u32(first + wave.share), wave.last)


@kernel
def new_path(scene, view, column, row, sample):
    """The camera path of a sample of a place on the film."""
    x = i32(view.left + column)
    y = i32(view.top + row)
    number = sample_number(scene, view, x, y, sample)
    numbers = camera_numbers(scene, number.pixel, number.sample, view.seed)
    return start_path(scene, view, x, y, numbers)


@kernel
def store_path(wave, slot, path, sample):
    """The path of a slot."""
    ray = path.ray
    write4(wave.state, at(wave, 0, slot), ray.o.x, ray.o.y, ray.o.z, path.pdf)
    write4(wave.state, at(wave, 1, slot), ray.d.x, ray.d.y, ray.d.z, as_float(path.depth))
    t = path.throughput
    write4(wave.state, at(wave, 2, slot), t.x, t.y, t.z, as_float(i32(sample)))


@kernel
def store_light(wave, slot, light, medium):
    """The light that a slot has gathered, and the medium of its path."""
    write4(wave.state, at(wave, 3, slot), light.x, light.y, light.z, as_float(medium))


def wf_start(scene, view, film, wave):
    """Begin the first sample of every slot."""
    slot = i32(cuda.grid(1))
    column, row = place_of_slot(view, wave, slot)
    first, behind = samples_of_slot(wave, slot)
    there = (slot < wave.slots) & (column < view.film_width) & (row < view.film_height)
    if there:
        path = new_path(scene, view, column, row, first)
        store_path(wave, slot, path, first)
        # `wf_finish` adds up all planes, those without a sample too.
        store_light(wave, slot, black(), path.medium)
        there = first < behind
    cuda.syncwarp()
    enqueue(there, wave, i32(0), slot)


@kernel
def waiting_paths(wave):
    """Paths in the queue."""
    return i32(load(wave.counters, PATHS + wave.parity))


@kernel
def waiting_shadows(wave):
    """Shadow rays in the queue."""
    return i32(load(wave.counters, SHADOWS))


@kernel
def path_ray(wave, item):
    """The ray of a path in the queue."""
    slot = load(wave.queue, wave.parity * wave.slots + item)
    return endless_ray(xyz(read4(wave.state, at(wave, 0, slot))), xyz(read4(wave.state, at(wave, 1, slot))))


@kernel
def store_hit_in_world(scene, wave, item, walk):
    """What the ray of a path in the queue has hit, in a scene without instances."""
    slot = load(wave.queue, wave.parity * wave.slots + item)
    write4(wave.state, at(wave, _HIT, slot), walk.ray.tmax, as_float(walk.primitive), 0.0, 0.0)


@kernel(needs=INSTANCES, otherwise=store_hit_in_world)
def store_hit(scene, wave, item, walk):
    """What the ray of a path in the queue has hit."""
    slot = load(wave.queue, wave.parity * wave.slots + item)
    write4(wave.state, at(wave, _HIT, slot), walk.ray.tmax, as_float(walk.primitive), as_float(walk.instance), 0.0)


@kernel
def shadow_ray(wave, item):
    """A shadow ray in the queue."""
    o = read4(wave.state, at(wave, _SHADOW, item))
    return Ray(xyz(o), xyz(read4(wave.state, at(wave, i32(_SHADOW + 1), item))), o[3])


@kernel
def gather_light(scene, wave, item, walk):
    """Give the light of a shadow ray to its path, if the ray has hit nothing."""
    if walk.primitive < 0:
        slot = as_int(read4(wave.state, at(wave, i32(_SHADOW + 1), item))[3])
        light = read4(wave.state, at(wave, 3, slot))
        direct = xyz(read4(wave.state, at(wave, i32(_SHADOW + 2), item)))
        store_light(wave, slot, xyz(light) + finite_or_counted(wave.counters, direct), as_int(light[3]))


def _make_trace(
    stack_size: int, any_hit: bool, fetched: int, waiting: Any, ray_of: Any, hand_in: Any
) -> Callable[..., None]:
    """A stage that traces the rays of a queue.

    Args:
        stack_size: links on the stack of a walk.
        any_hit: whether any hit will do, not only the nearest.
        fetched: counter of the rays that lanes have taken on.
        waiting: kernel: the number of rays in the queue of a wave.
        ray_of: kernel: one of them.
        hand_in: kernel: what is done with the walk of one of them in the end.
    """

    def trace(scene, view, film, wave):
        count = waiting(wave)
        item = i32(-1)
        walk = start_walk(no_ray())
        walk = go_on(walk, DONE, i32(0))
        stack = stack_ints(stack_size)
        while True:
            at_leaf = (walk.link < 0) & (walk.link > IDLE)
            at_end = walk.link == DONE
            nodes = cuda.popc(cuda.ballot_sync(_ALL, walk.link >= 0))
            leaves = cuda.popc(cuda.ballot_sync(_ALL, at_leaf))
            ends = cuda.popc(cuda.ballot_sync(_ALL, at_end))
            if nodes + leaves + ends == 0:
                break
            if ends >= _FETCH_AT or nodes + leaves == 0:
                following = reserve(at_end, wave.counters, fetched)
                if at_end:
                    if item >= 0:
                        hand_in(scene, wave, item, walk)
                    item = following
                    walk = start_walk(ray_of(wave, item)) if item < count else idle(walk)
            elif leaves >= _LEAF_AT or nodes < leaves:
                if at_leaf:
                    walk = leaf_step(scene, walk, stack, any_hit)
            else:
                for _ in range(_NODE_STEPS):
                    if walk.link >= 0:
                        walk = node_step(scene, walk, stack)
            cuda.syncwarp()

    return trace


def wf_shade(scene, view, film, wave):
    """Shade what the paths have hit; what goes on is queued, and so are the shadow rays."""
    i = i32(cuda.grid(1))
    going = False
    shadowed = False
    slot = i32(0)
    shadow = no_ray()
    direct = black()
    if i < waiting_paths(wave):
        slot = load(wave.queue, wave.parity * wave.slots + i)
        o = read4(wave.state, at(wave, 0, slot))
        d = read4(wave.state, at(wave, 1, slot))
        t = read4(wave.state, at(wave, 2, slot))
        light = read4(wave.state, at(wave, 3, slot))
        found = read4(wave.state, at(wave, _HIT, slot))
        sample = u32(as_int(t[3]))
        depth = as_int(d[3])
        column, row = place_of_slot(view, wave, slot)
        number = sample_number(scene, view, i32(view.left + column), i32(view.top + row), sample)
        path = Path(Ray(xyz(o), xyz(d), INF), xyz(t), o[3], depth, as_int(light[3]), True)
        numbers = direction_numbers(scene, number.pixel, number.sample, view.seed, depth)
        hit = Hit(found[0], as_int(found[1]), as_int(found[2]))
        step = shade(scene, view, path, hit, numbers, number.pixel, number.sample)
        shadow = step.shadow
        direct = step.direct
        shadowed = shadow.tmax > 0.0
        path = step.path
        going = path.alive
        if not going:
            # The slot's next sample begins at once.
            sample = u32(sample + u32(1))
            _, behind = samples_of_slot(wave, slot)
            going = sample < behind
            path = new_path(scene, view, column, row, sample)
        store_path(wave, slot, path, sample)
        store_light(wave, slot, xyz(light) + finite_or_counted(wave.counters, step.emitted), path.medium)
    cuda.syncwarp()
    j = reserve(shadowed, wave.counters, SHADOWS)
    if shadowed:
        write4(wave.state, at(wave, _SHADOW, j), shadow.o.x, shadow.o.y, shadow.o.z, shadow.tmax)
        write4(wave.state, at(wave, i32(_SHADOW + 1), j), shadow.d.x, shadow.d.y, shadow.d.z, as_float(slot))
        write4(wave.state, at(wave, i32(_SHADOW + 2), j), direct.x, direct.y, direct.z, 0.0)
    enqueue(going, wave, i32(1 - wave.parity), slot)


def wf_turn(scene, view, film, wave):
    """The queue just worked through is empty now, and so is that of the shadow rays."""
    if cuda.grid(1) == 0:
        store(wave.counters, PATHS + wave.parity, u32(0))
        store(wave.counters, SHADOWS, u32(0))
        store(wave.counters, FETCHED_PATHS, u32(0))
        store(wave.counters, FETCHED_SHADOWS, u32(0))


def wf_finish(scene, view, film, wave):
    """Add what the slots of each pixel have gathered to the film."""
    item = i32(cuda.grid(1))
    column, row = place_of(u32(wave.base + item), view.film_width)
    if (item < wave.items) & (column < view.film_width) & (row < view.film_height):
        light = black()
        for plane in range(wave.slots // wave.items):
            light = light + xyz(read4(wave.state, at(wave, 3, i32(plane * wave.items + item))))
        add_samples(film, i32(row * view.film_width + column), light)


TRACING = ("extend", "shadow")
"""Stages that run as many threads as the GPU holds."""


def make_wavefront(stack_size: int) -> dict[str, Callable[..., None]]:
    """The kernels of the wavefront by name; all take the scene, the view, the film and a `Wave`."""
    extend = _make_trace(stack_size, False, FETCHED_PATHS, waiting_paths, path_ray, store_hit)
    shadow = _make_trace(stack_size, True, FETCHED_SHADOWS, waiting_shadows, shadow_ray, gather_light)
    stages = {"start": wf_start, "extend": extend, "shade": wf_shade, "shadow": shadow, "turn": wf_turn}
    return {name: cuda_entry(stage) for name, stage in {**stages, "finish": wf_finish}.items()}
