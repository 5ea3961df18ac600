"""The curve between linear light and the numbers of 8-bit files (IEC 61966-2-1), on NumPy arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene.values import Floats


def encode_srgb(linear: Any) -> Floats:
    """The piecewise sRGB curve, for linear values in 0..1; any shape, float32."""
    linear = np.asarray(linear, np.float32)
    curve = np.float32(1.055) * linear ** np.float32(1 / 2.4) - np.float32(0.055)
    return np.where(linear <= 0.0031308, np.float32(12.92) * linear, curve)


def decode_srgb(encoded: Any) -> Floats:
    """The inverse of `encode_srgb`, for values in 0..1; any shape, float32.

    float64 values are decoded with all their digits before they are rounded.
    """
    encoded = np.asarray(encoded)
    encoded = encoded if encoded.dtype == np.float64 else encoded.astype(np.float32)
    curve = ((encoded + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, encoded / 12.92, curve).astype(np.float32)
