"""Focusing on what a pixel shows: one ray, traced on the CPU whatever renders."""

from __future__ import annotations

import math

import numpy as np

from ..accel.bvh8 import BVH8
from ..accel.trace8 import intersect
from ..kernels.camera import axial_length, camera_ray
from ..kernels.sampler import Numbers
from ..lang import INF, Features, entry, store
from ..lang.kernel import compile_for
from ..pack.layout import CULLING, INSTANCES, OPACITY, PROJECTION, QUADRICS, VERTEX_DATA, PackedScene, View
from ..pack.scene import Packed
from .cpu import with_cpu_tree


@entry
def probe(scene, view, column, row, found):
    """Write how far away the middle of a pixel sees something; infinity where nothing is."""
    # The middle of the pixel, and of a lens and a filter that this scene's features leave out.
    ray = camera_ray(scene, view, column, row, Numbers(0.5, 0.5, 0.5, 0.5))
    hit = intersect(scene, ray)
    store(found, 0, axial_length(scene, view, -ray.d) * hit.t if hit.primitive >= 0 else INF)


def distance_at(
    packed: Packed,
    uploaded: PackedScene,
    view: View,
    pixel: tuple[int, int],
    threads: int | None,
    camera: int = 0,
) -> float:
    """Distance of what a pixel shows, measured as `Camera.focus` is.

    Args:
        packed: the scene.
        uploaded: what a device made of it; its tree is used if it is one that the CPU walks, else one is built.
        view: the camera; its lens is taken for a pinhole.
        pixel: column and row in the full image, row 0 on top.
        threads: for building a tree; all cores where None.
        camera: feature bits of the camera.

    Returns:
        Metres; infinity where the pixel shows the background.
    """
    scene = uploaded if isinstance(uploaded.accel, BVH8) else with_cpu_tree(packed, threads)
    # Nothing else matters to a ray, so that scenes share the compiled code.
    mask = scene.features.mask
    surfaces = QUADRICS | CULLING | INSTANCES | (OPACITY | VERTEX_DATA if mask & OPACITY else 0)
    features = Features(mask & surfaces | camera & PROJECTION)
    found = np.full(1, np.nan, np.float32)
    arguments = (scene._replace(features=features), view, *pixel, found)
    compile_for(probe, *arguments)
    probe(*arguments)
    distance = float(found[0])
    return distance if distance < math.inf else math.inf
