"""Compiling ahead: kernels for what scenes commonly use, so that first renders start at once."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed

from attrs import frozen

from ..lang.host import usable_cores
from ..pack.scene import pack_scene
from ..scenes import builtin, names
from .session import Session

# Its features are those of the smaller ones.
_LEFT_OUT = ("bench-blob1m",)


@frozen
class Warmed:
    """What one scene's kernels on one device took to compile, or to load where they were there already."""

    scene: str
    device: str
    seconds: float


def common_scenes() -> list[str]:
    """Built-in scenes that together have every set of features of all of them, without repetition."""
    found: dict[tuple[int, bool], str] = {}
    for name in names():
        if name not in _LEFT_OUT:
            packed = pack_scene(builtin(name))
            # Large scenes have other trees on a GPU.
            found.setdefault((packed.scene.features.mask, len(packed.scene.primitives) > 2000), name)
    return list(found.values())


def warm_up(devices: Sequence[str], scenes: Sequence[str] | None = None) -> Iterator[Warmed]:
    """Compile the kernels of scenes in as many processes as there are cores; yields each as it is done.

    Args:
        devices: as for `Session`: `cpu`, `cuda:0`.
        scenes: names of built-in scenes; `common_scenes` where None.

    Raises:
        LumipathError: a device cannot be used.
    """
    tasks = [(scene, device) for device in devices for scene in (scenes if scenes is not None else common_scenes())]
    workers = min(usable_cores(), max(len(tasks), 1))
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        work = [pool.submit(_compile, *task) for task in tasks]
        try:
            for done in as_completed(work):
                yield done.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _compile(scene: str, device: str) -> Warmed:
    start = time.perf_counter()
    Session(builtin(scene), device=device, width=8, threads=1)
    return Warmed(scene, device, time.perf_counter() - start)
