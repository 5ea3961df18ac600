"""A GPU that renders."""

from __future__ import annotations

import time
from typing import Any

import numba
import numpy as np
from numba import types

from ...accel.build import build_tree
from ...accel.bvh4 import MAX_LEAF, gpu_tree
from ...errors import DeviceError
from ...lang import Features
from ...lang.cuda import Compiled, compile_cubin
from ...pack.layout import (
    DIELECTRICS,
    MIRRORS,
    QUADRICS,
    VERTEX_DATA,
    WIDE_TREE,
    FilmArrays,
    PackedScene,
    View,
)
from ...pack.scene import Packed
from ..device import DeviceInfo
from .driver import DeviceArray, Gpu, Kernel, device_count, flatten_arguments
from .megakernel import BLOCK, TILE_HEIGHT, TILE_WIDTH, make_refill, make_vote

# Below this many primitives a binary tree that is walked to its end is faster than voting over a wide one (measured).
SMALL_SCENE = 2000
_SLICE_SECONDS = 0.1
_STACK, _DEEP_STACK = 64, 256


class CudaDevice:
    """Renders on one GPU, in slices of some 50 ms, so that it can be stopped at any time."""

    kind = "cuda"

    def __init__(self, index: int = 0) -> None:
        self._gpu = Gpu(index)
        self._gpu.open()
        self.name = self._gpu.name
        self._stack = _STACK
        self._kernel: Kernel | None = None
        self._film: FilmArrays | None = None
        self._rate = 0.0

    def upload(self, packed: Packed) -> PackedScene:
        """Build the tree and copy every array to the GPU."""
        self._gpu.open()
        geometry = packed.geometry
        lower, upper = geometry.bounds()
        wide = len(lower) > SMALL_SCENE
        tree = build_tree(lower, upper, max_leaf=MAX_LEAF, block=1)
        accel, depth = gpu_tree(tree, geometry.vertices, geometry.faces, geometry.two_sided, wide=wide)
        self._stack = _STACK if depth <= _STACK else _DEEP_STACK
        features = packed.scene.features.mask | (WIDE_TREE if wide else 0)
        return to_device(packed.scene._replace(accel=accel, features=Features(features)))

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the kernel for this scene's features, or load it from the disk."""
        self._gpu.open()
        made = compiled_megakernel(types_of(scene), self._gpu.capability, self._stack)
        self._kernel = Kernel(made.cubin, made.name)

    def render(self, scene: PackedScene, view: View, film: FilmArrays, last: int) -> int:
        """Bring every pixel up to `last` samples; light that is not finite is left out, uncounted: returns 0."""
        assert self._kernel is not None
        self._gpu.open()
        if self._film is None:
            self._film = to_device(film)
        view_on_gpu = to_device(view)
        across = -(-int(view.film_width) // TILE_WIDTH)
        down = -(-int(view.film_height) // TILE_HEIGHT)
        done = int(film.counts[0, 0])
        pixels = int(view.film_width) * int(view.film_height)
        while done < last:
            samples = max(1, int(_SLICE_SECONDS * self._rate / pixels)) if self._rate else 1
            until = min(last, done + samples)
            start = time.perf_counter()
            values = (scene, view_on_gpu, self._film, np.int64(done), np.int64(until))
            self._kernel.launch((across, down), BLOCK, flatten_arguments(values))
            self._gpu.synchronize()
            self._rate = pixels * (until - done) / max(time.perf_counter() - start, 1e-6)
            done = until
            # After each slice, so that an interrupt leaves true counts.
            film.counts[...] = done
        return 0

    def download(self, film: FilmArrays) -> None:
        """Bring the sums to the host."""
        if self._film is not None:
            self._gpu.open()
            self._film.total.download(film.total)
            self._film.lost.download(film.lost)


def compiled_megakernel(arguments: tuple[Any, ...], capability: tuple[int, int], stack: int = _STACK) -> Compiled:
    """The megakernel for argument types: which one, and with how many registers, was measured."""
    mask = arguments[0].types[0].mask
    rich = bool(mask & (MIRRORS | DIELECTRICS | VERTEX_DATA | QUADRICS))
    if mask & WIDE_TREE:
        kernel, registers = make_vote(stack, 16 if rich else 8, 8, 2), 64 if rich else 56
    else:
        kernel, registers = make_refill(stack, 18), 64
    return compile_cubin(kernel, arguments, capability, registers)


def to_device(value: Any) -> Any:
    """A NamedTuple with its arrays on the GPU."""
    if isinstance(value, np.ndarray):
        return DeviceArray(value)
    if isinstance(value, tuple):
        return type(value)(*(to_device(item) for item in value))  # type: ignore[call-arg]
    return value


def _type_of(value: Any) -> types.Type:
    """The Numba type of a value whose arrays may be on the GPU."""
    if isinstance(value, DeviceArray):
        return types.Array(numba.from_dtype(value.dtype), len(value.shape), "C")
    if isinstance(value, tuple):
        return types.NamedTuple(tuple(_type_of(item) for item in value), type(value))
    return numba.typeof(value)


_VIEW_TYPE = types.NamedTuple(
    (types.Array(types.float32, 1, "C"), *([types.int32] * 6), types.uint32, types.int32, types.int32), View
)
_FILM_TYPE = types.NamedTuple(
    (types.Array(types.float32, 3, "C"), types.Array(types.float32, 3, "C"), types.Array(types.uint32, 2, "C")),
    FilmArrays,
)


def types_of(scene: Any) -> tuple[Any, ...]:
    """Argument types of the megakernel for a packed scene."""
    return (_type_of(scene), _VIEW_TYPE, _FILM_TYPE, types.int64, types.int64)


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
