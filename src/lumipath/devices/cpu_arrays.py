"""The scratch memory of a CPU thread: a batch of paths as arrays, one number of all paths in each."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..accel.packets import SORT_KEYS, Order, Rays
from ..kernels.path import Path
from ..kernels.rays import Ray
from ..lang import INF, Vec3, aligned, i32, kernel, load, store, u32

TILE_PIXELS = i32(256)
BATCH = i32(4096)
"""Paths in flight in each thread; a multiple of TILE_PIXELS."""

STRIDE = i32(4096 + 64)
"""Length of a batch's arrays: vector code reads and writes a little behind the last path."""

BLOCK = i32(256)
"""Paths that are shaded together; their results stay in the first-level cache. A multiple of LAPS."""

LAPS = i32(64)
"""Paths are shaded in multiples of this, so that none is left over when the compiler takes many at once."""

RESULTS = i32(27)
"""Rows of the results of shading."""


class Paths(NamedTuple):
    """What goes with the rays of paths: throughput, density, medium, and the path's number in the batch."""

    red: NDArray[Any]
    green: NDArray[Any]
    blue: NDArray[Any]
    pdf: NDArray[Any]
    medium: NDArray[Any]
    owner: NDArray[Any]


class Light(NamedTuple):
    """Radiance: of each path of the batch, or of each shadow ray."""

    red: NDArray[Any]
    green: NDArray[Any]
    blue: NDArray[Any]


class Batch(NamedTuple):
    """The scratch memory of one thread."""

    rays: Rays
    paths: Paths
    shadows: Rays
    shadow_light: Light
    shadow_owner: NDArray[Any]
    shadow_group: NDArray[Any]  # light group of each shadow ray
    gathered: Light
    parts: NDArray[Any]  # (columns * STRIDE,) float32: what goes to each column of `FilmArrays.parts`
    samples: NDArray[Any]  # (2, STRIDE) int32: pixel and sample of each path
    draws: NDArray[Any]  # (4, STRIDE) float32: random numbers of each path, as in `direction_numbers`
    results: NDArray[Any]  # (RESULTS, BLOCK) float32: what shading says of a block of paths, see `cpu_shading`
    order: Order
    clock: NDArray[Any]  # (5,) int64: cycles spent in generate, extend, shade, connect, develop


def new_batch(columns: int = 0) -> Batch:
    """Scratch memory for one thread, for a film with so many columns of layers."""
    size = int(STRIDE)

    # Zeros, as vector code reads behind the last path, and must find numbers there.
    def array(kind: Any, *shape: int) -> np.ndarray:
        return aligned(np.zeros(shape or size, kind))

    def floats(count: int) -> list[np.ndarray]:
        return [array(np.float32) for _ in range(count)]

    def ints(count: int) -> list[np.ndarray]:
        return [array(np.int32) for _ in range(count)]

    def rays() -> Rays:
        return Rays(*floats(7), *ints(2))

    return Batch(
        rays=rays(),
        paths=Paths(*floats(4), *ints(2)),
        shadows=rays(),
        shadow_light=Light(*floats(3)),
        shadow_owner=ints(1)[0],
        shadow_group=ints(1)[0],
        gathered=Light(*floats(3)),
        parts=array(np.float32, max(columns, 1) * size),
        samples=array(np.int32, 2, size),
        draws=array(np.float32, 4, size),
        results=array(np.float32, int(RESULTS), int(BLOCK)),
        order=Order(*ints(2), array(np.int32, SORT_KEYS)),
        clock=np.zeros(5, np.int64),
    )


@kernel
def vec3_at(x, y, z, i):
    """A vector from three arrays."""
    return Vec3(load(x, i), load(y, i), load(z, i))


@kernel
def store_vec3(x, y, z, i, v):
    """A vector into three arrays."""
    store(x, i, v.x)
    store(y, i, v.y)
    store(z, i, v.z)


@kernel
def add_light(light, i, radiance):
    """Add radiance to a path of the batch."""
    store(light.red, i, load(light.red, i) + radiance.x)
    store(light.green, i, load(light.green, i) + radiance.y)
    store(light.blue, i, load(light.blue, i) + radiance.z)


@kernel
def put_in_batch(scene, batch, i, column, value):
    """Add three numbers to the columns of a path of the batch."""
    at = column * STRIDE + i
    store(batch.parts, at, load(batch.parts, at) + value.x)
    store(batch.parts, at + STRIDE, load(batch.parts, at + STRIDE) + value.y)
    store(batch.parts, at + 2 * STRIDE, load(batch.parts, at + 2 * STRIDE) + value.z)


@kernel
def store_ray(rays, i, ray):
    """A ray into the arrays."""
    store_vec3(rays.ox, rays.oy, rays.oz, i, ray.o)
    store_vec3(rays.dx, rays.dy, rays.dz, i, ray.d)
    store(rays.t, i, ray.tmax)


@kernel
def store_path(batch, i, path, owner, pixel, sample):
    """A path into the arrays."""
    store_ray(batch.rays, i, path.ray)
    store_vec3(batch.paths.red, batch.paths.green, batch.paths.blue, i, path.throughput)
    store(batch.paths.pdf, i, path.pdf)
    store(batch.paths.medium, i, path.medium)
    store(batch.paths.owner, i, owner)
    store(batch.samples, i, i32(pixel))
    store(batch.samples, STRIDE + i, i32(sample))


@kernel
def sample_at(batch, i):
    """Pixel and sample of a path."""
    return u32(load(batch.samples, i)), u32(load(batch.samples, STRIDE + i))


@kernel
def load_path(batch, i, depth):
    """A path from the arrays."""
    rays = batch.rays
    paths = batch.paths
    ray = Ray(vec3_at(rays.ox, rays.oy, rays.oz, i), vec3_at(rays.dx, rays.dy, rays.dz, i), INF)
    throughput = vec3_at(paths.red, paths.green, paths.blue, i)
    return Path(ray, throughput, load(paths.pdf, i), depth, load(paths.medium, i), True)
