"""Image files by OpenImageIO: pixels, layers and metadata as they are, and errors as one line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError
from ..formats.srgb import decode_srgb
from .channels import layers_among

EIGHT_BIT = (".png", ".jpg", ".jpeg")

# Attributes that OpenImageIO or the format itself puts into a header.
_FOREIGN_NAMES = (
    "compression",
    "DateTime",
    "PixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "Software",
)
# Names that the EXR format keeps for itself: ours are written as `lumipath:NAME`.
_EXR_RESERVED = ("channels", "chunkCount", "dataWindow", "displayWindow", "lineOrder", "name", "type", "version")
_EXR_PREFIX = "lumipath:"
_INT32_MAX = (1 << 31) - 1


def write_pixels(
    path: Path, data: NDArray[Any], attributes: dict[str, Any], channels: Sequence[str] = ("R", "G", "B")
) -> None:
    """Write (H, W, C) uint8 or float32 data as it is.

    Raises:
        OSError: for whatever reason; OpenImageIO tells no more than a text.
    """
    import OpenImageIO

    height, width, count = data.shape
    kind = OpenImageIO.UINT8 if data.dtype == np.uint8 else OpenImageIO.FLOAT
    spec = OpenImageIO.ImageSpec(width, height, count, kind)
    spec.channelnames = tuple(channels)
    for name, value in attributes.items():
        _set_attribute(spec, name, value)
    output = OpenImageIO.ImageOutput.create(str(path))
    if output is None:
        raise OSError(OpenImageIO.geterror())
    done = output.open(str(path), spec) and output.write_image(data)
    done = output.close() and done
    # The PNG writer reports success on a full disk; only its error text tells.
    message = output.geterror()
    if message or not done:
        raise OSError(_plain_reason(message, path))


def _plain_reason(message: str, path: Path) -> str:
    if "could only write" in message or "output failed" in message.lower():
        return "the disk is full or the file may not grow; free some space"
    first_line = message.strip().splitlines()[0] if message.strip() else "unknown reason"
    return first_line.replace(str(path), path.suffix + " file")


def exr_header(metadata: dict[str, Any]) -> dict[str, Any]:
    """Attributes of an EXR file for what is known about an image."""
    known = {key: value for key, value in metadata.items() if value is not None}
    ours = {_EXR_PREFIX + key if key in _EXR_RESERVED else key: value for key, value in known.items()}
    return {"compression": "zip", **ours}


def _set_attribute(spec: Any, name: str, value: Any) -> None:
    """Store a number, a text or 16 numbers in an image header; anything else as text."""
    import OpenImageIO

    array = np.asarray(value) if isinstance(value, (list, tuple, np.ndarray)) else None
    if array is not None and array.size == 16 and array.dtype.kind in "if":
        spec.attribute(name, OpenImageIO.TypeDesc("matrix"), tuple(float(number) for number in array.ravel()))
    elif isinstance(value, (int, np.integer)) and abs(int(value)) <= _INT32_MAX:
        spec.attribute(name, int(value))
    elif isinstance(value, (float, np.floating)):
        spec.attribute(name, float(value))
    else:
        spec.attribute(name, str(value))


def _attribute_value(value: Any) -> Any:
    # EXR headers have 32-bit integers only, so a larger one was stored as text.
    if isinstance(value, str) and value.isdigit() and int(value) > _INT32_MAX:
        return int(value)
    return value


def read_pixels(path: Path) -> tuple[NDArray[np.float32], dict[str, Any], dict[str, NDArray[Any]]]:
    """Pixels (H, W, 3), linear; metadata; layers.

    Raises:
        ImageError: not a readable image.
    """
    import OpenImageIO

    source = OpenImageIO.ImageInput.open(str(path))
    if source is None:
        reason = OpenImageIO.geterror().strip().splitlines()
        raise ImageError(f"{path}: cannot be read: {reason[0] if reason else 'not an image'}")
    spec = source.spec()
    data = source.read_image(OpenImageIO.FLOAT)
    message = source.geterror()
    source.close()
    if data is None or message:
        raise ImageError(f"{path}: cannot be read: {(message.strip().splitlines() or ['the file is damaged'])[0]}")
    data = np.asarray(data, np.float32).reshape(spec.height, spec.width, spec.nchannels)
    pixels = data[:, :, _colour_channels(spec.channelnames)]
    if path.suffix.lower() in EIGHT_BIT:
        return decode_srgb(pixels), {}, {}
    if path.suffix.lower() != ".exr":
        return pixels, {}, {}
    return pixels, read_header(spec), layers_among(data, list(spec.channelnames))


def _colour_channels(names: Any) -> list[int]:
    """Which three channels are red, green and blue; a grey image has the same one three times."""
    names = list(names)
    if {"R", "G", "B"} <= set(names):
        return [names.index(name) for name in "RGB"]
    return [0, 1, 2] if len(names) >= 3 else [0, 0, 0]


def read_header(spec: Any) -> dict[str, Any]:
    """The metadata in an OpenImageIO header, without what the format and the library put there."""
    named = {entry.name.removeprefix(_EXR_PREFIX): entry.value for entry in spec.extra_attribs}
    ours = {name: value for name, value in named.items() if ":" not in name and name not in _FOREIGN_NAMES}
    return {name: _attribute_value(value) for name, value in ours.items()}
