"""From linear radiance to what a display shows: tone curves and the sRGB curve, on NumPy arrays.

A tonemap takes linear Rec.709 values (..., 3), 0 or more, and returns linear display values in 0..1; `encode_srgb` then
makes the numbers that an 8-bit file holds. `linear` alone skips that curve.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..formats.srgb import encode_srgb
from ..settings import TONEMAPS

Floats = NDArray[np.float32]

# Every curve is flat there, and no intermediate square overflows float32 below it.
_LIMIT = np.float32(1e15)


def clamp(linear: Floats) -> Floats:
    """Everything above 1 becomes 1: what `none` and `linear` do."""
    return np.clip(linear, 0, 1)


# Each row adds up to 1, so that grey stays grey: the published inset is off by 1e-4.
_AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
_AGX_INSET /= _AGX_INSET.sum(axis=1, keepdims=True)
_AGX_OUTSET = np.linalg.inv(_AGX_INSET)
_AGX_LOW, _AGX_HIGH = -10.0, 6.5  # stops about middle grey
_AGX_MIDDLE_GREY = 0.18
_AGX_PIVOT_X, _AGX_PIVOT_Y = -_AGX_LOW / (_AGX_HIGH - _AGX_LOW), 0.5
_AGX_SLOPE = 2.0
_AGX_TOE, _AGX_SHOULDER = 3.0, 3.25


def _agx_half(distance: Floats, reach_x: float, reach_y: float, power: float) -> Floats:
    """One half of the sigmoid: from 0 at the pivot with the common slope to `reach_y` at the distance `reach_x`."""
    steepness = (_AGX_SLOPE * reach_x) ** -power * ((_AGX_SLOPE * reach_x / reach_y) ** power - 1.0)
    scale = np.float32(steepness ** (-1.0 / power))
    x = np.float32(_AGX_SLOPE) * distance / scale
    return scale * x / (1 + x ** np.float32(power)) ** np.float32(1 / power)


def agx(linear: Floats) -> Floats:
    """Troy Sobotka's AgX, base look: inset, log2 encoding, sigmoid, outset.

    Matrix and sigmoid follow https://github.com/sobotka/AgX-S2O3 (AgX.py; the sigmoid is Jed Smith's), the outset that
    restores saturation follows Benjamin Wrensch, "Minimal AgX implementation" (iolite-engine.com).
    """
    inset = np.asarray(linear, np.float32) @ _AGX_INSET.T.astype(np.float32)
    stops = np.log2(np.maximum(inset, np.float32(1e-10)) / np.float32(_AGX_MIDDLE_GREY))
    x = np.clip((stops - np.float32(_AGX_LOW)) / np.float32(_AGX_HIGH - _AGX_LOW), 0, 1)
    above = x - np.float32(_AGX_PIVOT_X)
    toe = _agx_half(np.maximum(-above, 0), _AGX_PIVOT_X, _AGX_PIVOT_Y, _AGX_TOE)
    shoulder = _agx_half(np.maximum(above, 0), 1 - _AGX_PIVOT_X, 1 - _AGX_PIVOT_Y, _AGX_SHOULDER)
    encoded = np.float32(_AGX_PIVOT_Y) + shoulder - toe
    # The curve is made for a display of power 2.2; its light is what the sRGB curve must encode.
    return np.clip(encoded @ _AGX_OUTSET.T.astype(np.float32), 0, 1) ** np.float32(2.2)


_ACES_INPUT = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
_ACES_OUTPUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
# Rows that add up to 1 keep grey grey; the published output matrix is off by 1e-5.
_ACES_OUTPUT /= _ACES_OUTPUT.sum(axis=1, keepdims=True)


def aces(linear: Floats) -> Floats:
    """Stephen Hill's fit of the ACES RRT and ODT for sRGB displays (BakingLab, ACES.hlsl, MIT licence)."""
    v = np.asarray(linear, np.float32) @ _ACES_INPUT.T.astype(np.float32)
    numerator = v * (v + np.float32(0.0245786)) - np.float32(0.000090537)
    fit = numerator / (v * (np.float32(0.983729) * v + np.float32(0.4329510)) + np.float32(0.238081))
    return np.clip(fit @ _ACES_OUTPUT.T.astype(np.float32), 0, 1)


_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def luminance(linear: NDArray[Any]) -> NDArray[np.float64]:
    """The luminance (...) float64 of linear Rec.709 values (..., 3), after ITU-R BT.709."""
    return np.asarray(linear) @ _LUMINANCE


def reinhard(linear: Floats) -> Floats:
    """Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", equation 3: L / (1 + L).

    Colours are scaled by luminance, so that their hue stays; saturated ones may still exceed 1, and are clamped.
    """
    # In float64, since the last digits of bright greys would not be in order else.
    return np.clip(linear / (1 + luminance(linear)[..., None]), 0, 1).astype(np.float32)


_CURVES: dict[str, Callable[[Floats], Floats]] = {
    "none": clamp,
    "linear": clamp,
    "agx": agx,
    "aces": aces,
    "reinhard": reinhard,
}


def check_tonemap(name: str) -> str:
    """`name` itself, if it is one of `settings.TONEMAPS`.

    Raises:
        UsageError: it is not; the message lists them.
    """
    if name not in TONEMAPS:
        near = difflib.get_close_matches(str(name), TONEMAPS, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise UsageError(f"tonemap is {name!r}: it must be one of {', '.join(TONEMAPS)}{hint}")
    return name


DATA_INTEGRATORS = ("normal", "depth")
"""Integrators whose pixels are no light: neither exposure nor a curve is for them."""


def data_to_display(pixels: Any, integrator: str) -> Floats:
    """What an 8-bit file shows of pixels that are no light, as float32 in 0..1.

    Normals are shown as (n + 1) / 2, depths as shares of the greatest one in the image; pixels that are not finite are
    black.

    Args:
        pixels: (..., 3) float32.
        integrator: what made them; one of `DATA_INTEGRATORS`.
    """
    values = np.asarray(pixels, np.float32)
    finite = np.isfinite(values).all(axis=-1, keepdims=True)
    values = np.where(finite, values, 0)
    if integrator == "depth":
        greatest = values.max(initial=0)
        return np.clip(values / greatest, 0, 1) if greatest > 0 else np.zeros_like(values)
    return np.where(finite, np.clip(values * np.float32(0.5) + np.float32(0.5), 0, 1), 0)


def to_display(pixels: Any, exposure: float = 0.0, tonemap: str = "none") -> Floats:
    """What an 8-bit file shows, still as float32 in 0..1.

    Args:
        pixels: (..., 3) linear Rec.709 radiance. Negative values count as 0, a pixel with a NaN or an
            infinity as black.
        exposure: stops; each doubles the light.
        tonemap: one of `settings.TONEMAPS`. `none` clamps, `linear` clamps and leaves out the sRGB curve.

    Raises:
        UsageError: no such tonemap.
    """
    curve = _CURVES[check_tonemap(tonemap)]
    linear = np.asarray(pixels, np.float32)
    finite = np.isfinite(linear).all(axis=-1, keepdims=True)
    with np.errstate(over="ignore"):
        exposed = np.where(finite, np.maximum(linear, 0), 0) * np.float32(2.0**exposure)
    shown = curve(np.minimum(exposed, _LIMIT))
    return shown if tonemap == "linear" else encode_srgb(shown)
