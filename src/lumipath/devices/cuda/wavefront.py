"""One kernel a stage: extend, shade, shadow. Paths wait in queues between them.

A slot belongs to a pixel and carries one path at a time; its state lies in global memory. Each stage works through a
queue of slots without gaps and fills the next one, so that all lanes of a warp do the same thing.
"""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.path import Path, shade, start_path
from ...kernels.rays import Hit, Ray, endless_ray
from ...kernels.sampler import direction_numbers
from ...kernels.vectors import xyz
from ...lang import INF, as_float, as_int, i32, kernel, load, read4, stack_ints, u32, write4
from ...lang.cuda import cuda_entry
from .film import add_samples, finite

_ALL = 0xFFFFFFFF

# Rows of four floats of a slot: 0 origin, density; 1 direction, depth; 2 throughput, sample; 3 light, medium;
# 4 distance, primitive. Rows of a shadow ray: 5 origin, end; 6 direction, slot; 7 light.
ROWS = 8
_HIT, _SHADOW = i32(4), i32(5)

# Counters: two queues of paths, which take turns, and the shadow rays.
COUNTERS = 4
SHADOW_COUNTER = i32(2)


@kernel
def at(row, slots, slot):
    """Where a row of a slot begins."""
    return (row * slots + slot) * 4


@kernel
def enqueue(wanted, counters, which):
    """Places in a queue for the lanes that want one, by one atomic a warp; all lanes of the warp must call it."""
    votes = cuda.ballot_sync(_ALL, wanted)
    lane = i32(cuda.laneid)
    base = i32(0)
    if lane == 0 and votes != 0:
        base = i32(cuda.atomic.add(counters, which, u32(cuda.popc(votes))))
    base = cuda.shfl_sync(_ALL, base, 0)
    before = u32(u32(votes) & u32((u32(1) << u32(lane)) - u32(1)))
    return i32(base + i32(cuda.popc(before)))


@kernel
def place_in_image(view, place):
    """Column and row in the full image of a place on the film."""
    return i32(view.left + place % view.film_width), i32(view.top + place // view.film_width)


@kernel
def new_path(scene, view, place, sample):
    """The camera path of a sample."""
    x, y = place_in_image(view, place)
    return start_path(scene, view, x, y, u32(y * view.width + x), sample)


@kernel
def store_path(state, slots, slot, path, sample):
    """The path of a slot."""
    ray = path.ray
    write4(state, at(0, slots, slot), ray.o.x, ray.o.y, ray.o.z, path.pdf)
    write4(state, at(1, slots, slot), ray.d.x, ray.d.y, ray.d.z, as_float(path.depth))
    t = path.throughput
    write4(state, at(2, slots, slot), t.x, t.y, t.z, as_float(i32(sample)))


@kernel
def store_light(state, slots, slot, light, medium):
    """The light that a slot has gathered, and the medium of its path."""
    write4(state, at(3, slots, slot), light.x, light.y, light.z, as_float(medium))


def make_wavefront(stack_size: int) -> dict[str, Any]:
    """The kernels of the wavefront by name; all take the same first arguments."""

    def wf_start(scene, view, film, state, queue, counters, base, slots, first, last, parity):
        slot = i32(cuda.grid(1))
        if slot < slots:
            path = new_path(scene, view, i32(base + slot), u32(first))
            store_path(state, i32(slots), slot, path, u32(first))
            write4(state, at(3, i32(slots), slot), 0.0, 0.0, 0.0, as_float(path.medium))
            queue[slot] = slot

    def wf_extend(scene, view, film, state, queue, counters, base, slots, first, last, parity):
        i = i32(cuda.grid(1))
        if i < i32(load(counters, parity)):
            slot = load(queue, parity * slots + i)
            o = read4(state, at(0, i32(slots), slot))
            d = read4(state, at(1, i32(slots), slot))
            hit = walk_to_end(scene, endless_ray(xyz(o), xyz(d)), False, stack_ints(stack_size))
            write4(state, at(_HIT, i32(slots), slot), hit.t, as_float(hit.primitive), 0.0, 0.0)

    def wf_shade(scene, view, film, state, queue, counters, base, slots, first, last, parity):
        n = i32(slots)
        i = i32(cuda.grid(1))
        going = False
        shadowed = False
        slot = i32(0)
        shadow = Ray(xyz((0.0, 0.0, 0.0)), xyz((0.0, 0.0, 1.0)), 0.0)
        direct = xyz((0.0, 0.0, 0.0))
        if i < i32(load(counters, parity)):
            slot = load(queue, parity * slots + i)
            o = read4(state, at(0, n, slot))
            d = read4(state, at(1, n, slot))
            t = read4(state, at(2, n, slot))
            light = read4(state, at(3, n, slot))
            found = read4(state, at(_HIT, n, slot))
            sample = u32(as_int(t[3]))
            depth = as_int(d[3])
            place = i32(base + slot)
            x, y = place_in_image(view, place)
            pixel = u32(y * view.width + x)
            path = Path(Ray(xyz(o), xyz(d), INF), xyz(t), o[3], depth, as_int(light[3]), True)
            numbers = direction_numbers(scene, pixel, sample, view.seed, depth)
            step = shade(scene, view, path, Hit(found[0], as_int(found[1])), numbers, pixel, sample)
            shadow = step.shadow
            direct = step.direct
            shadowed = shadow.tmax > 0.0
            path = step.path
            going = path.alive
            if not going:
                # The slot's next sample begins at once.
                sample = u32(sample + u32(1))
                going = sample < u32(last)
                path = new_path(scene, view, place, sample)
            store_path(state, n, slot, path, sample)
            store_light(state, n, slot, xyz(light) + finite(step.emitted), path.medium)
        cuda.syncwarp()
        j = enqueue(shadowed, counters, SHADOW_COUNTER)
        if shadowed:
            write4(state, at(_SHADOW, n, j), shadow.o.x, shadow.o.y, shadow.o.z, shadow.tmax)
            write4(state, at(i32(_SHADOW + 1), n, j), shadow.d.x, shadow.d.y, shadow.d.z, as_float(slot))
            write4(state, at(i32(_SHADOW + 2), n, j), direct.x, direct.y, direct.z, 0.0)
        k = enqueue(going, counters, 1 - parity)
        if going:
            queue[(1 - parity) * slots + k] = slot

    def wf_shadow(scene, view, film, state, queue, counters, base, slots, first, last, parity):
        n = i32(slots)
        j = i32(cuda.grid(1))
        if j < i32(load(counters, SHADOW_COUNTER)):
            o = read4(state, at(_SHADOW, n, j))
            d = read4(state, at(i32(_SHADOW + 1), n, j))
            hit = walk_to_end(scene, Ray(xyz(o), xyz(d), o[3]), True, stack_ints(stack_size))
            if hit.primitive < 0:
                slot = as_int(d[3])
                light = read4(state, at(3, n, slot))
                total = xyz(light) + finite(xyz(read4(state, at(i32(_SHADOW + 2), n, j))))
                write4(state, at(3, n, slot), total.x, total.y, total.z, light[3])

    def wf_turn(scene, view, film, state, queue, counters, base, slots, first, last, parity):
        # The queue just worked through is empty now, and so is that of the shadow rays.
        if cuda.grid(1) == 0:
            counters[parity] = u32(0)
            counters[2] = u32(0)

    def wf_finish(scene, view, film, state, queue, counters, base, slots, first, last, parity):
        slot = i32(cuda.grid(1))
        if slot < slots:
            add_samples(film, i32(base + slot), xyz(read4(state, at(3, i32(slots), slot))))

    return {
        function.__name__: cuda_entry(function)
        for function in (wf_start, wf_extend, wf_shade, wf_shadow, wf_turn, wf_finish)
    }
