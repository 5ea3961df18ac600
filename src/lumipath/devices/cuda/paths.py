"""A plain kernel of one thread a pixel that renders whole paths, and sorts their light into the layers of the film.

It is slower than the megakernel, whose warps deal samples to lanes: here a pixel belongs to one thread, so that layers
can be added to without atomics, and keep every digit.
"""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.adaptive import add_square, square_of, takes
from ...kernels.emitted_layers import emitted_to_layers
from ...kernels.light_layers import squares_to_layer, to_layers
from ...kernels.path import shade, start_path
from ...kernels.rays import no_ray
from ...kernels.sampler import camera_numbers, direction_numbers, sample_number
from ...kernels.vectors import black
from ...lang import f32, i32, kernel, stack_ints, u32
from ...lang.cuda import cuda_entry
from .film import add_samples, put_in_film
from .work import finite_or_counted, is_on_film, place_in_tile, tile_of


def make_paths(stack_size: int) -> Any:
    """The kernel, with room for `stack_size` links in the traversal stack."""

    @kernel
    def path_sample(scene, view, work, film, column, row, place, sample):
        """The light of one sample; what is not finite is left out, here as in the layers."""
        number = sample_number(scene, view, column, row, sample)
        pixel, sample = number.pixel, number.sample
        path = start_path(scene, view, column, row, camera_numbers(scene, pixel, sample, view.seed))
        stack = stack_ints(stack_size)
        light = black()
        direct = black()
        shadow = no_ray()
        group = i32(0)
        connecting = False
        # One place that traces, since traversal is most of the machine code.
        while path.alive or connecting:
            hit = walk_to_end(scene, shadow if connecting else path.ray, connecting, stack)
            if connecting:
                connecting = False
                if hit.primitive < 0:
                    direct = finite_or_counted(work.counters, direct)
                    light = light + direct
                    # The path has gone on already: its events are those of the shadow ray.
                    to_layers(scene, put_in_film, film, place, path.depth, group, direct)
            else:
                events = path.depth
                numbers = direction_numbers(scene, pixel, sample, view.seed, events)
                step = shade(scene, view, path, hit, numbers, pixel, sample)
                emitted = finite_or_counted(work.counters, step.emitted)
                light = light + emitted
                emitted_to_layers(scene, put_in_film, film, place, events, hit.primitive < 0, step, emitted)
                path = step.path
                shadow = step.shadow
                direct = step.direct
                group = step.light
                connecting = shadow.tmax > 0.0
        return light

    def paths(scene, view, film, work):
        tile = tile_of(view, work, u32(u32(cuda.grid(1)) >> u32(5)))
        which = i32(cuda.laneid)
        column = i32(tile.column + (which & 7))
        row = i32(tile.row + (which >> 3))
        there = (tile.first < tile.last) & is_on_film(view, tile, which)
        if there and takes(scene, view, film, column, row, work.first):
            x = i32(view.left + column)
            y = i32(view.top + row)
            place = place_in_tile(view, tile, which)
            light = black()
            squares = f32(0.0)
            for sample in range(tile.first, tile.last):
                seen = path_sample(scene, view, work, film, x, y, place, u32(sample))
                light = light + seen
                squares = f32(squares + square_of(scene, seen))
                squares_to_layer(scene, put_in_film, film, place, seen)
            add_samples(film, place, light)
            add_square(scene, film, place, squares)

    return cuda_entry(paths)
