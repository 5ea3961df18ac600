"""Rays through the trees of a scene, by each way that there is to walk them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core.caching import NullCache

from lumipath.accel.bvh4 import MAX_LEAF, gpu_tree
from lumipath.accel.packets import SORT_KEYS, Order, Rays, trace_rays
from lumipath.accel.trace8 import primitive_of, trace_slot
from lumipath.accel.two_level import build_trees
from lumipath.accel.walk import walk_to_end
from lumipath.devices.cpu import CpuDevice
from lumipath.kernels.rays import Ray
from lumipath.lang import Features, Vec3, aligned_empty, entry, i32, kernel, load, stack_ints, store
from lumipath.pack.layout import INSTANCES, WIDE_TREE, PackedScene
from lumipath.pack.scene import pack_scene
from lumipath.scene import Scene

METHODS = {"one by one": 0, "sorted packets": 1, "packets as they come": 2}
"""Of the tree that a CPU walks."""


def upload(*shapes: Any) -> PackedScene:
    """A scene of these shapes with the tree that a CPU walks."""
    return CpuDevice(1).upload(pack_scene(Scene(shapes=list(shapes))))


def gpu_scene(*shapes: Any, wide: bool) -> PackedScene:
    """The same with a tree that a GPU walks."""
    packed = pack_scene(Scene(shapes=list(shapes)))
    geometry = packed.geometry
    trees = build_trees(*geometry.bounds(), geometry.instancing, max_leaf=MAX_LEAF, block=1)
    sides, solid = geometry.two_sided, geometry.solid()
    accel, roots, _ = gpu_tree(trees, geometry.vertices, geometry.faces, sides, solid, wide=wide)
    features = Features(packed.scene.features.mask | (WIDE_TREE if wide else 0))
    return packed.with_tree(accel, roots)._replace(features=features)


@kernel
def _ray(rays, i):
    o = Vec3(load(rays.ox, i), load(rays.oy, i), load(rays.oz, i))
    return Ray(o, Vec3(load(rays.dx, i), load(rays.dy, i), load(rays.dz, i)), load(rays.t, i))


@entry
def _trace(scene, rays, n, order, primitives, any_hit, method):
    if method == 0:
        for i in range(n):
            found = trace_slot(scene, _ray(rays, i), i32(0), any_hit)
            store(rays.t, i, found.t)
            store(rays.slot, i, found.primitive)
            store(rays.instance, i, found.instance)
    else:
        trace_rays(scene, rays, n, order, any_hit, method == 2)
    for i in range(n):
        store(primitives, i, primitive_of(scene.accel, load(rays.slot, i)))


@entry
def _walk(scene, rays, n, primitives, any_hit):
    for i in range(n):
        found = walk_to_end(scene, _ray(rays, i), any_hit, stack_ints(256))
        store(rays.t, i, found.t)
        store(rays.instance, i, found.instance)
        store(primitives, i, found.primitive)


# The disk cache does not know the sources of tests.
_trace._cache = NullCache()
_walk._cache = NullCache()


def hits(
    scene: PackedScene, o: Any, d: Any, tmax: Any = np.inf, any_hit: bool = False, method: str = "one by one"
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What rays find; with `any_hit` only whether there is a primitive is defined.

    Args:
        scene: of `upload`, or of `gpu_scene`, for which the method does not count.
        o: (N, 3) origins.
        d: (N, 3) directions of length 1.
        tmax: where rays end.
        any_hit: whether any hit will do.
        method: of `METHODS`.

    Returns:
        Distances (N,) float32, primitives (N,) and instances (N,), -1 for none.
    """
    n = len(o)
    columns = [aligned_empty(n + 64, np.float32) for _ in range(7)]
    values = [*np.transpose(np.asarray(o, np.float32)), *np.transpose(np.asarray(d, np.float32)), np.float32(tmax)]
    for column, value in zip(columns, values):
        column[:n] = value
    slot, instance, numbers, keys, primitives = (aligned_empty(n + 64, np.int32) for _ in range(5))
    rays = Rays(*columns, slot, instance)
    if hasattr(scene.accel, "triangles"):
        _walk(scene, rays, n, primitives, any_hit)
    else:
        order = Order(numbers, keys, aligned_empty(SORT_KEYS, np.int32))
        _trace(scene, rays, n, order, primitives, any_hit, METHODS[method])
    found = primitives[:n].astype(np.int64)
    placed = scene.features.mask & INSTANCES
    placing = np.where(found >= 0, instance[:n], -1) if placed else np.full(n, -1)
    return columns[6][:n].copy(), found, placing
