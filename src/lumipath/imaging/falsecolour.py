"""Numbers as colours: luminance in stops, and maps of errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError, UsageError
from ..rendering.image import Image
from ..rendering.tonemap import luminance

MIDDLE_GREY = 0.18
NOT_FINITE = (1.0, 0.0, 1.0)
"""Magenta, which no map contains."""


def colour_map(values: NDArray[Any], name: str = "viridis") -> NDArray[np.float32]:
    """(H, W, 3) linear Rec.709 colours of (H, W) values: 0 is the beginning of the map and 1 its end.

    Args:
        values: others are clamped; what is not finite becomes magenta.
        name: a map of OpenImageIO: `viridis` and `magma` are perceptually uniform (van der Walt and Smith 2015).
    """
    import OpenImageIO

    finite = np.isfinite(values)
    shown = np.ascontiguousarray(np.clip(np.where(finite, values, 0), 0, 1), np.float32)[:, :, None]
    mapped = OpenImageIO.ImageBufAlgo.color_map(OpenImageIO.ImageBuf(shown), 0, name)
    if mapped.has_error:
        raise ImageError(f"colour map {name}: {mapped.geterror().strip()}")
    colours = np.asarray(mapped.get_pixels(OpenImageIO.FLOAT), np.float32).reshape(*values.shape, 3)
    return np.where(finite[:, :, None], colours, np.asarray(NOT_FINITE, np.float32))


def false_colour(image: Image, low: float = -8.0, high: float = 8.0) -> Image:
    """Luminance in stops about middle grey, 0.18, as colours from dark blue (`low`) by green to yellow (`high`).

    Black counts as `low`; a pixel that is not finite becomes magenta.

    Raises:
        UsageError: `low` is not below `high`.
    """
    if not low < high:
        raise UsageError(f"false colour from {low:g} to {high:g} stops: the first must be below the second")
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        light = luminance(image.pixels)
        stops = np.log2(np.maximum(light, 1e-30) / np.float32(MIDDLE_GREY))
        # A pixel whose parts are not all finite is none, whatever its luminance says.
        stops = np.where(np.isfinite(image.pixels).all(axis=2), stops, np.nan)
    return Image(colour_map((stops - low) / (high - low)), dict(image.metadata))
