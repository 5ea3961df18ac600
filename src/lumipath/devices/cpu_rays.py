"""Stages of the CPU's renderer called from Python one by one, for who wants to know what rays alone take."""

from __future__ import annotations

from ..accel.packets import trace_rays
from ..lang import entry, i32
from ..pack.layout import TILE
from .cpu_arrays import BATCH, TILE_PIXELS
from .cpu_batch import generate


@entry
def camera_rays(scene, view, batch, column, row):
    """Camera rays of all pixels of a whole tile into `batch.rays`; returns how many.

    Args:
        scene: PackedScene with a BVH8.
        view: View.
        batch: Batch.
        column: of the tile's first pixel in the full image.
        row: the same.
    """
    return generate(scene, view, batch, column, row, TILE, TILE, i32(0), i32(BATCH // TILE_PIXELS))


@entry
def trace_batch(scene, batch, n, any_hit, coherent):
    """Trace the first n of `batch.rays`; see `accel.packets.trace_rays`."""
    trace_rays(scene, batch.rays, n, batch.order, any_hit, coherent)
