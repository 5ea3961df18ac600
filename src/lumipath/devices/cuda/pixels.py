"""A plain kernel of one thread a pixel, for integrators whose sample is one function."""

from __future__ import annotations

from typing import Any

from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.integrators import estimate
from ...kernels.vectors import black
from ...lang import i32, kernel, stack_ints, u32
from ...lang.cuda import cuda_entry
from .film import add_samples, finite
from .megakernel import lane_for


def make_pixels(stack_size: int) -> Any:
    """The kernel, with room for `stack_size` links in the traversal stack."""

    @kernel
    def trace(scene, ray, any_hit):
        return walk_to_end(scene, ray, any_hit, stack_ints(stack_size))

    def pixels(scene, view, film, items, first, last):
        lane = lane_for(view, u32(cuda.grid(1)), items, first)
        if lane.place >= 0:
            row = u32(lane.pixel // u32(view.width))
            column = i32(lane.pixel - row * u32(view.width))
            light = black()
            for sample in range(first, last):
                seen = estimate(scene, view, trace, column, i32(row), lane.pixel, u32(sample))
                light = light + finite(seen)
            add_samples(film, lane.place, light)

    return cuda_entry(pixels)
