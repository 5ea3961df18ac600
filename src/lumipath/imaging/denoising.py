"""Denoising by Open Image Denoise."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError, RenderError, UsageError
from ..rendering.image import Image

INSTALL_HINT = "Open Image Denoise is not installed; install it with: pip install 'lumipath[denoise]'"


GUIDES = ("albedo", "normal")
"""Layers that help the denoiser."""


def require_denoiser() -> None:
    """Nothing if Open Image Denoise is installed.

    Raises:
        UsageError: it is not; the message says how to install it.
    """
    if find_spec("mitsuba_oidn") is None:
        raise UsageError(INSTALL_HINT)


def denoise(image: Image, albedo: Any = None, normal: Any = None) -> Image:
    """The image without noise, by the network of Open Image Denoise for linear radiance of any range.

    Args:
        image: a noisy render. Negative values and pixels that are not finite count as black.
        albedo: (H, W, 3), 0 to 1, what the camera sees of diffuse and mirror colours; keeps textures sharp. By default
            the image's layer of this name, if it has one.
        normal: (H, W, 3), -1 to 1, what it sees of shading normals; keeps edges sharp. Needs `albedo`. By default the
            image's layer of this name, if there is an albedo.

    Raises:
        UsageError: Open Image Denoise is not installed, or there are normals without albedo.
        ImageError: albedo or normals have another size.
        RenderError: denoising failed.
    """
    require_denoiser()
    albedo = image.layers.get("albedo") if albedo is None else albedo
    if normal is None and albedo is not None:
        normal = image.layers.get("normal")
    if normal is not None and albedo is None:
        raise UsageError("the denoiser takes normals only together with albedo; give both")
    guides = {
        name: _guide(layer, name, image.shape)
        for name, layer in (("albedo", albedo), ("normal", normal))
        if layer is not None
    }
    import mitsuba_oidn

    try:
        pixels = mitsuba_oidn.denoise(_clean(np.maximum(image.pixels, 0)), hdr=True, **guides)
    except RuntimeError as error:
        raise RenderError(f"Open Image Denoise failed: {' '.join(str(error).split())}") from None
    denoiser = f"Open Image Denoise {mitsuba_oidn.oidn_version()}"
    return Image(np.asarray(pixels), {**image.metadata, "denoiser": denoiser}, image.layers)


def _guide(layer: Any, name: str, shape: tuple[int, int, int]) -> NDArray[np.float32]:
    values = np.ascontiguousarray(layer, np.float32)
    if values.shape != shape:
        raise ImageError(f"{name} has the shape {values.shape}, the image {shape}: they must be equal")
    return _clean(values)


def _clean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """A contiguous copy with 0 where a pixel is not finite."""
    return np.ascontiguousarray(np.where(np.isfinite(values).all(axis=2, keepdims=True), values, np.float32(0)))
