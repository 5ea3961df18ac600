"""The CPU's scheduler of integrators that need no batches: each thread takes tiles and goes through them by pixels."""

from __future__ import annotations

from ..accel.trace8 import trace_ray
from ..kernels.adaptive import add_square, goal_of, square_of
from ..kernels.integrators import estimate
from ..kernels.layers import add_samples_of_layers
from ..kernels.light_layers import squares_to_layer
from ..kernels.sampler import sample_number
from ..lang import INF, entry, fetch_add, i32, kernel, load, store, u32
from ..pack.layout import LAYERS, TILE
from .cpu_batch import CANCELLED, FINISHED_TILES, NEXT_TILE, REJECTED
from .cpu_film import add_to_film, put_in_film


@kernel
def render_pixel(scene, view, film, column, row, place, last):
    """Bring a pixel up to `last` samples; returns how many were not finite and counted as black."""
    first = i32(load(film.counts, place))
    rejected = 0
    for sample in range(first, last):
        number = sample_number(scene, view, column, row, u32(view.first_sample + u32(sample)))
        c = estimate(scene, view, trace_ray, column, row, number.pixel, number.sample)
        if abs(c.x + c.y + c.z) < INF:
            add_to_film(film, place * 3, c.x)
            add_to_film(film, place * 3 + 1, c.y)
            add_to_film(film, place * 3 + 2, c.z)
            add_square(scene, film, place, square_of(scene, c))
            squares_to_layer(scene, put_in_film, film, place, c)
        else:
            rejected += 1
    store(film.counts, place, u32(max(first, last)))
    return rejected


@kernel(needs=LAYERS, otherwise=render_pixel)
def render_pixel_or_layers(scene, view, film, column, row, place, last):
    """Bring a pixel of LayerArrays up to `last` samples."""
    first = i32(load(film.counts, place))
    if first < last:
        add_samples_of_layers(scene, view, trace_ray, film, column, row, place, first, i32(last))
    return 0


@entry
def render_pixels(scene, view, film, batch, control, last):
    """Render tiles until there are no more, or the render is cancelled.

    Args:
        scene: PackedScene with a BVH8.
        view: View.
        film: FilmArrays, or LayerArrays for the layers; each pixel gets the samples from its count up to `last`, or to
            the goal of its tile.
        batch: not used; `render_tiles` has the same parameters.
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
        end = goal_of(scene, film, tile, last)
        for v in range(y, min(y + TILE, view.film_height)):
            for u in range(x, min(x + TILE, view.film_width)):
                # A sample may be thousands of rays: a cancelled render does not wait for its tiles.
                if fetch_add(control, CANCELLED, 0) != 0:
                    return
                place = i32(v * view.film_width + u)
                x_full, y_full = i32(view.left + u), i32(view.top + v)
                rejected = render_pixel_or_layers(scene, view, film, x_full, y_full, place, end)
                fetch_add(control, REJECTED, rejected)
        fetch_add(control, FINISHED_TILES, 1)
