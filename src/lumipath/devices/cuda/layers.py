"""The pass that fills layers of the first hit: one thread a pixel, on one GPU."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import Any

import numpy as np
from numba import cuda

from ...accel.walk import walk_to_end
from ...kernels.layers import add_samples_of_layers
from ...lang import i32, kernel, stack_ints, u32
from ...lang.cuda import Compiled, compile_cubin, cuda_entry
from ...pack.layout import LayerArrays, PackedScene, View
from ..interrupts import deferred_interrupts
from .arguments import LAYERS_TYPE, VIEW_TYPE, to_device, type_of
from .driver import DeviceArray, Gpu, Kernel, Stream, flatten_arguments, pointers_to
from .megakernel import BLOCK
from .work import COUNTERS, WARP, WORK_TYPE, Work, item_count, place_of

_SLICE_SECONDS = 0.05


def make_layers(stack_size: int) -> Any:
    """The kernel, with room for `stack_size` links in the traversal stack."""

    @kernel
    def trace(scene, ray, any_hit):
        return walk_to_end(scene, ray, any_hit, stack_ints(stack_size))

    def layers_of_pixels(scene, view, layers, work):
        column, row = place_of(u32(cuda.grid(1)), view.film_width)
        if (column < view.film_width) & (row < view.film_height):
            x = i32(view.left + column)
            y = i32(view.top + row)
            place = i32(row * view.film_width + column)
            add_samples_of_layers(scene, view, trace, layers, x, y, place, i32(work.first), i32(work.last))

    return cuda_entry(layers_of_pixels)


def compile_layers(scene: Any, capability: tuple[int, int], stack: int) -> Compiled:
    """The kernel for the Numba type of a scene."""
    return compile_cubin(make_layers(stack), (scene, VIEW_TYPE, LAYERS_TYPE, WORK_TYPE), capability)


class LayerPass:
    """Fills layers in slices of some 50 ms.

    Args:
        gpu: which renders, and is open.
        scene: with its arrays on that GPU and the feature `LAYERS`.
        stack: room for links in the traversal stack.
    """

    def __init__(self, gpu: Gpu, scene: PackedScene, stack: int) -> None:
        made = compile_layers(type_of(scene), gpu.capability, stack)
        self._gpu, self._scene = gpu, scene
        self._kernel = Kernel(made.cubin, made.name)
        self._stream = Stream()
        self._counters = DeviceArray.zeros((COUNTERS,), np.uint32)

    def render(
        self, view: View, layers: LayerArrays, last: int, cancelled: Callable[[], bool]
    ) -> Generator[int, None, None]:
        """Bring every pixel up to `last` samples, or fewer if `cancelled`; see `Device.render_layers`."""
        first, samples = int(layers.counts[0, 0]), 1
        self._gpu.open()
        view, made = to_device(view), to_device(layers)
        self._gpu.synchronize()
        try:
            while first < last and not cancelled():
                stop = min(first + samples, last)
                start = time.perf_counter()
                self._run(view, made, first, stop)
                samples = 2 * samples if time.perf_counter() - start < _SLICE_SECONDS / 2 else samples
                first = stop
                yield 0
        finally:
            with deferred_interrupts():
                self._gpu.open()
                self._stream.wait()
                for mine, theirs in zip(layers[:5], made[:5], strict=True):
                    theirs.download(mine)

    def _run(self, view: View, layers: LayerArrays, first: int, last: int) -> None:
        self._gpu.open()
        items = item_count(int(view.film_width), int(view.film_height))
        work = Work(self._counters, u32(items // WARP), u32(last - first), u32(first), u32(last))
        arguments = pointers_to(flatten_arguments((self._scene, view, layers, work)))
        self._kernel.launch(-(-items // BLOCK), BLOCK, arguments, self._stream)
        self._stream.wait()
