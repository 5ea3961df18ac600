"""Seconds that a scene takes before it can be rendered, and again when its meshes deform; and its bytes in memory."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import attrs
import numpy as np
from attrs import asdict, field, frozen

from ..errors import UsageError

if TYPE_CHECKING:
    from ..scene import Scene

T = TypeVar("T")

# Of the height of all meshes, from one frame to the next.
_STRETCH = 0.01


@frozen
class BuildFigures:
    """What `measure_build` found. Each list has one number a repeat."""

    scene: str
    device: str
    triangles: int
    """Stored: those of a mesh that instances share count once."""
    pack_s: list[float] = field(factory=list)
    """From the scene to flat arrays."""
    tree_s: list[float] = field(factory=list)
    """Of building the binary tree alone."""
    build_s: list[float] = field(factory=list)
    """Of building the tree, laying it out as the device walks it, and bringing everything there."""
    repack_s: list[float] = field(factory=list)
    """As `pack_s`, of what vertices decide, after they have moved."""
    refit_s: list[float] = field(factory=list)
    """As `build_s`, of the tree that is there, after vertices have moved."""
    bytes: dict[str, int] = field(factory=dict)
    """Of each array that kernels read, the tree's named `accel`."""

    @property
    def bytes_per_triangle(self) -> float:
        """All arrays together."""
        return sum(self.bytes.values()) / self.triangles

    def as_dict(self) -> dict[str, Any]:
        """Every number, ready for JSON."""
        return {**asdict(self), "bytes_per_triangle": self.bytes_per_triangle}


def measure_build(scene: Scene, *, device: str = "auto", threads: int | None = None, repeat: int = 3) -> BuildFigures:
    """Prepare `scene` `repeat` times, and let its meshes deform after each.

    Args:
        scene: with meshes.
        device: as for `Session`.
        threads: of the CPU; all cores where None.
        repeat: number of measurements, 1 or more; one before them, which loads code and touches memory, is left out.

    Raises:
        UsageError: a scene without triangles.
        LumipathError: the scene or the device is wrong.
    """
    from ..accel.two_level import build_trees
    from ..devices import open_device
    from ..pack.scene import pack_scene, repack_scene

    if not scene.stored_triangle_count:
        raise UsageError(f"{scene.name} has no triangles to build a tree of; name a scene with meshes")
    place = open_device(device, threads)
    figures = BuildFigures(scene.name, place.name, scene.stored_triangle_count)
    for number in range(repeat + 1):
        packed = _timed(figures.pack_s, pack_scene, scene)
        lower, upper = packed.geometry.bounds()
        _timed(figures.tree_s, build_trees, lower, upper, packed.geometry.instancing, **place.tree_options)
        uploaded = _timed(figures.build_s, place.upload, packed)
        stretched = _stretched(scene, 1 + _STRETCH * (number + 1))
        moved = _timed(figures.repack_s, repack_scene, stretched, uploaded, packed.unmoved)
        _timed(figures.refit_s, place.refit, moved)
    for seconds in (figures.pack_s, figures.tree_s, figures.build_s, figures.repack_s, figures.refit_s):
        del seconds[0]
    figures.bytes.update(array_bytes(uploaded))
    return figures


def array_bytes(value: Any, name: str = "") -> dict[str, int]:
    """Bytes of all arrays in a NamedTuple and in those within it, by their names: `primitives`, `accel.nodes`."""
    if isinstance(value, np.ndarray):
        return {name: value.nbytes}
    found: dict[str, int] = {}
    for inner, item in getattr(value, "_asdict", dict)().items():
        found |= array_bytes(item, f"{name}.{inner}" if name else inner)
    return found


def _timed(seconds: list[float], work: Callable[..., T], *arguments: Any, **options: Any) -> T:
    """What `work` returns, its time added to `seconds`."""
    start = time.perf_counter()
    result = work(*arguments, **options)
    seconds.append(time.perf_counter() - start)
    return result


def _stretched(scene: Scene, factor: float) -> Scene:
    """The scene with all its meshes higher by a factor."""
    from ..scene import Mesh, with_meshes

    meshes = {part for part in scene.parts() if isinstance(part, Mesh)}
    return with_meshes(scene, {mesh: attrs.evolve(mesh, vertices=mesh.vertices * (1, factor, 1)) for mesh in meshes})
