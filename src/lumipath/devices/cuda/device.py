"""GPUs that render."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...accel.bvh4 import MAX_LEAF, NO_TREE, gpu_tree
from ...accel.refit import gpu_costs, is_worn, moved, refit_gpu
from ...accel.stand_in import LARGE, build_for_gpu
from ...accel.two_level import build_trees
from ...errors import DeviceError
from ...lang import Features
from ...pack.layout import TILE, WIDE_TREE, FilmArrays, LayerArrays, PackedScene, View
from ...pack.scene import Packed
from ..device import DeviceInfo, goals_of
from ..interrupts import deferred_interrupts
from .arguments import to_device
from .driver import DeviceArray, Gpu, OutOfMemoryError, device_count
from .layers import LayerPass
from .schedulers import Scheduler, scheduler_for

# Below this many primitives a binary tree that is walked to its end is faster than voting over a wide one (measured).
SMALL_SCENE = 2000
_WORKERS_PER_GPU = 2
# How often progress is told.
_TELL_SECONDS = 0.1
# Of a slice: the turns of a tile's lanes are numbered by 32 bits.
_MOST_SAMPLES = 1 << 26
# The sums that a worker keeps, each with the one that it belongs to.
_SUMS = {"total": "total", "lost": "total", "squares": "squares", "parts": "parts", "parts_lost": "parts"}
_DOWNLOAD_NUMBERS = 3 << 20
_STACK, _DEEP_STACK = 64, 256


class Worker:
    """A stream of launches on one GPU, with sums of its own."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self._scene: PackedScene | None = None
        self._scheduler: Scheduler | None = None
        # Features, stack and kind of the kernels.
        self._compiled: tuple[int, int, str] | None = None
        self._view: View | None = None
        self._film: FilmArrays | None = None
        self.rate = 0.0
        """Paths per second, as last measured; 0 before the first slice."""

    def compile(self, scene: PackedScene, stack: int, kernel: str) -> None:
        """Compile the kernels for a scene, wherever it is, or load them from the disk, unless they are there."""
        wanted = scene.features.mask, stack, kernel
        if wanted == self._compiled:
            return
        self.gpu.open()
        self._scheduler = scheduler_for(scene.features.mask, kernel)(self.gpu, scene, stack)
        self._compiled = wanted

    def begin(self, scene: PackedScene, view: View, film: FilmArrays, *, empty: bool) -> None:
        """Take a scene that is on the GPU, and a view; if there are no sums yet, those of `film`, none where `empty`.

        Raises:
            OutOfMemoryError: there is no room for the sums.
        """
        assert self._scheduler is not None, "compile comes first"
        self.gpu.open()
        self._scene = scene
        self._view = to_device(view)
        if self._film is None:
            planes = self._scheduler.planes(view)
            sums = {name: planes_of(getattr(film, name), planes) for name in _SUMS}
            if not empty:
                for name, array in sums.items():
                    array.upload(getattr(film, name))
            # Counts are kept by the host.
            counts = DeviceArray((1, 1), film.counts.dtype)
            self._film = FilmArrays(**sums, counts=counts, goals=DeviceArray.of(film.goals))
        self._film.goals.upload(film.goals)
        self.gpu.synchronize()

    def run(self, first: int, last: int, pixels: int) -> int:
        """Add the samples first .. last - 1 of every pixel; returns how many contributions were not finite."""
        assert self._scheduler is not None, "compile comes first"
        self.gpu.open()
        start = time.perf_counter()
        rejected = self._scheduler.run(self._scene, self._view, self._film, first, last)
        self.rate = pixels * (last - first) / max(time.perf_counter() - start, 1e-6)
        return rejected

    def slice_of(self, left: int, pixels: int, workers: int, gpus: int) -> int:
        """How many of the samples that are left this one of so many workers should take on next."""
        assert self._scheduler is not None, "compile comes first"
        kind = self._scheduler
        return slice_samples(self.rate / pixels * kind.slice_seconds, left, workers, gpus, kind.least_samples)

    @property
    def has_sums(self) -> bool:
        """Whether there is anything to add to the sums of others."""
        return self._film is not None

    def add_to(self, sums: dict[str, NDArray[np.float64]], top: int, height: int) -> None:
        """Add sums of this worker to those of others: the rows from `top` on, of a film of `height` rows."""
        if self._film is not None:
            self.gpu.open()
            for name, total in _SUMS.items():
                array, added = getattr(self._film, name), sums[total]
                host = np.empty(added.shape, np.float32)
                for plane in range(array.shape[0] // height):
                    array.download(host, plane * height + top)
                    added += host

    def clear(self) -> None:
        """Forget the sums."""
        self._film = None


class CudaDevice:
    """Renders on one GPU or on several of them, in slices of 50 to 100 ms, so that it can be stopped at any time.

    Each GPU has two workers, so that it is full while one of them runs out of pixels. All workers take slices of the
    samples as they become free, and their sums are added up when somebody asks for them.

    Args:
        index: number of the GPU; all of them where None.
        kernel: `auto`, `megakernel` or `wavefront`.

    Raises:
        DeviceError: a GPU cannot be used; the message says why.
    """

    kind = "cuda"
    even_counts = True
    tree_options: ClassVar = {"max_leaf": MAX_LEAF, "block": 1}

    def __init__(self, index: int | None = 0, kernel: str = "auto") -> None:
        gpus = [Gpu(number) for number in (range(device_count()) if index is None else (index,))]
        for gpu in gpus:
            gpu.open()
        self.name = joint_name([gpu.name for gpu in gpus])
        self._gpus = gpus
        # By turns, so that a short render uses every GPU.
        self._workers = [Worker(gpu) for _ in range(_WORKERS_PER_GPU) for gpu in gpus]
        self._pool = ThreadPoolExecutor(len(self._workers), "lumipath-gpu")
        self._running: dict[Future[int], tuple[Worker, int]] = {}
        self._kernel = kernel
        self._stack = _STACK
        self._uploaded: PackedScene | None = None
        self._scenes: dict[int, PackedScene] = {}
        self._built_costs: NDArray[np.float64] | None = None
        self._cancelled = False
        self._uncounted = 0
        self._error: BaseException | None = None
        self._layers: LayerPass | None = None
        # Pixels that the pass adds to.
        self._growing: NDArray[np.bool_] = np.zeros((0, 0), np.bool_)

    def draft(self, packed: Packed) -> PackedScene:
        """The scene with an empty tree."""
        return packed.scene._replace(accel=NO_TREE, features=_features_of(packed))

    def stand_in(self, packed: Packed) -> partial[None]:
        """A small tree, or one as large as it takes; see `Device.stand_in`."""
        return partial(build_for_gpu, len(packed.scene.primitives) > LARGE, _is_large(packed))

    def upload(self, packed: Packed) -> PackedScene:
        """Build the tree and copy every array to the GPUs."""
        scene = self._with_tree(packed)
        for gpu in self._gpus:
            gpu.open()
            self._scenes[gpu.index] = to_device(scene)
        self._uploaded = scene
        return scene

    def _with_tree(self, packed: Packed) -> PackedScene:
        """The scene with a tree that is built for it."""
        geometry = packed.geometry
        lower, upper = geometry.bounds()
        wide = _is_large(packed)
        trees = build_trees(lower, upper, geometry.instancing, **self.tree_options)
        sides, solid = geometry.two_sided, geometry.solid()
        accel, roots, depth = gpu_tree(trees, geometry.vertices, geometry.faces, sides, solid, wide=wide)
        self._stack = _STACK if depth <= _STACK else _DEEP_STACK
        self._built_costs = None
        return packed.with_tree(accel, roots)._replace(features=_features_of(packed))

    def refit(self, packed: Packed) -> PackedScene:
        """Fit the tree to vertices that have moved, or build it anew, and copy what has changed; see `Device.refit`."""
        assert self._uploaded is not None, "upload comes first"
        before, roots = packed.scene.accel, packed.roots
        tree_bit = self._uploaded.features.mask & WIDE_TREE
        wide = bool(tree_bit)
        if self._built_costs is None:
            self._built_costs = gpu_costs(before, roots, wide=wide)
        accel = refit_gpu(before, moved(packed.geometry), wide=wide)
        if is_worn(gpu_costs(accel, roots, wide=wide), self._built_costs):
            scene = self._with_tree(packed)
        else:
            scene = packed.scene._replace(accel=accel, features=Features(packed.scene.features.mask | tree_bit))
        self._update(scene)
        return scene

    def _update(self, scene: PackedScene) -> None:
        """Bring what differs from the scene that was uploaded: features of the settings, or what vertices change."""
        assert self._uploaded is not None, "upload comes first"
        old = self._uploaded._asdict()
        changed = {name: value for name, value in scene._asdict().items() if value is not old[name]}
        scenes = dict(self._scenes)
        for gpu in self._gpus if changed else ():
            gpu.open()
            values = {name: to_device(value) for name, value in changed.items()}
            scenes[gpu.index] = scenes[gpu.index]._replace(**values)
        # All or none of them: where memory runs out, what was there goes on.
        self._scenes = scenes
        self._uploaded = scene

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the kernels for this scene's features, or load them from the disk; see `Device.compile`."""
        for worker in self._workers:
            worker.compile(scene, self._stack, self._kernel)

    def next_stop(self, done: int, pixels: int) -> int:
        """No stop: between slices, too, everything can be asked for."""
        return sys.maxsize

    def render(self, scene: PackedScene, view: View, film: FilmArrays, last: int) -> Generator[int, None, None]:
        """Bring every pixel up to `last` samples; see `Device.render`.

        A sample that is not finite counts as black. The wavefront leaves out only the contribution that is not finite.
        """
        wanted = goals_of(film, last)
        self._update(scene)
        self._cancelled = False
        # Tiles with equal counts go together, up to the first goal among them; unless adaptive, that is the whole film.
        while (lacking := film.counts < wanted).any() and not self._cancelled:
            first = film.counts[lacking].min()
            self._growing = lacking & (film.counts == first)
            taking_part = film.counts[::TILE, ::TILE] == first if film.goals.size else np.zeros_like(film.goals, bool)
            goals = np.where(taking_part, film.goals, 0).astype(film.goals.dtype)
            stop = wanted[self._growing].min()
            yield from self._render_growing(view, film._replace(goals=goals), int(first), int(stop))

    def _render_growing(self, view: View, film: FilmArrays, first: int, last: int) -> Generator[int, None, None]:
        """Add the samples first .. last - 1 to the pixels of `_growing`; the goals of their tiles are no lower."""
        self._begin(view, film, empty=not film.counts.any())
        self._uncounted = 0
        rejected, told = 0, time.perf_counter()
        try:
            while self._running or (first < last and not self._cancelled):
                with deferred_interrupts():
                    first = self._start_slices(first, last if not self._cancelled else first, view)
                rejected += self._finish(wait(self._running, return_when=FIRST_COMPLETED).done)
                if time.perf_counter() - told >= _TELL_SECONDS or not self._running:
                    self._count(film)
                    yield rejected
                    rejected, told = 0, time.perf_counter()
        finally:
            # After an interrupt as well: what the GPUs are still at work on is counted.
            with deferred_interrupts():
                self._finish(wait(self._running).done)
                self._count(film)

    def _begin(self, view: View, film: FilmArrays, *, empty: bool) -> None:
        """Prepare the workers for a pass; where a GPU has no room for the sums of two, it goes on with one."""
        first = self._workers[0]
        for worker in list(self._workers):
            others = [other for other in self._workers if other.gpu is worker.gpu and other is not worker]
            try:
                worker.begin(self._scenes[worker.gpu.index], view, film, empty=empty or worker is not first)
            except OutOfMemoryError:
                if not any(other.has_sums for other in others):
                    raise
                self._workers.remove(worker)

    def _start_slices(self, first: int, last: int, view: View) -> int:
        """Give a slice of the samples first .. last - 1 to each worker that is free; returns the first that is left."""
        pixels = int(view.film_width) * int(view.film_height)
        offset = int(view.first_sample)
        busy = {worker for worker, _ in self._running.values()}
        for worker in self._workers:
            if worker not in busy and first < last:
                samples = worker.slice_of(last - first, pixels, len(self._workers), len(self._gpus))
                task = self._pool.submit(worker.run, offset + first, offset + first + samples, pixels)
                self._running[task] = worker, samples
                first += samples
        return first

    def _finish(self, slices: Iterable[Future[int]]) -> int:
        """Take note of slices that are done; returns how many contributions were not finite.

        Raises:
            DeviceError: one of them failed; the sums are worth nothing then, and `download` says so.
        """
        rejected = 0
        # Samples are in the sums already: an interrupt must not come between.
        with deferred_interrupts():
            for item in slices:
                _, samples = self._running.pop(item)
                error = item.exception()
                self._error = self._error or error
                rejected += 0 if error else item.result()
                self._uncounted += samples
        if self._error is not None:
            raise self._error
        return rejected

    def _count(self, film: FilmArrays) -> None:
        """Count the samples of slices that are done."""
        with deferred_interrupts():
            np.add(film.counts, np.uint32(self._uncounted), out=film.counts, where=self._growing)
            self._uncounted = 0

    def compile_layers(self, scene: PackedScene, view: View, layers: LayerArrays) -> None:
        """Compile the pass that fills layers, or load it from the disk; the first GPU runs it, since it is short."""
        gpu = self._gpus[0]
        gpu.open()
        self._layers = LayerPass(gpu, self._scenes[gpu.index]._replace(features=scene.features), self._stack)

    def render_layers(
        self, scene: PackedScene, view: View, layers: LayerArrays, last: int
    ) -> Generator[int, None, None]:
        """Bring every pixel of the layers up to `last` samples; see `Device.render_layers`."""
        assert self._layers is not None, "compile_layers comes first"
        self._cancelled = False
        yield from self._layers.render(view, layers, last, lambda: self._cancelled)

    def cancel(self) -> None:
        """End the pass after the slices that are under way; see `Device.cancel`."""
        self._cancelled = True

    def download(self, film: FilmArrays) -> None:
        """Bring the sums of all workers to the host.

        Raises:
            DeviceError: a GPU failed since the last `clear`.
        """
        if self._error is not None:
            raise self._error
        if not any(worker.has_sums for worker in self._workers):
            return
        height, width, _ = film.total.shape
        # Some rows at a time: float64 copies of everything would take more memory than the film.
        step = max(1, _DOWNLOAD_NUMBERS // (width * (3 + film.parts.shape[2])))
        for top in range(0, height, step):
            rows = slice(top, min(top + step, height))
            sums = {name: np.zeros(getattr(film, name)[rows].shape, np.float64) for name in _SUMS.values()}
            for worker in self._workers:
                worker.add_to(sums, top, height)
            for name, lost in (("total", film.lost), ("parts", film.parts_lost)):
                total = getattr(film, name)
                total[rows] = sums[name]
                lost[rows] = sums[name] - total[rows]
            film.squares[rows] = sums["squares"]

    def clear(self) -> None:
        """Forget the sums on the GPUs."""
        self._error = None
        for worker in self._workers:
            worker.clear()


def _is_large(packed: Packed) -> bool:
    return len(packed.scene.primitives) > SMALL_SCENE


def _features_of(packed: Packed) -> Features:
    """Those of the scene, and that of its tree."""
    return Features(packed.scene.features.mask | (WIDE_TREE if _is_large(packed) else 0))


def planes_of(array: NDArray[Any], planes: int) -> DeviceArray:
    """As many planes of zeros as wanted, one upon the other, each like an array of the film."""
    return DeviceArray.zeros((planes * array.shape[0], *array.shape[1:]), array.dtype)


def slice_samples(wanted: float, left: int, workers: int, gpus: int = 1, least: int = 1) -> int:
    """Samples per pixel of a worker's next slice.

    Args:
        wanted: samples per pixel that it renders in the time that a slice should take, 0 if not known yet.
        left: samples per pixel that nobody works on yet.
        workers: how many share them.
        gpus: and on how many GPUs.
        least: samples below which a slice is not made shorter only because few are left, if each GPU has one.

    Slices become shorter towards the end, so that all workers finish at about the same time.
    """
    most = min(max(int(wanted), 1), _MOST_SAMPLES)
    # Equal ones: a rest of a few samples would take longer for each.
    slices = max(min(2 * workers, max(gpus, left // least)), -(-left // most))
    return -(-left // slices)


def joint_name(names: list[str]) -> str:
    """Names of several GPUs as one: `2 x NVIDIA H200`."""
    counts = Counter(names)
    return ", ".join(name if count == 1 else f"{count} x {name}" for name, count in counts.items())


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
