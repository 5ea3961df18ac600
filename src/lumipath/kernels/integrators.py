"""Integrators whose sample of a pixel is one function. The path tracer is not one of them: see `path.py`."""

from __future__ import annotations

from ..lang import kernel
from ..pack.layout import WHITTED
from .looks import look
from .whitted import whitted


@kernel(needs=WHITTED, otherwise=look)
def estimate(scene, view, trace, column, row, pixel, sample):
    """What one sample adds to a pixel, by the integrator that the scene's features name.

    Args:
        scene: PackedScene.
        view: View.
        trace: how the device finds hits: a kernel (scene, ray, any_hit) -> Hit.
        column: of the pixel in the full image.
        row: of the pixel in the full image, 0 at the top.
        pixel: number of the pixel in the full image, for random numbers.
        sample: number of the sample in the pixel.
    """
    return whitted(scene, view, trace, column, row, pixel, sample)
