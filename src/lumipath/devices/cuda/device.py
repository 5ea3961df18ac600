"""A GPU that renders."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import Any

import numpy as np

from ...accel.build import build_tree
from ...accel.bvh4 import MAX_LEAF, gpu_tree
from ...errors import DeviceError
from ...lang import Features
from ...pack.layout import WIDE_TREE, FilmArrays, PackedScene, View
from ...pack.scene import Packed
from ..device import DeviceInfo
from ..interrupts import deferred_interrupts
from .driver import DeviceArray, Gpu, device_count
from .schedulers import Megakernel, Scheduler, Wavefront

# Below this many primitives a binary tree that is walked to its end is faster than voting over a wide one (measured).
SMALL_SCENE = 2000
_SLICE_SECONDS = 0.1
_PASS_SECONDS = 0.3
_STACK, _DEEP_STACK = 64, 256


class CudaDevice:
    """Renders on one GPU, in slices of some 100 ms, so that it can be stopped at any time."""

    kind = "cuda"
    even_counts = True

    def __init__(self, index: int = 0, kernel: str = "auto") -> None:
        self._gpu = Gpu(index)
        self._gpu.open()
        self.name = self._gpu.name
        self._stack = _STACK
        self._which = kernel
        self._scheduler: Scheduler | None = None
        self._film: FilmArrays | None = None
        self._rate = 0.0
        self._cancelled = False

    def upload(self, packed: Packed) -> PackedScene:
        """Build the tree and copy every array to the GPU."""
        self._gpu.open()
        geometry = packed.geometry
        lower, upper = geometry.bounds()
        wide = len(lower) > SMALL_SCENE
        tree = build_tree(lower, upper, max_leaf=MAX_LEAF, block=1)
        sides, solid = geometry.two_sided, geometry.solid()
        accel, depth = gpu_tree(tree, geometry.vertices, geometry.faces, sides, solid, wide=wide)
        self._stack = _STACK if depth <= _STACK else _DEEP_STACK
        features = packed.scene.features.mask | (WIDE_TREE if wide else 0)
        return to_device(packed.scene._replace(accel=accel, features=Features(features)))

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the kernels for this scene's features, or load it from the disk."""
        self._gpu.open()
        # The megakernel was faster on every scene that was measured.
        scheduler = Wavefront if self._which == "wavefront" else Megakernel
        self._scheduler = scheduler(self._gpu, scene, self._stack)

    def next_stop(self, done: int, pixels: int) -> int:
        """As many samples as fit into a third of a second, at the speed so far."""
        return done + max(1, int(_PASS_SECONDS * self._rate / pixels))

    def render(self, scene: PackedScene, view: View, film: FilmArrays, last: int) -> Generator[int, None, None]:
        """Bring every pixel up to `last` samples; see `Device.render`.

        Light that is not finite is left out, and not counted.
        """
        assert self._scheduler is not None, "compile comes first"
        self._gpu.open()
        if self._film is None:
            self._film = to_device(film)
        view_on_gpu = to_device(view)
        done = int(film.counts[0, 0])
        offset = int(view.first_sample)
        pixels = int(view.film_width) * int(view.film_height)
        self._cancelled = False
        while done < last and not self._cancelled:
            until = min(last, done + max(1, int(_SLICE_SECONDS * self._rate / pixels)))
            start = time.perf_counter()
            # Samples and their counts together, so that an interrupt leaves true counts.
            with deferred_interrupts():
                self._scheduler.run(scene, view_on_gpu, self._film, offset + done, offset + until)
                film.counts[...] = until
            self._rate = pixels * (until - done) / max(time.perf_counter() - start, 1e-6)
            done = until
            yield 0

    def cancel(self) -> None:
        """End the pass after the slice that is under way."""
        self._cancelled = True

    def download(self, film: FilmArrays) -> None:
        """Bring the sums to the host."""
        if self._film is not None:
            self._gpu.open()
            self._film.total.download(film.total)
            self._film.lost.download(film.lost)

    def clear(self) -> None:
        """Forget the sums on the GPU."""
        self._film = None


def to_device(value: Any) -> Any:
    """A NamedTuple with its arrays on the GPU."""
    if isinstance(value, np.ndarray):
        return DeviceArray(value)
    if isinstance(value, tuple):
        return type(value)(*(to_device(item) for item in value))  # type: ignore[call-arg]
    return value


def cuda_infos() -> list[DeviceInfo]:
    """Every GPU; none where there is no driver, no GPU, or no support installed."""
    try:
        gpus = [Gpu(index) for index in range(device_count())]
    except DeviceError:
        return []
    return [
        DeviceInfo(
            f"cuda:{gpu.index}",
            gpu.name,
            0,
            {
                "capability": f"{gpu.capability[0]}.{gpu.capability[1]}",
                "memory_bytes": gpu.memory,
                "multiprocessors": gpu.multiprocessors,
                "driver_cuda": f"{gpu.driver_version() // 1000}.{gpu.driver_version() % 1000 // 10}",
            },
        )
        for gpu in gpus
    ]
