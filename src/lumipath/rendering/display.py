"""Pictures for people: what notebooks show of an image and of its layers."""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..formats.srgb import encode_srgb
from .layers import REGISTRY
from .oiio import write_pixels
from .tonemap import data_to_display, to_display

_SMALL = 160
# Turns of the circle of hues between numbers that follow one another: the golden ratio keeps them far apart.
_HUE_STEP = 0.618034


@frozen(eq=False)
class Picture:
    """A picture that a notebook shows: `pixels`, (H, W, 3) uint8, as a display takes them."""

    pixels: NDArray[np.uint8]

    def _repr_png_(self) -> bytes:
        """As a PNG file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "picture.png")
            write_pixels(path, self.pixels, {"oiio:ColorSpace": "sRGB"})
            return path.read_bytes()

    def smaller(self, width: int) -> Picture:
        """The same with at most so many columns, by leaving out pixels."""
        step = -(-self.pixels.shape[1] // width)
        return Picture(np.ascontiguousarray(self.pixels[step // 2 :: step, step // 2 :: step]))


def layer_to_display(
    name: str, values: NDArray[Any], exposure: float = 0.0, tonemap: str = "none"
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: what people see of a layer.

    Light is shown as an image is, `albedo` without exposure and tone map, `variance` as its root. Normals are
    (n + 1) / 2, numbers of objects and materials colours far apart, and black where nothing is. Anything else is a
    share of its greatest value in the layer, after its smallest one has been taken away where there are negative ones.

    Args:
        name: of the layer.
        values: (H, W, C).
        exposure: stops, of light.
        tonemap: of light: one of `settings.TONEMAPS`.
    """
    unit = REGISTRY[name].unit if name in REGISTRY else ""
    if name in ("object_id", "material_id"):
        shown = _colours_of_numbers(values[..., 0])
    elif unit == "unit vector":
        shown = data_to_display(values, "normal")
    elif name == "albedo":
        shown = to_display(values)
    elif name == "variance":
        shown = to_display(np.sqrt(np.maximum(values, 0)), exposure, tonemap)
    elif unit.startswith("W") or (name not in REGISTRY and values.shape[2] == 3):
        shown = to_display(values, exposure, tonemap)
    else:
        shown = _shares(_three_channels(values))
    return np.floor(shown * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def _three_channels(values: NDArray[Any]) -> NDArray[np.float32]:
    """One channel three times; two with a third of 0; of more the first three."""
    count = values.shape[2]
    if count == 1:
        return values.repeat(3, axis=2).astype(np.float32)
    wanted = np.zeros((*values.shape[:2], 3), np.float32)
    wanted[..., : min(count, 3)] = values[..., :3]
    return wanted


def _shares(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values from the smallest, or 0, to the greatest one as 0 to 1; what is not finite is 0."""
    finite = np.isfinite(values).all(axis=-1, keepdims=True)
    values = np.where(finite, values, 0)
    lowest = min(float(values.min()), 0.0)
    span = float(values.max()) - lowest
    return np.where(finite, (values - lowest) / (span or 1.0), 0).astype(np.float32)


def _colours_of_numbers(numbers: NDArray[Any]) -> NDArray[np.float32]:
    """(H, W, 3): a hue for each number; -1 is black."""
    hues = (numbers[..., None] * _HUE_STEP + np.array([0.0, 1 / 3, 2 / 3])) % 1.0
    linear = np.clip(np.abs(6 * hues - 3) - 1, 0.05, 0.8)
    return np.where(numbers[..., None] >= 0, encode_srgb(linear), np.float32(0))


def page_of(picture: Picture, small: Mapping[str, Picture], facts: Mapping[str, Any]) -> str:
    """HTML of a picture, of small ones with their names, and of a line of facts; it needs no other file."""
    parts = [_element(picture)]
    if small:
        style = "display:inline-block; margin:4px 8px 4px 0; font-size:small"
        cells = [
            f'<span style="{style}">{_element(part.smaller(_SMALL))}<br>{html.escape(name)}</span>'
            for name, part in small.items()
        ]
        parts.append(f"<div>{''.join(cells)}</div>")
    if facts:
        line = ", ".join(
            f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}" for name, value in facts.items()
        )
        parts.append(f'<div style="font-size:small">{html.escape(line)}</div>')
    return f"<div>{''.join(parts)}</div>"


def _element(picture: Picture) -> str:
    code = base64.b64encode(picture._repr_png_()).decode()
    return f'<img src="data:image/png;base64,{code}">'
