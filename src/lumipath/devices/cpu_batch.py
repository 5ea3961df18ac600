"""The CPU's scheduler: each thread takes tiles and advances a batch of paths through them, one bounce at a time.

A batch is generated, then traced, shaded and connected to the lights in turn, so that each of these loops stays in the
instruction cache and its state in the L2 cache. The physics is in `kernels`; here is only the order of things.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..accel.trace8 import primitive_of, trace_slot
from ..kernels.path import Path, shade, start_path
from ..kernels.rays import Hit, Ray
from ..lang import INF, Vec3, aligned_empty, entry, fetch_add, i32, kernel, load, store, u32

TILE = i32(16)
TILE_PIXELS = i32(256)
BATCH = i32(4096)
"""Paths in flight in each thread; a multiple of TILE_PIXELS."""

# Slots of `control`.
NEXT_TILE = i32(0)
CANCELLED = i32(1)
REJECTED = i32(2)
FINISHED_TILES = i32(3)


class Rays(NamedTuple):
    """Rays as arrays of components. t: maximum distance, then that of the hit; slot: what was hit, see `trace_slot`."""

    ox: NDArray[Any]
    oy: NDArray[Any]
    oz: NDArray[Any]
    dx: NDArray[Any]
    dy: NDArray[Any]
    dz: NDArray[Any]
    t: NDArray[Any]
    slot: NDArray[Any]


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
    gathered: Light


def new_batch() -> Batch:
    """Scratch memory for one thread."""
    size = int(BATCH) + 64

    def floats(count: int) -> list[np.ndarray]:
        return [aligned_empty(size, np.float32) for _ in range(count)]

    def ints(count: int) -> list[np.ndarray]:
        return [aligned_empty(size, np.int32) for _ in range(count)]

    def rays() -> Rays:
        return Rays(*floats(7), *ints(1))

    return Batch(rays(), Paths(*floats(4), *ints(2)), rays(), Light(*floats(3)), *ints(1), Light(*floats(3)))


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
def store_ray(rays, i, ray):
    """A ray into the arrays."""
    store_vec3(rays.ox, rays.oy, rays.oz, i, ray.o)
    store_vec3(rays.dx, rays.dy, rays.dz, i, ray.d)
    store(rays.t, i, ray.tmax)


@kernel
def store_path(batch, i, path, owner):
    """A path into the arrays."""
    store_ray(batch.rays, i, path.ray)
    store_vec3(batch.paths.red, batch.paths.green, batch.paths.blue, i, path.throughput)
    store(batch.paths.pdf, i, path.pdf)
    store(batch.paths.medium, i, path.medium)
    store(batch.paths.owner, i, owner)


@kernel
def load_path(batch, i, depth):
    """A path from the arrays."""
    rays = batch.rays
    paths = batch.paths
    ray = Ray(vec3_at(rays.ox, rays.oy, rays.oz, i), vec3_at(rays.dx, rays.dy, rays.dz, i), INF)
    throughput = vec3_at(paths.red, paths.green, paths.blue, i)
    return Path(ray, throughput, load(paths.pdf, i), depth, load(paths.medium, i), True)


@kernel
def trace_rays(scene, rays, n, any_hit):
    """Trace rays one by one; t and slot receive the nearest hit, or any."""
    for i in range(n):
        o = vec3_at(rays.ox, rays.oy, rays.oz, i)
        d = vec3_at(rays.dx, rays.dy, rays.dz, i)
        found = trace_slot(scene, o, d, i32(0), load(rays.t, i), any_hit)
        store(rays.t, i, found.t)
        store(rays.slot, i, found.primitive)


@kernel
def generate(scene, view, batch, column, row, columns, rows, first, samples):
    """Camera rays for `samples` samples of each pixel of a tile, those of a pixel one after the other."""
    n = i32(0)
    for y in range(rows):
        for x in range(columns):
            pixel = u32((row + y) * view.width + column + x)
            for s in range(samples):
                path = start_path(scene, view, i32(column + x), i32(row + y), pixel, u32(first + s))
                store_path(batch, n, path, n)
                store_vec3(batch.gathered.red, batch.gathered.green, batch.gathered.blue, n, Vec3(0, 0, 0))
                n += i32(1)
    return n


@kernel
def shade_batch(scene, view, batch, n, depth, column, row, columns, first, samples):
    """Shade all hits; the paths that go on move to the front. Returns how many, and the number of shadow rays."""
    going = i32(0)
    shadows = i32(0)
    for i in range(n):
        path = load_path(batch, i, depth)
        hit = Hit(load(batch.rays.t, i), primitive_of(scene.accel, load(batch.rays.slot, i)))
        owner = load(batch.paths.owner, i)
        place = owner // samples
        pixel = u32((row + place // columns) * view.width + column + place % columns)
        step = shade(scene, view, path, hit, pixel, u32(first + owner % samples))
        add_light(batch.gathered, owner, step.emitted)
        if step.shadow.tmax > 0.0:
            store_ray(batch.shadows, shadows, step.shadow)
            light = batch.shadow_light
            store_vec3(light.red, light.green, light.blue, shadows, step.direct)
            store(batch.shadow_owner, shadows, owner)
            shadows += i32(1)
        if step.path.alive:
            store_path(batch, going, step.path, owner)
            going += i32(1)
    return going, shadows


@kernel
def connect(scene, batch, shadows):
    """Trace the shadow rays and gather the light of those that nothing stops."""
    trace_rays(scene, batch.shadows, shadows, True)
    light = batch.shadow_light
    for i in range(shadows):
        if load(batch.shadows.slot, i) < 0:
            add_light(batch.gathered, load(batch.shadow_owner, i), vec3_at(light.red, light.green, light.blue, i))


@kernel(precise=True)
def two_sum(a, b):
    """a + b rounded, and what the rounding lost, exactly (Knuth 1969, TAOCP 2, 4.2.2)."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@kernel
def add_to_film(film, i, value):
    """Add one number of a sample to the film, keeping the digits that float32 cannot hold."""
    total, lost = two_sum(load(film.total, i), value)
    store(film.total, i, total)
    store(film.lost, i, load(film.lost, i) + lost)


@kernel
def develop(view, film, batch, column, row, columns, rows, samples):
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
                owner += i32(1)
                if abs(c.x + c.y + c.z) < INF:
                    add_to_film(film, place * 3, c.x)
                    add_to_film(film, place * 3 + 1, c.y)
                    add_to_film(film, place * 3 + 2, c.z)
                else:
                    rejected += 1
            store(film.counts, place, u32(load(film.counts, place) + u32(samples)))
    return rejected


@kernel
def render_tile(scene, view, film, batch, column, row, columns, rows, first, samples):
    """Some samples of each pixel of a tile."""
    n = generate(scene, view, batch, column, row, columns, rows, first, samples)
    depth = i32(0)
    while n > 0:
        trace_rays(scene, batch.rays, n, False)
        n, shadows = shade_batch(scene, view, batch, n, depth, column, row, columns, first, samples)
        connect(scene, batch, shadows)
        depth += i32(1)
    return develop(view, film, batch, column, row, columns, rows, samples)


@entry
def render_tiles(scene, view, film, batch, control, last):
    """Render tiles until there are no more, or the render is cancelled.

    Args:
        scene: PackedScene with a BVH8.
        view: View.
        film: FilmArrays; each pixel gets the samples from its count up to `last`.
        batch: scratch of this thread.
        control: (4,) int64, shared by the threads.
        last: number of samples that each pixel has afterwards.
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
        while first < last:
            samples = min(room, i32(last - first))
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
            first += samples
        fetch_add(control, FINISHED_TILES, 1)


