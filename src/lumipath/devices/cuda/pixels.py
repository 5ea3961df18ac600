"""A plain kernel of one thread a pixel, for integrators whose sample is one function."""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.adaptive import add_square, square_of, takes
from ...kernels.integrators import estimate
from ...kernels.vectors import black
from ...lang import f32, i32, kernel, stack_ints, u32
from ...lang.cuda import cuda_entry
from .film import add_samples
from .work import finite_or_counted, place_of


def make_pixels(stack_size: int) -> Any:
    """The kernel, with room for `stack_size` links in the traversal stack."""

    @kernel
    def trace(scene, ray, any_hit):
        return walk_to_end(scene, ray, any_hit, stack_ints(stack_size))

    def pixels(scene, view, film, work):
        column, row = place_of(u32(cuda.grid(1)), view.film_width)
        there = (column < view.film_width) & (row < view.film_height)
        if there and takes(scene, view, film, column, row, work.first):
            x = i32(view.left + column)
            y = i32(view.top + row)
            light = black()
            squares = f32(0.0)
            for sample in range(work.first, work.last):
                seen = estimate(scene, view, trace, x, y, u32(y * view.width + x), u32(sample))
                seen = finite_or_counted(work.counters, seen)
                light = light + seen
                squares = f32(squares + square_of(scene, seen))
            add_samples(film, i32(row * view.film_width + column), light)
            add_square(scene, film, i32(row * view.film_width + column), squares)

    return cuda_entry(pixels)
