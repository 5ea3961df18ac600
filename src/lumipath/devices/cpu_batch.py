"""The CPU's scheduler: each thread takes tiles and advances a batch of paths through them, one bounce at a time.

A batch is generated, then traced, shaded and connected to the lights in turn, so that each of these loops stays in the
instruction cache and its state in the L2 cache. The physics is in `kernels`; here is only the order of things.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..accel.packets import SORT_KEYS, Order, Rays, trace_rays
from ..accel.trace8 import primitive_of
from ..kernels.adaptive import add_square, goal_of, square_of
from ..kernels.emitted_layers import emitted_to_layers
from ..kernels.light_layers import all_columns, light_columns, squares_to_layer, to_layers
from ..kernels.path import Path, shade, start_path
from ..kernels.rays import Hit, Ray
from ..kernels.sampler import Numbers, camera_numbers, direction_numbers
from ..lang import INF, Vec3, aligned_empty, entry, fetch_add, i32, kernel, load, read_clock, store, u32
from ..pack.layout import GROUPS, INSTANCES, TILE
from .cpu_film import add_exactly, add_to_film, put_in_film

TILE_PIXELS = i32(256)
BATCH = i32(4096)
"""Paths in flight in each thread; a multiple of TILE_PIXELS."""

STRIDE = i32(4096 + 64)
"""Length of a batch's arrays: vector code reads and writes a little behind the last path."""

# Slots of `control`.
NEXT_TILE = i32(0)
CANCELLED = i32(1)
REJECTED = i32(2)
FINISHED_TILES = i32(3)


class Paths(NamedTuple):
    """What goes with the rays of paths: throughput, density, medium, and the path's number in the batch."""

    red: NDArray[Any]
    green: NDArray[Any]
    blue: NDArray[Any]
    pdf: NDArray[Any]
    medium: NDArray[Any]
    owner: NDArray[Any]


class Light(NamedTuple):
    """Radiance: of each path of the batch, or of each shadow ray."""

    red: NDArray[Any]
    green: NDArray[Any]
    blue: NDArray[Any]


class Batch(NamedTuple):
    """The scratch memory of one thread."""

    rays: Rays
    paths: Paths
    shadows: Rays
    shadow_light: Light
    shadow_owner: NDArray[Any]
    shadow_group: NDArray[Any]  # light group of each shadow ray
    gathered: Light
    parts: NDArray[Any]  # (columns * STRIDE,) float32: what goes to each column of `FilmArrays.parts`
    samples: NDArray[Any]  # (2, STRIDE) uint32: pixel and sample of each path
    draws: NDArray[Any]  # (4, STRIDE) float32: random numbers of each path, as in `direction_numbers`
    order: Order
    clock: NDArray[Any]  # (5,) int64: cycles spent in generate, extend, shade, connect, develop


def new_batch(columns: int = 0) -> Batch:
    """Scratch memory for one thread, for a film with so many columns of layers."""
    size = int(STRIDE)

    def floats(count: int) -> list[np.ndarray]:
        return [aligned_empty(size, np.float32) for _ in range(count)]

    def ints(count: int) -> list[np.ndarray]:
        return [aligned_empty(size, np.int32) for _ in range(count)]

    def rays() -> Rays:
        return Rays(*floats(7), *ints(2))

    return Batch(
        rays=rays(),
        paths=Paths(*floats(4), *ints(2)),
        shadows=rays(),
        shadow_light=Light(*floats(3)),
        shadow_owner=ints(1)[0],
        shadow_group=ints(1)[0],
        gathered=Light(*floats(3)),
        parts=aligned_empty(max(columns, 1) * size, np.float32),
        samples=aligned_empty((2, size), np.uint32),
        draws=aligned_empty((4, size), np.float32),
        order=Order(*ints(2), aligned_empty(SORT_KEYS, np.int32)),
        clock=np.zeros(5, np.int64),
    )


@kernel
def vec3_at(x, y, z, i):
    """A vector from three arrays."""
    return Vec3(load(x, i), load(y, i), load(z, i))


@kernel
def store_vec3(x, y, z, i, v):
    """A vector into three arrays."""
    store(x, i, v.x)
    store(y, i, v.y)
    store(z, i, v.z)


@kernel
def add_light(light, i, radiance):
    """Add radiance to a path of the batch."""
    store(light.red, i, load(light.red, i) + radiance.x)
    store(light.green, i, load(light.green, i) + radiance.y)
    store(light.blue, i, load(light.blue, i) + radiance.z)


@kernel
def put_in_batch(scene, batch, i, column, value):
    """Add three numbers to the columns of a path of the batch."""
    at = column * STRIDE + i
    store(batch.parts, at, load(batch.parts, at) + value.x)
    store(batch.parts, at + STRIDE, load(batch.parts, at + STRIDE) + value.y)
    store(batch.parts, at + 2 * STRIDE, load(batch.parts, at + 2 * STRIDE) + value.z)


@kernel
def store_ray(rays, i, ray):
    """A ray into the arrays."""
    store_vec3(rays.ox, rays.oy, rays.oz, i, ray.o)
    store_vec3(rays.dx, rays.dy, rays.dz, i, ray.d)
    store(rays.t, i, ray.tmax)


@kernel
def store_path(batch, i, path, owner, pixel, sample):
    """A path into the arrays."""
    store_ray(batch.rays, i, path.ray)
    store_vec3(batch.paths.red, batch.paths.green, batch.paths.blue, i, path.throughput)
    store(batch.paths.pdf, i, path.pdf)
    store(batch.paths.medium, i, path.medium)
    store(batch.paths.owner, i, owner)
    store(batch.samples, i, pixel)
    store(batch.samples, STRIDE + i, sample)


@kernel
def load_path(batch, i, depth):
    """A path from the arrays."""
    rays = batch.rays
    paths = batch.paths
    ray = Ray(vec3_at(rays.ox, rays.oy, rays.oz, i), vec3_at(rays.dx, rays.dy, rays.dz, i), INF)
    throughput = vec3_at(paths.red, paths.green, paths.blue, i)
    return Path(ray, throughput, load(paths.pdf, i), depth, load(paths.medium, i), True)


@kernel
def hit_in_world(scene, rays, i):
    """What a ray has hit, in a scene without instances."""
    return Hit(load(rays.t, i), primitive_of(scene.accel, load(rays.slot, i)), i32(-1))


@kernel(needs=INSTANCES, otherwise=hit_in_world)
def hit_of(scene, rays, i):
    """What a ray has hit."""
    return Hit(load(rays.t, i), primitive_of(scene.accel, load(rays.slot, i)), load(rays.instance, i))


@kernel
def generate(scene, view, batch, column, row, columns, rows, first, samples):
    """Camera rays for `samples` samples of each pixel of a tile, those of a pixel one after the other."""
    n = i32(0)
    for y in range(rows):
        for x in range(columns):
            pixel = u32((row + y) * view.width + column + x)
            for s in range(samples):
                sample = u32(view.first_sample + u32(first + s))
                numbers = camera_numbers(scene, pixel, sample, view.seed)
                path = start_path(scene, view, i32(column + x), i32(row + y), numbers)
                store_path(batch, n, path, n, pixel, sample)
                store_vec3(batch.gathered.red, batch.gathered.green, batch.gathered.blue, n, Vec3(0, 0, 0))
                n = i32(n + 1)
    return n


@kernel
def clear_layers(scene, batch, n):
    """No light in the layers of the paths."""
    for column in range(light_columns(scene)):
        for i in range(n):
            store(batch.parts, column * STRIDE + i, 0.0)


@kernel
def draw_numbers(scene, view, batch, n, depth):
    """The random numbers of all paths, in a loop of its own, which becomes SIMD code."""
    for i in range(n):
        pixel = load(batch.samples, i)
        sample = load(batch.samples, STRIDE + i)
        numbers = direction_numbers(scene, pixel, sample, view.seed, depth)
        store(batch.draws, i, numbers.a)
        store(batch.draws, STRIDE + i, numbers.b)
        store(batch.draws, 2 * STRIDE + i, numbers.c)
        store(batch.draws, 3 * STRIDE + i, numbers.d)


@kernel
def store_no_group(scene, batch, i, group):
    """Nobody asks for light groups."""


@kernel(needs=GROUPS, otherwise=store_no_group)
def store_group(scene, batch, i, group):
    """The light group of a shadow ray into the arrays."""
    store(batch.shadow_group, i, group)


@kernel
def one_group_at(scene, batch, i):
    """Nobody asks for light groups."""
    return i32(0)


@kernel(needs=GROUPS, otherwise=one_group_at)
def group_at(scene, batch, i):
    """The light group of a shadow ray."""
    return load(batch.shadow_group, i)


@kernel
def shade_batch(scene, view, batch, n, depth):
    """Shade all hits; the paths that go on move to the front. Returns how many, and the number of shadow rays."""
    draw_numbers(scene, view, batch, n, depth)
    draws = batch.draws
    light = batch.shadow_light
    going = i32(0)
    shadows = i32(0)
    for i in range(n):
        path = load_path(batch, i, depth)
        hit = hit_of(scene, batch.rays, i)
        owner = load(batch.paths.owner, i)
        numbers = Numbers(
            load(draws, i), load(draws, STRIDE + i), load(draws, 2 * STRIDE + i), load(draws, 3 * STRIDE + i)
        )
        pixel = load(batch.samples, i)
        sample = load(batch.samples, STRIDE + i)
        step = shade(scene, view, path, hit, numbers, pixel, sample)
        add_light(batch.gathered, owner, step.emitted)
        emitted_to_layers(scene, put_in_batch, batch, owner, depth, hit.primitive < 0, step, step.emitted)
        # Written in any case and kept only if there is one: a branch could not be predicted.
        store_ray(batch.shadows, shadows, step.shadow)
        store_vec3(light.red, light.green, light.blue, shadows, step.direct)
        store(batch.shadow_owner, shadows, owner)
        store_group(scene, batch, shadows, step.light)
        shadows = i32(shadows + (1 if step.shadow.tmax > 0.0 else 0))
        if step.path.alive:
            store_path(batch, going, step.path, owner, pixel, sample)
            going = i32(going + 1)
    return going, shadows


@kernel
def connect(scene, batch, shadows, events):
    """Gather the light of the shadow rays that nothing stopped, after so many scattering events."""
    light = batch.shadow_light
    for i in range(shadows):
        if load(batch.shadows.slot, i) < 0:
            owner = load(batch.shadow_owner, i)
            radiance = vec3_at(light.red, light.green, light.blue, i)
            add_light(batch.gathered, owner, radiance)
            to_layers(scene, put_in_batch, batch, owner, events, group_at(scene, batch, i), radiance)


@kernel
def develop_layers(scene, film, place, batch, owner):
    """Add the layers of a sample to those of its pixel."""
    for column in range(light_columns(scene)):
        at = place * all_columns(scene) + column
        add_exactly(film.parts, film.parts_lost, at, load(batch.parts, column * STRIDE + owner))


@kernel
def develop(scene, view, film, batch, column, row, columns, rows, samples):
    """Add the batch to the film, sample by sample, so that the sum does not depend on how samples were batched.

    Returns how many samples were not finite and counted as black.
    """
    rejected = 0
    owner = i32(0)
    gathered = batch.gathered
    for y in range(rows):
        for x in range(columns):
            place = (row - view.top + y) * view.film_width + column - view.left + x
            for _ in range(samples):
                c = vec3_at(gathered.red, gathered.green, gathered.blue, owner)
                if abs(c.x + c.y + c.z) < INF:
                    add_to_film(film, place * 3, c.x)
                    add_to_film(film, place * 3 + 1, c.y)
                    add_to_film(film, place * 3 + 2, c.z)
                    add_square(scene, film, place, square_of(scene, c))
                    develop_layers(scene, film, place, batch, owner)
                    squares_to_layer(scene, put_in_film, film, place, c)
                else:
                    rejected += 1
                owner = i32(owner + 1)
            store(film.counts, place, u32(load(film.counts, place) + u32(samples)))
    return rejected


@kernel
def lap(clock, stage, since):
    """Add the cycles since `since` to a stage; returns the time now."""
    now = read_clock()
    store(clock, stage, load(clock, stage) + now - since)
    return now


@kernel
def render_tile(scene, view, film, batch, column, row, columns, rows, first, samples):
    """Some samples of each pixel of a tile."""
    time = read_clock()
    n = generate(scene, view, batch, column, row, columns, rows, first, samples)
    clear_layers(scene, batch, n)
    time = lap(batch.clock, 0, time)
    depth = i32(0)
    shadows = i32(0)
    # Not a literal: `trace_rays` would be compiled for it, and once more for any bool.
    connecting = shadows > 0
    while n + shadows > 0:
        # One call for rays of both kinds: traversal is most of the machine code, and is compiled once this way.
        rays = batch.shadows if connecting else batch.rays
        trace_rays(scene, rays, shadows if connecting else n, batch.order, connecting, depth == 0)
        time = lap(batch.clock, 3 if connecting else 1, time)
        if connecting:
            connect(scene, batch, shadows, depth)
            time = lap(batch.clock, 3, time)
            shadows = i32(0)
        else:
            n, shadows = shade_batch(scene, view, batch, n, depth)
            time = lap(batch.clock, 2, time)
            depth = i32(depth + 1)
        connecting = shadows > 0
    rejected = develop(scene, view, film, batch, column, row, columns, rows, samples)
    lap(batch.clock, 4, time)
    return rejected


@entry
def render_tiles(scene, view, film, batch, control, last):
    """Render tiles until there are no more, or the render is cancelled.

    Args:
        scene: PackedScene with a BVH8.
        view: View.
        film: FilmArrays; each pixel gets the samples from its count up to `last`, or to the goal of its tile.
        batch: scratch of this thread.
        control: (4,) int64, shared by the threads.
        last: number of samples that each pixel has afterwards, unless its tile has a lower goal.
    """
    across = (view.film_width + TILE - 1) // TILE
    down = (view.film_height + TILE - 1) // TILE
    while fetch_add(control, CANCELLED, 0) == 0:
        tile = fetch_add(control, NEXT_TILE, 1)
        if tile >= across * down:
            break
        x = i32(tile % across) * TILE
        y = i32(tile // across) * TILE
        columns = min(TILE, i32(view.film_width - x))
        rows = min(TILE, i32(view.film_height - y))
        room = i32(BATCH // (columns * rows))
        first = i32(load(film.counts, y * view.film_width + x))
        end = goal_of(scene, film, tile, last)
        while first < end:
            samples = min(room, i32(end - first))
            rejected = render_tile(
                scene,
                view,
                film,
                batch,
                i32(view.left + x),
                i32(view.top + y),
                columns,
                rows,
                first,
                samples,
            )
            fetch_add(control, REJECTED, rejected)
            first = i32(first + samples)
        fetch_add(control, FINISHED_TILES, 1)
