"""Textures as one table: records, texels, and coarser steps of each image."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene import Texture
from ..scene.textures import CHANNELS, linear_curve, srgb_curve
from . import layout

Image = NDArray[Any]


@define(eq=False)
class TextureTable:
    """Collects textures, each once; those of equal images share their texels."""

    _textures: list[Texture] = field(factory=list)
    _numbers: dict[int, int] = field(factory=dict)

    def __len__(self) -> int:
        return len(self._textures)

    def number(self, texture: Texture) -> int:
        """Number of a texture in the table."""
        key = id(texture)
        if key not in self._numbers:
            self._numbers[key] = len(self._textures)
            self._textures.append(texture)
        return self._numbers[key]

    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
        """Records (N, 16) float32, texels (., 4) float32, and 8-bit texels (.,) int32."""
        store = _Store(any(texture.image.dtype == np.uint8 for texture in self._textures))
        records = np.zeros((len(self._textures), int(layout.TEXTURE_SIZE)), np.float32)
        for record, texture in zip(records, self._textures):
            _write_record(record, texture, *store.place(texture))
        return records, store.texels(), store.words()


def _write_record(record: NDArray[np.float32], texture: Texture, first: int, steps: int) -> None:
    height, width, _ = texture.image.shape
    bits = record.view(np.int32)
    bits[:4] = first, width, height, _flags(texture)
    record[4:7] = texture.factor
    record[7] = texture.factor[0] if texture.channel == "a" else 1.0
    matrix = texture.matrix()
    record[8:11], record[12:15] = matrix
    size = np.sqrt(width * height * abs(np.linalg.det(matrix[:, :2])))
    record[11] = size
    bits[15] = steps


def _flags(texture: Texture) -> int:
    across, upward = texture.wrap
    flags = {
        layout.REPEATED_U: across == "repeat",
        layout.REPEATED_V: upward == "repeat",
        layout.MIRRORED_U: across == "mirror",
        layout.MIRRORED_V: upward == "mirror",
        layout.NEAREST: texture.filter == "nearest",
        layout.CHEQUERED: texture.filter == "checker",
        layout.BYTES: texture.image.dtype == np.uint8,
        layout.LINEAR_BYTES: not texture.srgb,
    }
    channel = CHANNELS.index(texture.channel) << int(layout.CHANNEL_SHIFT)
    return channel | sum(int(bit) for bit, is_set in flags.items() if is_set)


class _Store:
    """Texels of all images, one behind the other."""

    def __init__(self, has_bytes: bool) -> None:
        curves = np.concatenate([srgb_curve(), linear_curve()]).reshape(-1, 4)
        self._floats: list[NDArray[np.float32]] = [curves] if has_bytes else []
        self._words: list[NDArray[np.int32]] = []
        self._lengths = {True: 0, False: len(curves) if has_bytes else 0}
        self._places: dict[bytes, tuple[int, int]] = {}
        self._digests: dict[int, bytes] = {}

    def place(self, texture: Texture) -> tuple[int, int]:
        """The first texel of a texture's image, and the number of its steps."""
        image = texture.image
        if id(image) not in self._digests:
            self._digests[id(image)] = hashlib.blake2b(np.ascontiguousarray(image).data, digest_size=16).digest()
        srgb = texture.srgb and image.dtype == np.uint8
        key = self._digests[id(image)] + f"{image.dtype} {image.shape} {texture.mipmaps} {srgb}".encode()
        if key not in self._places:
            self._places[key] = self._add(texture, srgb)
        return self._places[key]

    def _add(self, texture: Texture, srgb: bool) -> tuple[int, int]:
        in_bytes = texture.image.dtype == np.uint8
        first = self._lengths[in_bytes]
        coarser = texture.mipmaps and texture.filter != "checker"
        steps = mipmaps(texture.image, srgb) if coarser else [texture.image]
        for step in steps:
            rgba = _with_alpha(step)
            if in_bytes:
                self._words.append(rgba.view("<u4").astype(np.uint32).view(np.int32).reshape(-1))
            else:
                self._floats.append(rgba.reshape(-1, 4))
            self._lengths[in_bytes] += rgba.shape[0] * rgba.shape[1]
        if self._lengths[in_bytes] >= 1 << 31:
            raise SceneError(f"texture {texture.name or 'image'}: the textures of a scene hold at most 2^31 texels")
        return first, len(steps)

    def texels(self) -> NDArray[np.float32]:
        """(., 4) float32."""
        return np.concatenate(self._floats) if self._floats else np.zeros((0, 4), np.float32)

    def words(self) -> NDArray[np.int32]:
        """(.,) int32."""
        return np.concatenate(self._words) if self._words else np.zeros(0, np.int32)


def _with_alpha(image: Image) -> Image:
    """The image with four channels; alpha is 1 where it has none."""
    if image.shape[2] == 4:
        return np.ascontiguousarray(image)
    opaque = np.full((*image.shape[:2], 1), 255 if image.dtype == np.uint8 else 1, image.dtype)
    return np.concatenate([image, opaque], axis=2)


def mipmaps(image: Image, srgb: bool) -> list[Image]:
    """The image, and coarser steps down to one texel, each half as wide and high, rounded down; means are linear ones.

    Args:
        image: (H, W, C) float32 or uint8.
        srgb: whether the first three channels of a uint8 image follow the sRGB curve.
    """
    steps = [image]
    while max(image.shape[:2]) > 1:
        image = _halved(image, srgb) if image.dtype == np.uint8 else _halved_axis(_halved_axis(image, 0), 1)
        steps.append(image)
    return steps


def _halved(image: NDArray[np.uint8], srgb: bool) -> NDArray[np.uint8]:
    """The next step of a uint8 image, channel by channel, so that little memory is needed at once."""
    channels = []
    for k in range(image.shape[2]):
        curve = srgb_curve() if srgb and k < 3 else linear_curve()
        mean = _halved_axis(_halved_axis(curve[image[:, :, k]], 0), 1)
        # To the nearest number, as the curve goes: half way between neighbours.
        channels.append(np.searchsorted((curve[1:] + curve[:-1]) / 2, mean, side="right").astype(np.uint8))
    return np.stack(channels, axis=2)


def _halved_axis(image: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Half as long along an axis, rounded down: means of two texels, or of the three that a texel covers in part."""
    count = image.shape[axis]
    half = count // 2
    if half == 0:
        return image
    image = np.moveaxis(image, axis, 0)
    if count % 2 == 0:
        made = (image[0::2] + image[1::2]) * np.float32(0.5)
    else:
        k = np.arange(half, dtype=np.float32).reshape(-1, *[1] * (image.ndim - 1))
        made = ((half - k) * image[0:-1:2] + half * image[1::2] + (k + 1) * image[2::2]) / np.float32(count)
    return np.moveaxis(made.astype(np.float32), 0, axis)
