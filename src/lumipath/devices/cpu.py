"""All cores of the CPU."""

from __future__ import annotations

import platform
from collections.abc import Callable, Generator
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..accel.bvh8 import NO_TREE, WIDTH, widen
from ..accel.refit import cpu_costs, is_worn, moved, refit_cpu
from ..accel.stand_in import LARGE, build_for_cpu
from ..accel.two_level import build_trees
from ..lang.host import usable_cores, vector_units
from ..lang.kernel import compile_for
from ..lang.scalars import quiet_arithmetic
from ..pack.layout import PIXEL_INTEGRATORS, FilmArrays, LayerArrays, PackedScene, View
from ..pack.scene import Packed
from .cpu_arrays import BATCH, STRIDE, TILE_PIXELS, new_batch
from .cpu_batch import CANCELLED, REJECTED, render_tiles
from .cpu_pixels import render_pixels
from .device import DeviceInfo
from .interrupts import deferred_interrupts

TREE_OPTIONS = {"max_leaf": WIDTH, "block": WIDTH}
"""Of `build_tree`, for trees that the CPU walks."""

_LOOK_SECONDS = 0.25


@cache
def processor_name() -> str:
    """The processor's name for people."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine() or "CPU"


def with_cpu_tree(packed: Packed, threads: int | None = None) -> PackedScene:
    """The scene with the 8-wide tree that the CPU walks, built by so many threads (all cores where None)."""
    geometry = packed.geometry
    lower, upper = geometry.bounds()
    trees = build_trees(lower, upper, geometry.instancing, **TREE_OPTIONS, threads=threads or usable_cores())
    accel, roots = widen(trees, geometry.vertices, geometry.faces, geometry.two_sided, geometry.solid())
    return packed.with_tree(accel, roots)


def renderer_of(scene: PackedScene) -> Callable[..., Any]:
    """What renders the integrator of this scene's features."""
    return render_pixels if scene.features.mask & PIXEL_INTEGRATORS else render_tiles


class CpuDevice:
    """Renders with threads that run compiled code without Python's lock."""

    kind = "cpu"
    even_counts = False

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or usable_cores()
        self.tree_options: dict[str, Any] = {**TREE_OPTIONS, "threads": self.threads}
        self.name = f"{processor_name()}, {self.threads} thread{'s' if self.threads > 1 else ''}"
        self._batches = [new_batch() for _ in range(self.threads)]
        self._control = np.zeros(4, np.int64)
        self._pool = ThreadPoolExecutor(self.threads, "lumipath", initializer=quiet_arithmetic)
        self._built_costs: NDArray[np.float64] | None = None

    def draft(self, packed: Packed) -> PackedScene:
        """The scene with an empty tree."""
        return packed.scene._replace(accel=NO_TREE)

    def stand_in(self, packed: Packed) -> partial[None]:
        """A small tree, or one as large as it takes; see `Device.stand_in`."""
        return partial(build_for_cpu, len(packed.scene.primitives) > LARGE)

    def upload(self, packed: Packed) -> PackedScene:
        """Build the 8-wide tree; the arrays stay where they are."""
        self._built_costs = None
        return with_cpu_tree(packed, self.threads)

    def refit(self, packed: Packed) -> PackedScene:
        """Fit the tree to vertices that have moved, or build it anew; see `Device.refit`."""
        before, roots = packed.scene.accel, packed.roots
        if self._built_costs is None:
            self._built_costs = cpu_costs(before, roots)
        accel = refit_cpu(before, moved(packed.geometry))
        if is_worn(cpu_costs(accel, roots), self._built_costs):
            return self.upload(packed)
        return packed.scene._replace(accel=accel)

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the renderer for this scene's features, or load it from the disk."""
        if len(self._batches[0].parts) < film.parts.shape[-1] * STRIDE:
            self._batches = [new_batch(film.parts.shape[-1]) for _ in self._batches]
        compile_for(renderer_of(scene), scene, view, film, self._batches[0], np.zeros(4, np.int64), 0)

    def stage_cycles(self) -> NDArray[np.int64]:
        """(5,): cycles that all threads have spent in the stages that `Batch.clock` names."""
        return np.sum([batch.clock for batch in self._batches], axis=0)

    def next_stop(self, done: int, pixels: int) -> int:
        """One sample for a first look, then whole batches, which are faster; never by the clock.

        Batches are then the same on every machine, and so is whatever might depend on which rays travel together.
        """
        whole = int(BATCH // TILE_PIXELS)
        return 1 if done == 0 else (done // whole + 1) * whole

    def render(
        self, scene: PackedScene, view: View, film: FilmArrays | LayerArrays, last: int
    ) -> Generator[int, None, None]:
        """Bring every pixel of the film up to `last` samples; see `Device.render`."""
        self._control = control = np.zeros(4, np.int64)
        renderer = renderer_of(scene)
        work: list[Future[None]] = []
        reported = 0
        try:
            with deferred_interrupts():
                for batch in self._batches:
                    work.append(self._pool.submit(renderer, scene, view, film, batch, control, last))
            while wait(work, _LOOK_SECONDS, FIRST_EXCEPTION).not_done:
                yield int(control[REJECTED]) - reported
                reported = int(control[REJECTED])
        finally:
            # What is under way is finished, tiles of paths or else pixels, so that every pixel's count is true.
            with deferred_interrupts():
                control[CANCELLED] = 1
                wait(work)
        for item in work:
            item.result()
        yield int(control[REJECTED]) - reported

    def compile_layers(self, scene: PackedScene, view: View, layers: LayerArrays) -> None:
        """Compile the pass that fills layers, or load it from the disk."""
        compile_for(renderer_of(scene), scene, view, layers, self._batches[0], np.zeros(4, np.int64), 0)

    def render_layers(
        self, scene: PackedScene, view: View, layers: LayerArrays, last: int
    ) -> Generator[int, None, None]:
        """Bring every pixel of the layers up to `last` samples; see `Device.render_layers`."""
        return self.render(scene, view, layers, last)

    def cancel(self) -> None:
        """End the pass after the tiles that are under way; see `Device.cancel`."""
        self._control[CANCELLED] = 1

    def download(self, film: FilmArrays) -> None:
        """Nothing: the threads add to the film itself."""

    def clear(self) -> None:
        """Nothing: there are no other sums."""


def cpu_info() -> DeviceInfo:
    """The CPU as a device."""
    simd, bits = vector_units()
    detail = {
        "model": processor_name(),
        "cores": usable_cores(),
        "simd": simd,
        "simd_bits": bits,
        "architecture": platform.machine(),
    }
    return DeviceInfo("cpu", processor_name(), usable_cores(), detail)
