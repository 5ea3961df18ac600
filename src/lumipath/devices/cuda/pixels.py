"""A plain kernel of one thread a pixel, for integrators whose sample is one function."""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.integrators import estimate
from ...kernels.vectors import black
from ...lang import i32, kernel, stack_ints, u32
from ...lang.cuda import cuda_entry
from .film import add_samples
from .work import finite_or_counted, is_on_film, place_in_tile, tile_of


def make_pixels(stack_size: int) -> Any:
    """The kernel, with room for `stack_size` links in the traversal stack."""

    @kernel
    def trace(scene, ray, any_hit):
        return walk_to_end(scene, ray, any_hit, stack_ints(stack_size))

    def pixels(scene, view, film, work):
        tile = tile_of(view, work, u32(u32(cuda.grid(1)) >> u32(5)))
        which = i32(cuda.laneid)
        if (tile.first < tile.last) & is_on_film(view, tile, which):
            x = i32(view.left + tile.column + (which & 7))
            y = i32(view.top + tile.row + (which >> 3))
            light = black()
            for sample in range(tile.first, tile.last):
                seen = estimate(scene, view, trace, x, y, u32(y * view.width + x), u32(sample))
                light = light + finite_or_counted(work.counters, seen)
            add_samples(film, place_in_tile(view, tile, which), light)

    return cuda_entry(pixels)
