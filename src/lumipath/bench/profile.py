"""Where the CPU's time goes: the stages of a path, and rays per second beside Embree's on the same rays."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from attrs import asdict, field, frozen
from numpy.typing import NDArray

from ..errors import UsageError
from ..settings import RenderSettings
from .throughput import PROFILE_SETTINGS

if TYPE_CHECKING:
    from ..devices.cpu_arrays import Batch
    from ..pack.layout import PackedScene, View
    from ..pack.scene import Packed
    from ..scene import Scene

STAGES = ("generate", "extend", "shade", "shadow", "develop")
"""Camera rays; nearest hits of paths; surfaces, lights and next directions; shadow rays; adding to the film."""

KINDS = ("camera", "bounce", "shadow")
"""Nearest hits of camera rays; nearest hits of rays that left these in random directions; whether those hit at all."""

_TILE = 16
# So that each repeat takes a good part of a second.
_TILES = 256
# Of the scene's extent: how far rays start from where others ended.
_OFFSET = 1e-5


@frozen
class RayFigures:
    """Rays of one kind, one thread."""

    kind: str
    mrays_per_s: list[float] = field(factory=list)
    """Million rays per second of each repeat."""
    embree_mrays_per_s: list[float] = field(factory=list)
    """Embree's, in turns with ours; empty where embreex is not installed."""
    disagreeing: float | None = None
    """Share of the rays that hit something for one of both and nothing for the other."""


@frozen
class ProfileFigures:
    """What `measure_profile` found."""

    scene: str
    device: str
    mpaths_per_s: float
    """Of all threads."""
    shares: dict[str, float]
    """Of the threads' time in each of the `STAGES`, in the last render; together 1."""
    rays: list[RayFigures]

    def as_dict(self) -> dict[str, Any]:
        """Every number, ready for JSON."""
        return asdict(self)


class _Rays(NamedTuple):
    """(N, 3) origins and unit directions, tile by tile."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]


_Tracer = Callable[[_Rays, str], tuple[NDArray[np.int32], float]]


def measure_profile(scene: Scene, settings: RenderSettings = PROFILE_SETTINGS, *, repeat: int = 3) -> ProfileFigures:
    """Render `scene` on the CPU, then trace some of its rays alone.

    Args:
        scene: of triangles alone, without instances, so that others can be asked about the same rays.
        settings: how to render; the image must have room for a tile of 16 x 16 pixels.
        repeat: renders, and times that each kind of rays is traced, 1 or more; one before them does not count.

    Raises:
        UsageError: a scene of other shapes, an integrator that has no stages, or too small an image.
        LumipathError: the scene or a setting is wrong.
    """
    from ..devices.cpu import CpuDevice
    from ..lang import Features, u32
    from ..pack.camera import camera_of
    from ..pack.scene import image_features, pack_scene, pack_view
    from ..rendering.film import Film

    if settings.integrator != "path":
        raise UsageError(f"the integrator {settings.integrator} has no stages to profile; choose path")
    device, camera = CpuDevice(settings.threads), camera_of(scene, settings)
    host, view = pack_scene(scene, light_sampling=settings.light_sampling), pack_view(camera, settings)
    triangles = len(host.geometry.faces)
    if not 0 < triangles == len(host.scene.primitives) or host.geometry.instancing is not None:
        raise UsageError(f"{scene.name} has other shapes than triangles, or instances; name a scene of meshes")
    width, height = int(view.film_width), int(view.film_height)
    if min(width, height) < _TILE:
        raise UsageError(f"{width} x {height} pixels are less than a tile of {_TILE} x {_TILE}")
    packed = device.upload(host)
    packed = packed._replace(features=Features(image_features(packed.features.mask, settings, camera)))
    film = Film(width, height)
    device.compile(packed, view, film.arrays)
    speeds = []
    for number in range(repeat + 1):
        film.clear()
        before, start = device.stage_cycles(), time.perf_counter()
        for _ in device.render(
            packed, view._replace(seed=u32(settings.seed + number)), film.arrays, settings.sample_limit
        ):
            pass
        speeds.append(width * height * settings.sample_limit / (time.perf_counter() - start) / 1e6)
    cycles = device.stage_cycles() - before
    shares = dict(zip(STAGES, (cycles / cycles.sum()).tolist(), strict=True))
    rays = _measure_rays(host, packed, view, repeat)
    return ProfileFigures(scene.name, device.name, statistics.median(speeds[1:]), shares, rays)


def _measure_rays(host: Packed, packed: PackedScene, view: View, repeat: int) -> list[RayFigures]:
    """Each kind of rays, by us and by Embree in turns."""
    from ..devices.cpu_arrays import new_batch

    batch = new_batch()
    ways: list[_Tracer] = [partial(_trace, packed, batch)]
    if find_spec("embreex"):
        ways.append(_embree_of(host))
    camera = _camera_rays(packed, view, batch)
    bounce = _bounced(host, packed, batch, camera)
    found = []
    for kind, rays in zip(KINDS, (camera, bounce, bounce), strict=True):
        results = []
        speeds: tuple[list[float], list[float]] = ([], [])
        for _ in range(repeat + 1):
            results = [way(rays, kind) for way in ways]
            for own, (_, seconds) in zip(speeds, results, strict=False):
                own.append(len(rays.origins) / seconds / 1e6)
        share = _disagreement(*(hits for hits, _ in results)) if len(ways) > 1 else None
        found.append(RayFigures(kind, speeds[0][1:], speeds[1][1:], share))
    return found


def _trace(packed: PackedScene, batch: Batch, rays: _Rays, kind: str) -> tuple[NDArray[np.int32], float]:
    """Places in the tree of what rays hit, negative where they hit nothing; and seconds."""
    from ..devices.cpu_arrays import BATCH
    from ..devices.cpu_rays import trace_batch

    seconds, found = 0.0, np.empty(len(rays.origins), np.int32)
    own = batch.rays
    for first in range(0, len(found), int(BATCH)):
        part = slice(first, first + int(BATCH))
        n = len(found[part])
        for axis, (o, d) in enumerate(((own.ox, own.dx), (own.oy, own.dy), (own.oz, own.dz))):
            o[:n], d[:n] = rays.origins[part, axis], rays.directions[part, axis]
        own.t[:n] = np.inf
        start = time.perf_counter()
        trace_batch(packed, batch, n, kind == "shadow", kind == "camera")
        seconds += time.perf_counter() - start
        found[part] = own.slot[:n]
    return found, seconds


def _embree_of(host: Packed) -> _Tracer:
    """The same by Embree: numbers of triangles, or for shadow rays 0 where they hit."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(host.geometry.vertices[host.geometry.faces], np.float32))

    def trace(rays: _Rays, kind: str) -> tuple[NDArray[np.int32], float]:
        start = time.perf_counter()
        found = scene.run(rays.origins, rays.directions, query="OCCLUDED" if kind == "shadow" else "INTERSECT")
        return found, time.perf_counter() - start

    # Its tree is built when it is first asked.
    trace(_Rays(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)), "camera")
    return trace


def _disagreement(ours: NDArray[np.int32], theirs: NDArray[np.int32]) -> float:
    """Share of the rays that hit something for one of both only."""
    return float(np.mean((ours < 0) != (theirs < 0)))


def _camera_rays(packed: PackedScene, view: View, batch: Batch) -> _Rays:
    """All camera rays of tiles that are spread over the image."""
    from ..devices.cpu_rays import camera_rays

    across, down = int(view.film_width) // _TILE, int(view.film_height) // _TILE
    own, origins, directions = batch.rays, [], []
    for tile in np.linspace(0, across * down - 1, min(_TILES, across * down)).astype(int):
        column, row = int(view.left) + tile % across * _TILE, int(view.top) + tile // across * _TILE
        n = camera_rays(packed, view, batch, np.int32(column), np.int32(row))
        origins.append(np.stack([own.ox[:n], own.oy[:n], own.oz[:n]], axis=1))
        directions.append(np.stack([own.dx[:n], own.dy[:n], own.dz[:n]], axis=1))
    return _Rays(np.concatenate(origins), np.concatenate(directions))


def _bounced(host: Packed, packed: PackedScene, batch: Batch, rays: _Rays) -> _Rays:
    """Rays that leave what others hit, by the cosine law."""
    from ..accel.bvh8 import PRIMITIVE_MASK

    slots, _ = _trace(packed, batch, rays, "nearest")
    hit = slots >= 0
    numbers = packed.accel.groups.view(np.int32)[slots[hit] >> 3, 72 + (slots[hit] & 7)] & PRIMITIVE_MASK
    normals, o, d = packed.primitives[numbers, :3], rays.origins[hit], rays.directions[hit]
    steepness = (normals * d).sum(axis=1, keepdims=True)
    corner = host.geometry.vertices[host.geometry.faces[numbers, 0]]
    points = o + d * (((corner - o) * normals).sum(axis=1, keepdims=True) / steepness)
    normals = np.where(steepness > 0, -normals, normals)
    # A point of the unit sphere around the tip of the normal.
    ball = np.random.default_rng(0).standard_normal(points.shape)
    away = normals + ball / np.linalg.norm(ball, axis=1, keepdims=True)
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-6)
    origins = points + normals * (_OFFSET * np.linalg.norm(np.ptp(points, axis=0)))
    return _Rays(np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(away, np.float32))
