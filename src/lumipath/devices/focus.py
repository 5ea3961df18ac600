"""Focusing on what a pixel shows: one ray, traced on the CPU whatever renders."""

from __future__ import annotations

import math

import numpy as np

from ..accel.bvh8 import BVH8
from ..accel.trace8 import intersect
from ..kernels.camera import camera_ray
from ..kernels.sampler import Numbers
from ..kernels.vectors import dot, xyz
from ..lang import Features, entry, load4, store
from ..lang.kernel import compile_for
from ..pack.layout import CULLING, OPACITY, QUADRICS, VERTEX_DATA, PackedScene, View
from ..pack.scene import Packed
from .cpu import with_cpu_tree


@entry
def probe(scene, view, column, row, found):
    """Write how far along the viewing direction the middle of a pixel sees something; infinity where nothing is."""
    # The middle of the pixel, and of a lens that this scene's features leave out.
    ray = camera_ray(scene, view, column, row, Numbers(0.5, 0.5, 0.5, 0.5))
    hit = intersect(scene, ray)
    store(found, 0, -dot(ray.d, xyz(load4(view.lens, 12))) * hit.t)


def distance_at(
    packed: Packed, uploaded: PackedScene, view: View, pixel: tuple[int, int], threads: int | None
) -> float:
    """Distance of what a pixel shows, measured along the viewing direction, as `Camera.focus` is.

    Args:
        packed: the scene.
        uploaded: what a device made of it; its tree is used if it is one that the CPU walks, else one is built.
        view: the camera; its lens is taken for a pinhole.
        pixel: column and row in the full image, row 0 on top.
        threads: for building a tree; all cores where None.

    Returns:
        Metres; infinity where the pixel shows the background.
    """
    scene = uploaded if isinstance(uploaded.accel, BVH8) else with_cpu_tree(packed, threads)
    # Nothing else matters to a ray, so that scenes share the compiled code.
    mask = scene.features.mask
    features = Features(mask & (QUADRICS | CULLING | (OPACITY | VERTEX_DATA if mask & OPACITY else 0)))
    found = np.full(1, np.nan, np.float32)
    arguments = (scene._replace(features=features), view, *pixel, found)
    compile_for(probe, *arguments)
    probe(*arguments)
    distance = float(found[0])
    return distance if distance < math.inf else math.inf
