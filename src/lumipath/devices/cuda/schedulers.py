"""How the shading step is driven on a GPU: whole paths in one kernel, or one kernel a stage."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ...lang import i32, u32
from ...lang.cuda import Compiled, compile_cubin
from ...pack.layout import (
    ADAPTIVE,
    BSDFS,
    DIELECTRICS,
    FILM_LAYERS,
    INSTANCES,
    LIGHT_TREE,
    MIRRORS,
    PIXEL_INTEGRATORS,
    QUADRICS,
    VERTEX_DATA,
    WIDE_TREE,
)
from .arguments import FILM_TYPE, VIEW_TYPE, type_of
from .driver import DeviceArray, Gpu, Kernel, OutOfMemoryError, Stream, flatten_arguments, pointers_to
from .megakernel import make_refill, make_vote
from .paths import make_paths
from .pixels import make_pixels
from .tracing import tracing_blocks
from .wavefront import ROWS, TRACING, WAVE_TYPE, Wave, make_wavefront
from .work import BLOCK, COUNTERS, PATHS, REJECTED, WARP, WORK_TYPE, Work, item_count

_LONG_SHADING = BSDFS | LIGHT_TREE
_RICH = MIRRORS | DIELECTRICS | VERTEX_DATA | QUADRICS | INSTANCES
# Paths in flight in the wavefront: enough to fill any GPU, and 136 bytes each; its queues can hold 2^28.
_SLOTS, _LEAST_SLOTS = 1 << 22, 1 << 16
# Lanes that a multiprocessor holds, and the most planes of sums that a small film gets to have as many.
_LANES, _MOST_PLANES = 1024, 64
# Of the stages of the wavefront, where it matters (measured).
_REGISTERS = dict.fromkeys(TRACING, 64) | {"shade": 96}
# Threads of a block of it, within which it sorts paths: with these registers two of them fit on a multiprocessor.
_SHADE_BLOCK = 320
# Rounds before slots with nothing left to do are removed from the queue.
_ROUNDS = 4


class Scheduler(Protocol):
    """Renders some samples of every pixel.

    slice_seconds: what a call of `run` should take.
    least_samples: samples below which it gets much slower for each.
    """

    slice_seconds: ClassVar[float]
    least_samples: ClassVar[int]

    def planes(self, view: Any) -> int:
        """How many planes of sums it uses for a film of this size."""

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> int:
        """Add the samples first .. last - 1 of every pixel to the film.

        Returns, when they are done, how many contributions were not finite and were left out.
        """


class Megakernel:
    """Whole paths, with or without layers, or whole samples of an integrator that has no paths, in one kernel."""

    slice_seconds = 0.05
    least_samples = 1

    def __init__(self, gpu: Gpu, scene: Any, stack: int) -> None:
        made = compiler_of(scene.features.mask)(scene_arguments(scene), gpu.capability, stack)
        self.kernel = Kernel(made.cubin, made.name)
        self._multiprocessors = gpu.multiprocessors
        self._stream = Stream()
        self._counters = Counters(self._stream)

    def planes(self, view: Any) -> int:
        """As many as it takes to fill the GPU."""
        items = item_count(int(view.film_width), int(view.film_height))
        return min(_MOST_PLANES, -(-self._multiprocessors * _LANES // items))

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> int:
        """Add samples to the film; see `Scheduler.run`."""
        items = item_count(int(view.film_width), int(view.film_height))
        planes = min(film.total.shape[0] // int(view.film_height), last - first)
        share = -(-(last - first) // planes)
        self._counters.clear()
        work = Work(self._counters.array, u32(items // WARP), u32(share), u32(first), u32(last))
        arguments = pointers_to(flatten_arguments((scene, view, film, work)))
        self.kernel.launch(-(-items * planes // BLOCK), BLOCK, arguments, self._stream)
        return int(self._counters.read()[REJECTED])


class Wavefront:
    """One kernel a stage."""

    slice_seconds = 0.1
    # Towards the end of a call more and more slots have nothing left to do (decision 0008).
    least_samples = 32

    def __init__(self, gpu: Gpu, scene: Any, stack: int) -> None:
        self._voting = bool(scene.features.mask & WIDE_TREE)
        self._multiprocessors = gpu.multiprocessors
        self.kernels = {
            name: Kernel(made.cubin, made.name)
            for name, made in compile_wavefront(scene_arguments(scene), gpu.capability, stack).items()
        }
        self._most_slots = _SLOTS
        self._state: DeviceArray | None = None
        self._queue: DeviceArray | None = None
        self._stream = Stream()
        self._counters = Counters(self._stream)

    def planes(self, view: Any) -> int:
        """One: what the slots of a pixel have gathered is summed before it comes to the film."""
        return 1

    def run(self, scene: Any, view: Any, film: Any, first: int, last: int) -> int:
        """Add samples to the film; see `Scheduler.run`."""
        items = item_count(int(view.film_width), int(view.film_height))
        state, queue = self._room_for(items, last - first)
        at_once = min(items, self._most_slots)
        # A small film has several planes of slots, so that it fills the GPU.
        planes = min(queue.shape[0] // (2 * at_once), last - first)
        share = -(-(last - first) // planes)
        rejected = 0
        for base in range(0, items, at_once):
            part = min(at_once, items - base)
            sizes = i32(base), i32(part), i32(part * planes), u32(share)
            wave = Wave(self._counters.array, state, queue, *sizes, i32(0), u32(first), u32(last))
            rejected += self._run_wave(scene, view, film, wave)
        return rejected

    def _room_for(self, items: int, samples: int) -> tuple[DeviceArray, DeviceArray]:
        """State and queues of slots for so many samples of items, or of a part of them where memory is short.

        Raises:
            OutOfMemoryError: there is no room for as few as make sense.
        """
        while True:
            at_once = min(items, self._most_slots)
            wanted = at_once * min(self._most_slots // at_once, samples)
            if self._state is not None and self._queue is not None and self._queue.shape[0] >= 2 * wanted:
                return self._state, self._queue
            self._state = self._queue = None
            try:
                self._state = DeviceArray((wanted * ROWS * 4,), np.float32)
                self._queue = DeviceArray((2 * wanted,), np.int32)
            except OutOfMemoryError:
                if self._most_slots <= _LEAST_SLOTS:
                    raise
                self._most_slots //= 2

    def _run_wave(self, scene: Any, view: Any, film: Any, wave: Wave) -> int:
        # Packing the arguments takes longer than a stage, so it is done once for each of the two queues.
        packed = [
            pointers_to(flatten_arguments((scene, view, film, wave._replace(parity=i32(parity))))) for parity in (0, 1)
        ]

        def launch(name: str, threads: int, parity: int = 0) -> None:
            size = _SHADE_BLOCK if name == "shade" else BLOCK
            blocks = -(-threads // size)
            if name in TRACING:
                blocks = tracing_blocks(threads, self._voting, self._multiprocessors)
            self.kernels[name].launch(blocks, size, packed[parity], self._stream)

        self._counters.clear()
        waiting = int(wave.slots)
        launch("start", waiting)
        parity = 0
        while waiting:
            for _ in range(_ROUNDS):
                for stage in ("extend", "shade", "shadow"):
                    launch(stage, waiting, parity)
            launch("compact", waiting, parity)
            parity = 1 - parity
            waiting = int(self._counters.read()[PATHS + parity])
        launch("finish", int(wave.items))
        return int(self._counters.read()[REJECTED])


def scheduler_for(mask: int, kernel: str) -> type[Megakernel] | type[Wavefront]:
    """Which scheduler renders scenes with these features, where the settings ask for this kernel.

    Whole paths in one kernel are the faster way as long as its instructions fit into their cache (decision 0008).
    """
    if mask & (PIXEL_INTEGRATORS | FILM_LAYERS | ADAPTIVE) or kernel == "megakernel":
        return Megakernel
    return Wavefront if kernel == "wavefront" or mask & _LONG_SHADING else Megakernel


class Counters:
    """The counters of `work`, on the GPU."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self.array = DeviceArray((COUNTERS,), np.uint32)

    def clear(self) -> None:
        """Set all to 0, after what was launched before."""
        self._stream.clear(self.array)

    def read(self) -> NDArray[np.uint32]:
        """Wait for what was launched before, and bring all of them."""
        host = np.empty(COUNTERS, np.uint32)
        self._stream.download(self.array, host)
        return host


def compiler_of(mask: int) -> Callable[[tuple[Any, ...], tuple[int, int], int], Compiled]:
    """What compiles the kernel for a scene with these features."""
    if mask & PIXEL_INTEGRATORS:
        return compile_pixels
    return compile_paths if mask & FILM_LAYERS else compile_megakernel


def compile_megakernel(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> Compiled:
    """The megakernel for argument types: which one, and with how many registers, was measured."""
    mask = scene[0].types[0].mask
    rich, long, adaptive = bool(mask & _RICH), bool(mask & BSDFS), bool(mask & ADAPTIVE)
    # The longer it takes to shade, the more lanes are to do it at a time.
    if mask & WIDE_TREE:
        shade_at = 28 if long else 16 if rich else 8
        kernel, registers = make_vote(stack, shade_at, 8, 2, adaptive), 64 if rich else 56
    else:
        kernel, registers = make_refill(stack, 8 if long else 18, adaptive), 64
    return compile_cubin(kernel, (*scene, WORK_TYPE), capability, registers)


def compile_pixels(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> Compiled:
    """The kernel of one thread a pixel for argument types."""
    return compile_cubin(make_pixels(stack), (*scene, WORK_TYPE), capability)


def compile_paths(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> Compiled:
    """The kernel of one thread a pixel that renders paths with layers, for argument types."""
    return compile_cubin(make_paths(stack), (*scene, WORK_TYPE), capability)


def compile_wavefront(scene: tuple[Any, ...], capability: tuple[int, int], stack: int) -> dict[str, Compiled]:
    """The kernels of the wavefront for argument types."""
    voting = bool(scene[0].types[0].mask & WIDE_TREE)
    return {
        name: compile_cubin(kernel, (*scene, WAVE_TYPE), capability, _REGISTERS.get(name, 0))
        for name, kernel in make_wavefront(stack, voting, _SHADE_BLOCK).items()
    }


def scene_arguments(scene: Any) -> tuple[Any, ...]:
    """Numba types of a packed scene, whose arrays may be on the GPU, of a view and of a film."""
    return (type_of(scene), VIEW_TYPE, FILM_TYPE)
