"""How the shading step is driven on a GPU: whole paths in one kernel, or one kernel a stage."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numba import types

from ...lang.cuda import Compiled, compile_cubin
from ...pack.layout import DIELECTRICS, MIRRORS, QUADRICS, VERTEX_DATA, WIDE_TREE
from .arguments import FILM_TYPE, VIEW_TYPE, type_of
from .driver import DeviceArray, Gpu, Kernel, flatten_arguments, pointers_to
from .megakernel import BLOCK, BLOCKS_PER_MULTIPROCESSOR, make_refill, make_vote
from .pixels import make_pixels
from .wavefront import COUNTERS, ROWS, make_wavefront

_RICH = MIRRORS | DIELECTRICS | VERTEX_DATA | QUADRICS
# Paths in flight in the wavefront: enough to fill any GPU, and 128 bytes each.
_SLOTS = 1 << 22
# Rounds between looks at how many paths are left.
_ROUNDS = 16


class Scheduler(Protocol):
    """Renders some samples of every pixel."""

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> None:
        """Add the samples first .. last - 1 of every pixel to the film; returns when they are done."""


def work_items(view: Any) -> int:
    """How many lanes cover the film in tiles of 8 x 4 pixels."""
    return -(-int(view.film_width) // 8) * 8 * (-(-int(view.film_height) // 4) * 4)


class Megakernel:
    """Whole paths in one kernel."""

    def __init__(self, gpu: Gpu, scene: Any, stack: int) -> None:
        made = compile_megakernel(scene_arguments(scene), gpu.capability, stack)
        self.kernel = Kernel(made.cubin, made.name)
        self._gpu = gpu
        # On tiny scenes lanes stay closer together when each keeps to its pixel (measured).
        self._shares = bool(scene.features.mask & WIDE_TREE)
        self._counters = DeviceArray(np.zeros(COUNTERS, np.uint32))

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> None:
        """Add the samples first .. last - 1 of every pixel to the film; returns when they are done."""
        items = work_items(view)
        blocks = -(-items // BLOCK)
        if self._shares:
            blocks = min(blocks, self._gpu.multiprocessors * BLOCKS_PER_MULTIPROCESSOR)
        # The lanes of the grid have one pixel each to begin with; the rest is for whoever is done first.
        self._counters.upload(np.full(COUNTERS, blocks * BLOCK, np.uint32))
        numbers = (np.int64(items), np.int64(first), np.int64(last))
        values = pointers_to(flatten_arguments((scene, view, film, self._counters, *numbers)))
        self.kernel.launch(blocks, BLOCK, values)
        self._gpu.synchronize()


class Pixels:
    """One thread a pixel, for the integrators that have no paths."""

    def __init__(self, gpu: Gpu, scene: Any, stack: int) -> None:
        made = compile_pixels(scene_arguments(scene), gpu.capability, stack)
        self.kernel = Kernel(made.cubin, made.name)
        self._gpu = gpu

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> None:
        """Add the samples first .. last - 1 of every pixel to the film; returns when they are done."""
        items = work_items(view)
        numbers = (np.int64(items), np.int64(first), np.int64(last))
        self.kernel.launch(-(-items // BLOCK), BLOCK, pointers_to(flatten_arguments((scene, view, film, *numbers))))
        self._gpu.synchronize()


class Wavefront:
    """One kernel a stage, with queues of paths between them."""

    def __init__(self, gpu: Gpu, scene: Any, stack: int) -> None:
        self._gpu = gpu
        self.kernels = {
            name: Kernel(made.cubin, made.name)
            for name, made in compile_wavefront(scene_arguments(scene), gpu.capability, stack).items()
        }
        self._state: DeviceArray | None = None
        self._queue: DeviceArray | None = None
        self._counters = DeviceArray(np.zeros(COUNTERS, np.uint32))

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> None:
        """Add the samples first .. last - 1 of every pixel to the film; returns when they are done."""
        pixels = int(view.film_width) * int(view.film_height)
        slots = min(pixels, _SLOTS)
        if self._state is None or self._queue is None:
            self._state = DeviceArray(np.empty(slots * ROWS * 4, np.float32))
            self._queue = DeviceArray(np.empty(2 * slots, np.int32))
        for base in range(0, pixels, slots):
            self._run_slots(scene, view, film, base, min(slots, pixels - base), first, last)

    def _run_slots(self, scene: Any, view: Any, film: Any, base: int, slots: int, first: int, last: int) -> None:
        # Packing the arguments takes longer than a stage, so it is done once for each of the two queues.
        packed = [
            pointers_to(
                flatten_arguments(
                    (
                        *(scene, view, film, self._state, self._queue, self._counters),
                        *(np.int64(number) for number in (base, slots, first, last, parity)),
                    )
                )
            )
            for parity in (0, 1)
        ]

        def launch(name: str, threads: int, parity: int = 0) -> None:
            self.kernels[name].launch(-(-threads // BLOCK), BLOCK, packed[parity])

        counters = np.array([slots, 0, 0, 0], np.uint32)
        self._counters.upload(counters)
        launch("wf_start", slots)
        parity = 0
        waiting = slots
        while waiting:
            for _ in range(_ROUNDS):
                for stage in ("wf_extend", "wf_shade", "wf_shadow"):
                    launch(stage, waiting, parity)
                launch("wf_turn", 1, parity)
                parity = 1 - parity
            self._counters.download(counters)
            waiting = int(counters[parity])
        launch("wf_finish", slots)
        self._gpu.synchronize()


def compile_megakernel(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> Compiled:
    """The megakernel for argument types: which one, and with how many registers, was measured."""
    mask = scene[0].types[0].mask
    rich = bool(mask & _RICH)
    if mask & WIDE_TREE:
        kernel, registers = make_vote(stack, 16 if rich else 8, 8, 2), 64 if rich else 56
    else:
        kernel, registers = make_refill(stack, 18), 64
    arguments = (*scene, types.Array(types.uint32, 1, "C"), *([types.int64] * 3))
    return compile_cubin(kernel, arguments, capability, registers)


def compile_pixels(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> Compiled:
    """The kernel of one thread a pixel for argument types."""
    return compile_cubin(make_pixels(stack), (*scene, *([types.int64] * 3)), capability)


def compile_wavefront(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> dict[str, Compiled]:
    """The kernels of the wavefront for argument types."""
    arrays = tuple(types.Array(kind, 1, "C") for kind in (types.float32, types.int32, types.uint32))
    arguments = (*scene, *arrays, *([types.int64] * 5))
    kernels = make_wavefront(stack)
    return {name: compile_cubin(kernel, arguments, capability) for name, kernel in kernels.items()}


def scene_arguments(scene: Any) -> tuple[Any, ...]:
    """Numba types of a packed scene, whose arrays may be on the GPU, of a view and of a film."""
    return (type_of(scene), VIEW_TYPE, FILM_TYPE)
