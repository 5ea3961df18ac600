"""The CPU's scheduler: each thread takes tiles and advances a batch of paths through them, one bounce at a time.

A batch is generated, then traced, shaded and connected to the lights in turn, so that each of these loops stays in the
instruction cache and its state in the L2 cache. The physics is in `kernels`; here is only the order of things.
"""

from __future__ import annotations

from ..accel.packets import trace_rays
from ..kernels.adaptive import add_square, goal_of, square_of
from ..kernels.light_layers import all_columns, light_columns, squares_to_layer, to_layers
from ..kernels.path import start_path
from ..kernels.sampler import camera_numbers, sample_number
from ..lang import INF, Vec3, entry, fetch_add, i32, kernel, load, read_clock, store, u32
from ..pack.layout import GROUPS, TILE
from .cpu_arrays import BATCH, STRIDE, add_light, put_in_batch, store_path, store_vec3, vec3_at
from .cpu_film import add_exactly, add_to_film, put_in_film
from .cpu_shading import shade_batch

# Slots of `control`.
NEXT_TILE = i32(0)
CANCELLED = i32(1)
REJECTED = i32(2)
FINISHED_TILES = i32(3)


@kernel
def generate(scene, view, batch, column, row, columns, rows, first, samples):
    """Camera rays for `samples` samples of each pixel of a tile, those of a pixel one after the other."""
    n = i32(0)
    for y in range(rows):
        for x in range(columns):
            for s in range(samples):
                sample = u32(view.first_sample + u32(first + s))
                number = sample_number(scene, view, i32(column + x), i32(row + y), sample)
                numbers = camera_numbers(scene, number.pixel, number.sample, view.seed)
                path = start_path(scene, view, i32(column + x), i32(row + y), numbers)
                store_path(batch, n, path, n, number.pixel, number.sample)
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
def one_group_at(scene, batch, i):
    """Nobody asks for light groups."""
    return i32(0)


@kernel(needs=GROUPS, otherwise=one_group_at)
def group_at(scene, batch, i):
    """The light group of a shadow ray."""
    return load(batch.shadow_group, i)


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
