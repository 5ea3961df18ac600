"""All cores of the CPU."""

from __future__ import annotations

import os
import platform
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from functools import cache
from pathlib import Path

import numpy as np

from ..accel.build import build_tree
from ..accel.bvh8 import WIDTH, widen
from ..lang.kernel import compile_for
from ..pack.layout import FilmArrays, PackedScene, View
from ..pack.scene import Packed
from .cpu_batch import CANCELLED, REJECTED, new_batch, render_tiles
from .device import DeviceInfo


def usable_cores() -> int:
    """Number of cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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


class CpuDevice:
    """Renders with threads that run compiled code without Python's lock."""

    kind = "cpu"

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or usable_cores()
        self.name = f"{processor_name()}, {self.threads} thread{'s' if self.threads > 1 else ''}"
        self._batches = [new_batch() for _ in range(self.threads)]
        self._pool = ThreadPoolExecutor(self.threads, thread_name_prefix="lumipath")

    def upload(self, packed: Packed) -> PackedScene:
        """Build the 8-wide tree; the arrays stay where they are."""
        geometry = packed.geometry
        lower, upper = geometry.bounds()
        tree = build_tree(lower, upper, max_leaf=WIDTH, block=WIDTH, threads=self.threads)
        accel = widen(tree, geometry.vertices, geometry.faces, geometry.two_sided)
        return packed.scene._replace(accel=accel)

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the renderer for this scene's features, or load it from the disk."""
        compile_for(render_tiles, scene, view, film, self._batches[0], np.zeros(4, np.int64), 0)

    def render(self, scene: PackedScene, view: View, film: FilmArrays, last: int) -> int:
        """Bring every pixel of the film up to `last` samples; returns how many were not finite."""
        control = np.zeros(4, np.int64)
        work = [
            self._pool.submit(render_tiles, scene, view, film, batch, control, last) for batch in self._batches
        ]
        try:
            wait(work, return_when=FIRST_EXCEPTION)
        finally:
            # Tiles that are under way are finished, so that every pixel's count is true.
            control[CANCELLED] = 1
            wait(work)
        for item in work:
            item.result()
        return int(control[REJECTED])

    def download(self, film: FilmArrays) -> None:
        """Nothing: the threads add to the film itself."""


def cpu_info() -> DeviceInfo:
    """The CPU as a device."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    width = next((name for name in ("avx512f", "avx2", "avx", "sse4.2", "neon") if features.get(name)), "scalar")
    detail = {"model": processor_name(), "cores": usable_cores(), "simd": width, "architecture": platform.machine()}
    return DeviceInfo("cpu", processor_name(), usable_cores(), detail)
