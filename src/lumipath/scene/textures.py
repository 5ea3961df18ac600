"""Textures: images, and patterns of two colours, that are looked up by the texture coordinates of a surface."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from ..errors import SceneError
from .values import Floats, colour, float_array

WRAP_MODES = ("repeat", "mirror", "clamp")
FILTERS = ("bilinear", "nearest", "checker")
CHANNELS = ("", "r", "g", "b", "a")

Pair = tuple[float, float]


def _wrap(value: Any) -> Any:
    return (value, value) if isinstance(value, str) else tuple(value)


def _factor(value: Any) -> Any:
    return colour(value, "texture factor")


@frozen(eq=False)
class Texture:
    """An image that is looked up by uv.

    A colour is what the image shows, times `factor`; a number is one `channel` of that.

    Args:
        image: (height, width), (height, width, 3) or, with alpha, (height, width, 4); row 0 at the top, which is v = 1.
            Floating-point numbers are linear values of 0 or more and are kept as float32. uint8 stays 8 bits wide; 255
            stands for 1.
        wrap: what lies outside 0..1: `repeat`, `mirror` (every other copy is turned over) or `clamp` to the edge; one
            for both axes, or a pair for u and v.
        name: for messages, usually the file.
        filter: between texels: `bilinear` or `nearest`. `checker` is for `Checker`.
        srgb: whether red, green and blue of a uint8 image follow the sRGB curve, as colours do. False for data.
        channel: `r`, `g`, `b` or `a`: the one that is looked up; "": a colour, and of a number the red channel.
        factor: what texels are multiplied by: one number or three.
        offset: added to uv at last.
        rotation: of uv about (0, 0) after `scale`, degrees counter-clockwise, so the image turns clockwise.
        scale: what uv is multiplied by at first: 2 shows the image twice as often.
        mipmaps: whether the image is also kept in coarser steps, so that it does not flicker from afar.

    Raises:
        SceneError: another shape, no pixels, negative values, unknown names.
    """

    image: NDArray[Any] = field()
    wrap: tuple[str, str] = field(default=("repeat", "repeat"), converter=_wrap)
    name: str = ""
    filter: str = field(default="bilinear", kw_only=True)
    srgb: bool = field(default=True, kw_only=True)
    channel: str = field(default="", kw_only=True)
    factor: tuple[float, float, float] = field(default=(1.0, 1.0, 1.0), converter=_factor, kw_only=True)
    offset: Pair = field(default=(0.0, 0.0), kw_only=True)
    rotation: float = field(default=0.0, kw_only=True)
    scale: Pair = field(default=(1.0, 1.0), kw_only=True)
    mipmaps: bool = field(default=True, kw_only=True)

    def __attrs_post_init__(self) -> None:
        where = f"texture {self.name or 'image'}"
        object.__setattr__(self, "image", _frozen_image(self.image, where))
        for value in self.wrap:
            if value not in WRAP_MODES or len(self.wrap) != 2:
                raise SceneError(f"{where}: wrap {value!r} is not one of {', '.join(WRAP_MODES)}, or a pair of them")
        if self.filter not in FILTERS:
            raise SceneError(f"{where}: filter {self.filter!r} is not one of {', '.join(FILTERS[:2])}")
        if self.channel not in CHANNELS:
            raise SceneError(f"{where}: channel {self.channel!r} is not one of {', '.join(CHANNELS[1:])}")
        if self.channel == "a" and self.image.shape[2] != 4:
            raise SceneError(f"{where}: it has no alpha; read the image with alpha, or take another channel")
        for name in ("offset", "scale"):
            pair = float_array(getattr(self, name), (2,), f"{where}: {name}", limit=1e6)
            object.__setattr__(self, name, (float(pair[0]), float(pair[1])))
        if 0.0 in self.scale:
            raise SceneError(f"{where}: scale is {self.scale}: neither part may be 0")
        object.__setattr__(self, "rotation", float(float_array([self.rotation], (1,), f"{where}: rotation", 1e6)[0]))

    def view(self, channel: str, factor: float = 1.0) -> Texture:
        """One channel of the same image, for a number: `r`, `g`, `b` or `a`, times `factor`. They share the image."""
        return attrs.evolve(self, channel=channel, factor=factor)

    def with_gltf_transform(self, offset: Pair = (0, 0), rotation: float = 0.0, scale: Pair = (1, 1)) -> Texture:
        """The same image under a KHR_texture_transform: radians, in coordinates whose v runs downwards."""
        c, s = math.cos(rotation), math.sin(rotation)
        moved = (offset[0] + scale[1] * s, 1 - offset[1] - scale[1] * c)
        return attrs.evolve(self, offset=moved, rotation=math.degrees(rotation), scale=scale)

    def matrix(self) -> NDArray[np.float64]:
        """(2, 3): from (u, v, 1) to coordinates of the image."""
        c, s = math.cos(math.radians(self.rotation)), math.sin(math.radians(self.rotation))
        (x, y), (a, b) = self.offset, self.scale
        return np.array([(a * c, -b * s, x), (a * s, b * c, y)])

    def mean(self) -> tuple[float, float, float]:
        """The mean colour, linear; of a channel three times its mean."""
        if self.image.dtype == np.uint8:
            counts = [np.bincount(self.image[:, :, k].reshape(-1), minlength=256) for k in range(self.image.shape[2])]
            pixels = self.image.shape[0] * self.image.shape[1]
            curves = [srgb_curve() if self.srgb else linear_curve()] * 3 + [linear_curve()]
            means = [float(n @ curve.astype(np.float64)) / pixels for n, curve in zip(counts, curves)]
        else:
            means = [float(value) for value in self.image.mean(axis=(0, 1), dtype=np.float64)]
        if self.channel:
            means = [means["rgba".index(self.channel)]] * 3
        r, g, b = (value * factor for value, factor in zip(means, self.factor))
        return (r, g, b)

    def is_positive(self) -> bool:
        """Whether it is above 0 anywhere."""
        return max(self.mean()) > 0


class _Checked(np.ndarray):
    """An image that has been checked, and cannot be written."""


def _frozen_image(value: Any, where: str) -> NDArray[Any]:
    """The image as an array that cannot be written, so that views may share it."""
    if isinstance(value, _Checked):
        return value
    given = np.asarray(value)
    if given.ndim == 2:
        given = np.repeat(given[:, :, None], 3, axis=2)
    if given.dtype == np.uint8:
        image: NDArray[Any] = given.copy()
    else:
        channels = 4 if given.ndim == 3 and given.shape[2] == 4 else 3
        image = _checked_floats(given, channels, where)
    if image.ndim != 3 or image.shape[2] not in (3, 4):
        shape = " x ".join(map(str, given.shape))
        raise SceneError(f"{where} must have the shape N x N x 3 or N x N x 4, not {shape}")
    if image.shape[0] == 0 or image.shape[1] == 0:
        raise SceneError(f"{where} has no pixels")
    checked = np.array(image, order="C").view(_Checked)
    checked.flags.writeable = False
    return checked


def _checked_floats(given: Any, channels: int, where: str) -> Floats:
    image = float_array(given, (None, None, channels), where)
    if (image < 0).any():
        raise SceneError(f"{where} has negative values; a texture must be 0 or more")
    return image


def linear_curve() -> Floats:
    """(256,) float32: the value of each number of 8 bits, 255 being 1."""
    return np.linspace(0.0, 1.0, 256).astype(np.float32)


def srgb_curve() -> Floats:
    """(256,) float32: the linear value of each sRGB number (IEC 61966-2-1)."""
    value = np.linspace(0.0, 1.0, 256)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)


def Checker(  # noqa: N802 - a texture like the others, though made of two colours
    first: Any = 0.8, second: Any = 0.2, squares: float = 8.0, name: str = ""
) -> Texture:
    """Chequers: `squares` x `squares` fields of two colours over uv from 0 to 1, filtered exactly; `first` at (0, 0).

    Raises:
        SceneError: colours below 0, or squares not above 0.
    """
    where = f"checker {name!r}" if name else "checker"
    if isinstance(squares, bool) or not isinstance(squares, (int, float)) or not 0 < squares <= 1e6:
        raise SceneError(f"{where}: squares is {squares!r}: it must be a number above 0, at most 1e6")
    a, b = colour(first, f"{where}: first"), colour(second, f"{where}: second")
    image = np.array([(b, a), (a, b)], np.float32)
    return Texture(image, name=name or "checker", filter="checker", scale=(squares / 2, squares / 2))
