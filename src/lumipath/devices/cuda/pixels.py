"""A plain kernel of one thread a pixel, for integrators whose sample is one function."""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.adaptive import add_square, square_of, takes
from ...kernels.integrators import estimate
from ...kernels.light_layers import squares_to_layer
from ...kernels.sampler import sample_number
from ...kernels.vectors import black
from ...lang import f32, i32, kernel, stack_ints, u32
from ...lang.cuda import cuda_entry
from .film import add_samples, put_in_film
from .work import finite_or_counted, is_on_film, place_in_tile, tile_of


def make_pixels(stack_size: int) -> Any:
    """The kernel, with room for `stack_size` links in the traversal stack."""

    @kernel
    def trace(scene, ray, any_hit):
        return walk_to_end(scene, ray, any_hit, stack_ints(stack_size))

    def pixels(scene, view, film, work):
        tile = tile_of(view, work, u32(u32(cuda.grid(1)) >> u32(5)))
        which = i32(cuda.laneid)
        column = i32(tile.column + (which & 7))
        row = i32(tile.row + (which >> 3))
        there = (tile.first < tile.last) & is_on_film(view, tile, which)
        if there and takes(scene, view, film, column, row, work.first):
            x = i32(view.left + column)
            y = i32(view.top + row)
            light = black()
            squares = f32(0.0)
            for sample in range(tile.first, tile.last):
                number = sample_number(scene, view, x, y, u32(sample))
                seen = estimate(scene, view, trace, x, y, number.pixel, number.sample)
                seen = finite_or_counted(work.counters, seen)
                light = light + seen
                squares = f32(squares + square_of(scene, seen))
                squares_to_layer(scene, put_in_film, film, place_in_tile(view, tile, which), seen)
            add_samples(film, place_in_tile(view, tile, which), light)
            add_square(scene, film, place_in_tile(view, tile, which), squares)

    return cuda_entry(pixels)
