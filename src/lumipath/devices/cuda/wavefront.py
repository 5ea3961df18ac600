"""One kernel a stage: extend, shade, shadow, in turns, until every path has ended.

A slot belongs to a pixel and carries one path at a time; its state lies in global memory. The stages work through a
queue of slots, from which those with nothing left to do are removed now and then. Neighbours in the image stay
neighbours in the queue: their rays meet the same boxes, and their state lies together. Only within a block of the stage
that shades do paths change places. They are sorted by what has to be computed for them, so that the lanes of a warp do
the same thing, and paths that end are replaced by warps full of new ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import cuda, int32, types, uint32
from numpy.typing import NDArray

from ...kernels.bsdf.values import slot as parameters_at
from ...kernels.instances import placed_material
from ...kernels.path import Path, shade, start_path
from ...kernels.rays import Hit, Ray, endless_ray, no_ray
from ...kernels.sampler import camera_numbers, direction_numbers, sample_number
from ...kernels.vectors import black, xyz
from ...lang import INF, as_float, as_int, f32, i32, kernel, load, load4, read4, store, u32, write4
from ...lang.cuda import cuda_entry
from ...pack.layout import BSDFS, LOBES_KIND, MATERIAL_MASK, PRIMITIVE_SIZE, PRINCIPLED_KIND
from .film import add_samples
from .tracing import Rays, make_refilling_trace, make_voting_trace
from .work import (
    ALL_LANES,
    FETCHED_PATHS,
    FETCHED_SHADOWS,
    PATHS,
    SHADOWS,
    finite_or_counted,
    lanes_before,
    place_of,
    reserve,
)

# Rows of four floats of a slot: 0 origin, density; 1 direction, depth or -1 where nothing is left to do; 2 throughput,
# sample; 3 light, medium; 4 distance, primitive, instance. Rows of a shadow ray: 5 origin, end; 6 direction, slot;
# 7 light.
ROWS = 8
_HIT, _SHADOW = i32(4), i32(5)
_NONE = i32(-1)

# Paths are sorted by what was hit: the kinds of BSDFs, nothing at all, or there was no path to begin with.
_ESCAPED, _NO_PATH = i32(PRINCIPLED_KIND + 1), i32(PRINCIPLED_KIND + 2)
_GROUPS = int(_NO_PATH) + 1
# Shared numbers of a block that shades: paths of each group, shadow rays and their place among all, paths that ended.
_SHADOWED, _SHADOWS_AT, _OVER = (u32(_GROUPS + k) for k in range(3))
_COUNTS = _GROUPS + 3
# A number of the queue is a slot and, above it, the group of its path.
_GROUP_SHIFT = i32(28)
_SLOT_MASK = i32((1 << 28) - 1)


class Wave(NamedTuple):
    """One launch of a stage: the samples first .. last - 1 of the pixels of `items` work items from `base` on."""

    counters: NDArray[Any]  # (COUNTERS,) uint32
    state: NDArray[Any]  # (slots * ROWS * 4,) float32
    queue: NDArray[Any]  # (2 * slots,) int32
    base: i32
    items: i32
    slots: i32  # some planes of items, each of which renders its share of the samples
    share: u32
    parity: i32  # which of the two queues is worked through
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
def paths_in_queue(wave):
    """How many slots wait in the queue."""
    return i32(load(wave.counters, PATHS + wave.parity))


@kernel
def shadow_rays(wave):
    """How many shadow rays wait."""
    return i32(load(wave.counters, SHADOWS))


@kernel
def queued(wave, item):
    """A number of the queue."""
    return load(wave.queue, wave.parity * wave.slots + item)


@kernel
def slot_of(number):
    """The slot that a number of the queue stands for."""
    return i32(number & _SLOT_MASK)


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
def store_path(wave, slot, path, sample, there):
    """The path of a slot, or that it has none."""
    ray = path.ray
    write4(wave.state, at(wave, 0, slot), ray.o.x, ray.o.y, ray.o.z, path.pdf)
    depth = path.depth if there else _NONE
    write4(wave.state, at(wave, 1, slot), ray.d.x, ray.d.y, ray.d.z, as_float(depth))
    t = path.throughput
    write4(wave.state, at(wave, 2, slot), t.x, t.y, t.z, as_float(i32(sample)))


@kernel
def load_path(wave, slot):
    """The path of a slot, and the number of its sample."""
    o = read4(wave.state, at(wave, 0, slot))
    d = read4(wave.state, at(wave, 1, slot))
    t = read4(wave.state, at(wave, 2, slot))
    medium = as_int(read4(wave.state, at(wave, 3, slot))[3])
    return Path(endless_ray(xyz(o), xyz(d)), xyz(t), o[3], as_int(d[3]), medium, True), u32(as_int(t[3]))


@kernel
def load_hit(wave, slot):
    """What the ray of a slot's path has hit."""
    found = read4(wave.state, at(wave, _HIT, slot))
    return Hit(found[0], as_int(found[1]), as_int(found[2]))


@kernel
def store_light(wave, slot, light, medium):
    """The light that a slot has gathered, and the medium of its path."""
    write4(wave.state, at(wave, 3, slot), light.x, light.y, light.z, as_float(medium))


def wf_start(scene, view, film, wave):
    """Begin the first sample of every slot."""
    slot = i32(cuda.grid(1))
    if slot < wave.slots:
        column, row = place_of_slot(view, wave, slot)
        first, behind = samples_of_slot(wave, slot)
        on_film = (column < view.film_width) & (row < view.film_height)
        path = new_path(scene, view, column, row, first)
        store_path(wave, slot, path, first, on_film & (first < behind))
        # `wf_finish` adds up all planes, those without a sample too.
        store_light(wave, slot, black(), path.medium)
        store(wave.queue, slot, slot)
    if slot == 0:
        store(wave.counters, PATHS, u32(wave.slots))


@kernel
def path_ray(wave, item):
    """The ray of a path in the queue; it ends before it begins where nothing is left to do."""
    slot = slot_of(queued(wave, item))
    d = read4(wave.state, at(wave, 1, slot))
    end = INF if as_int(d[3]) >= 0 else f32(-1.0)
    return Ray(xyz(read4(wave.state, at(wave, 0, slot))), xyz(d), end)


@kernel
def lobes_group(scene, hit):
    """A scene whose materials are all sums of lobes."""
    return LOBES_KIND


@kernel(needs=BSDFS, otherwise=lobes_group)
def surface_group(scene, hit):
    """The kind of the BSDF that was hit; that of a mix as a whole will do."""
    word = as_int(load4(scene.primitives, hit.primitive * PRIMITIVE_SIZE)[3])
    material = placed_material(scene, hit.instance, i32(word & MATERIAL_MASK))
    return as_int(parameters_at(scene, material, i32(0))[0])


@kernel
def store_hit(scene, wave, item, hit):
    """What the ray of a path in the queue has hit, and which group that puts it into."""
    slot = slot_of(queued(wave, item))
    # Its sign, without arithmetic: it may be infinite.
    group = _ESCAPED if as_int(hit.t) >= 0 else _NO_PATH
    if hit.primitive >= 0:
        group = surface_group(scene, hit)
    store(wave.queue, wave.parity * wave.slots + item, i32(slot | (group << _GROUP_SHIFT)))
    write4(wave.state, at(wave, _HIT, slot), hit.t, as_float(hit.primitive), as_float(hit.instance), 0.0)


@kernel
def shadow_ray(wave, item):
    """A shadow ray."""
    o = read4(wave.state, at(wave, _SHADOW, item))
    return Ray(xyz(o), xyz(read4(wave.state, at(wave, i32(_SHADOW + 1), item))), o[3])


@kernel
def store_shadow(wave, item, shadow, slot, direct):
    """A shadow ray of a slot's path, and the light that it brings if it hits nothing."""
    write4(wave.state, at(wave, _SHADOW, item), shadow.o.x, shadow.o.y, shadow.o.z, shadow.tmax)
    write4(wave.state, at(wave, i32(_SHADOW + 1), item), shadow.d.x, shadow.d.y, shadow.d.z, as_float(slot))
    write4(wave.state, at(wave, i32(_SHADOW + 2), item), direct.x, direct.y, direct.z, 0.0)


@kernel
def gather_light(scene, wave, item, hit):
    """Give the light of a shadow ray to its path, if the ray has hit nothing."""
    if hit.primitive < 0:
        slot = as_int(read4(wave.state, at(wave, i32(_SHADOW + 1), item))[3])
        light = read4(wave.state, at(wave, 3, slot))
        direct = xyz(read4(wave.state, at(wave, i32(_SHADOW + 2), item)))
        store_light(wave, slot, xyz(light) + finite_or_counted(wave.counters, direct), as_int(light[3]))


@kernel
def clear_shadows(wave):
    """No shadow ray waits: `shade` begins to count them."""
    store(wave.counters, SHADOWS, u32(0))
    store(wave.counters, FETCHED_SHADOWS, u32(0))


@kernel
def clear_nothing(wave):
    """What `shade` has counted is still wanted."""


@kernel
def sort_block(wave, counts, order):
    """Sort the slots of a block by group, -1 in place of those with nothing to do, which come last."""
    thread = u32(cuda.threadIdx.x)
    if thread < _COUNTS:
        counts[thread] = u32(0)
    cuda.syncthreads()
    item = i32(cuda.grid(1))
    slot = i32(-1)
    group = _NO_PATH
    if item < paths_in_queue(wave):
        number = queued(wave, item)
        slot = slot_of(number)
        group = i32(number >> _GROUP_SHIFT) & i32(15)
    # One addition for all lanes of a warp that are in the same group.
    alike = u32(cuda.match_any_sync(ALL_LANES, group))
    first = i32(cuda.ffs(alike)) - 1
    before = i32(0)
    if i32(cuda.laneid) == first:
        before = i32(cuda.atomic.add(counts, u32(group), u32(cuda.popc(alike))))
    place = i32(cuda.shfl_sync(ALL_LANES, before, first) + i32(cuda.popc(u32(alike & lanes_before()))))
    cuda.syncthreads()
    for k in range(_GROUPS - 1):
        place = i32(place + (i32(counts[u32(k)]) if i32(k) < group else i32(0)))
    order[u32(place)] = slot if group < _NO_PATH else i32(-1)
    cuda.syncthreads()


@kernel
def begin_next(scene, view, wave, slot):
    """Begin the next sample of a slot, or leave it with nothing to do."""
    sample = u32(u32(as_int(read4(wave.state, at(wave, 2, slot))[3])) + u32(1))
    _, behind = samples_of_slot(wave, slot)
    column, row = place_of_slot(view, wave, slot)
    path = new_path(scene, view, column, row, sample)
    store_path(wave, slot, path, sample, sample < behind)
    store(wave.state, at(wave, 3, slot) + 3, as_float(path.medium))


def _make_shade(block: int) -> Callable[..., None]:
    """The stage that shades what paths have hit, in blocks of so many threads."""

    def wf_shade(scene, view, film, wave):
        counts = cuda.shared.array(_COUNTS, uint32)
        order = cuda.shared.array(block, int32)
        sort_block(wave, counts, order)
        slot = i32(order[u32(cuda.threadIdx.x)])
        shadow = no_ray()
        direct = black()
        over = False
        if slot >= 0:
            path, sample = load_path(wave, slot)
            light = xyz(read4(wave.state, at(wave, 3, slot)))
            column, row = place_of_slot(view, wave, slot)
            number = sample_number(scene, view, i32(view.left + column), i32(view.top + row), sample)
            numbers = direction_numbers(scene, number.pixel, number.sample, view.seed, path.depth)
            step = shade(scene, view, path, load_hit(wave, slot), numbers, number.pixel, number.sample)
            shadow = step.shadow
            direct = step.direct
            over = not step.path.alive
            if step.path.alive:
                store_path(wave, slot, step.path, sample, True)
            store_light(wave, slot, light + finite_or_counted(wave.counters, step.emitted), step.path.medium)
        cuda.syncwarp()
        thread = u32(cuda.threadIdx.x)
        shadowed = shadow.tmax > 0.0
        item = reserve(shadowed, counts, _SHADOWED)
        place = reserve(over, counts, _OVER)
        cuda.syncthreads()
        if thread == 0:
            counts[_SHADOWS_AT] = cuda.atomic.add(wave.counters, SHADOWS, counts[_SHADOWED])
        if over:
            order[u32(place)] = slot
        cuda.syncthreads()
        if shadowed:
            store_shadow(wave, i32(item + i32(counts[_SHADOWS_AT])), shadow, slot, direct)
        # Few paths end in each warp: gathered, they fill some warps.
        if thread < counts[_OVER]:
            begin_next(scene, view, wave, i32(order[thread]))
        if cuda.grid(1) == 0:
            store(wave.counters, FETCHED_PATHS, u32(0))
            store(wave.counters, PATHS + 1 - wave.parity, u32(0))

    return wf_shade


def wf_compact(scene, view, film, wave):
    """Fill the other queue with the slots of this one that have something left to do."""
    counts = cuda.shared.array(2, uint32)
    if cuda.threadIdx.x == 0:
        counts[u32(0)] = u32(0)
    cuda.syncthreads()
    item = i32(cuda.grid(1))
    slot = i32(0)
    going = False
    if item < paths_in_queue(wave):
        slot = slot_of(queued(wave, item))
        going = as_int(read4(wave.state, at(wave, 1, slot))[3]) >= 0
    cuda.syncwarp()
    other = i32(1 - wave.parity)
    place = reserve(going, counts, u32(0))
    cuda.syncthreads()
    if cuda.threadIdx.x == 0:
        counts[u32(1)] = cuda.atomic.add(wave.counters, i32(PATHS + other), counts[u32(0)])
    cuda.syncthreads()
    if going:
        store(wave.queue, other * wave.slots + i32(counts[u32(1)]) + place, slot)


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
"""Stages that trace rays."""


def make_wavefront(stack_size: int, voting: bool, shade_block: int) -> dict[str, Callable[..., None]]:
    """The kernels of the wavefront by name; all take the scene, the view, the film and a `Wave`.

    Args:
        stack_size: links on the stack of a walk.
        voting: how rays are traced: the way for large trees, or that for small ones.
        shade_block: threads of a block of `shade`.
    """
    trace = make_voting_trace if voting else make_refilling_trace
    paths = Rays(False, paths_in_queue, path_ray, store_hit, clear_shadows, FETCHED_PATHS)
    shadows = Rays(True, shadow_rays, shadow_ray, gather_light, clear_nothing, FETCHED_SHADOWS)
    stages = {
        "start": wf_start,
        "extend": trace(stack_size, paths),
        "shade": _make_shade(shade_block),
        "shadow": trace(stack_size, shadows),
        "compact": wf_compact,
        "finish": wf_finish,
    }
    return {name: cuda_entry(stage) for name, stage in stages.items()}
