"""Image and layers as the named channels of one EXR file, or as the arrays of one NumPy archive."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError
from .files import claim_space
from .layers import REGISTRY

Arrays = dict[str, NDArray[Any]]

# More than the headers of an archive and its arrays.
_SLACK = 1 << 16
# Orders of channels that people expect; any others are in the order of the alphabet.
_ORDER = "RGBA"
_LETTERS = {1: "Y", 2: "XY", 3: "RGB", 4: "RGBA"}
# Names in the archive that are no layers.
_IMAGE, _METADATA = "image", "metadata"


def side_by_side(pixels: NDArray[np.float32], layers: Arrays) -> tuple[NDArray[np.float32], list[str]]:
    """The image and its layers as one (H, W, C) float32 array, and the names of its channels.

    Whole numbers become float32, which is exact up to 16,777,216: readers take the integers of EXR for fractions of
    their greatest value.
    """
    names = ["R", "G", "B"]
    for name, layer in layers.items():
        names += _channel_names(name, layer.shape[2])
    if not layers:
        return pixels, names
    data = np.empty((*pixels.shape[:2], len(names)), np.float32)
    data[..., :3] = pixels
    first = 3
    for layer in layers.values():
        data[..., first : first + layer.shape[2]] = layer
        first += layer.shape[2]
    return data, names


def _channel_names(name: str, count: int) -> list[str]:
    if name in REGISTRY and len(REGISTRY[name].channels) == count:
        return REGISTRY[name].channel_names
    return [f"{name}.{letter}" for letter in _LETTERS.get(count, [str(k) for k in range(count)])]


def layers_among(data: NDArray[np.float32], names: list[str]) -> Arrays:
    """The layers (H, W, C) among channels (H, W, N) whose names are like `normal.X`; int32 where they are whole."""
    groups: dict[str, list[str]] = {}
    for name in names:
        layer, dot, channel = name.rpartition(".")
        if dot and layer:
            groups.setdefault(layer, []).append(channel)
    return {layer: _typed(layer, data, names, _ordered(layer, groups[layer])) for layer in _known_first(groups)}


def _known_first(groups: dict[str, list[str]]) -> list[str]:
    """Names of layers in the order of the registry, then of others."""
    return [*(name for name in REGISTRY if name in groups), *(name for name in groups if name not in REGISTRY)]


def _ordered(layer: str, channels: list[str]) -> list[str]:
    order = REGISTRY[layer].channels if layer in REGISTRY else _ORDER
    return sorted(channels, key=lambda channel: (order.find(channel) if channel in order else len(order), channel))


def _typed(layer: str, data: NDArray[np.float32], names: list[str], channels: list[str]) -> NDArray[Any]:
    values = np.ascontiguousarray(data[:, :, [names.index(f"{layer}.{channel}") for channel in channels]])
    if layer not in REGISTRY or not REGISTRY[layer].is_whole:
        return values
    # The greatest float32 below 2^31.
    return np.clip(np.nan_to_num(np.rint(values)), -(2.0**31), 2.0**31 - 128).astype(np.int32)


def write_archive(path: Path, pixels: NDArray[np.float32], layers: Arrays, metadata: dict[str, Any]) -> None:
    """Write a NumPy archive: `image`, one array a layer, and `metadata`, a text of JSON.

    Raises:
        OSError: the disk is full.
        ImageError: a layer has a name that something else has.
    """
    taken = {_IMAGE, _METADATA} & layers.keys()
    if taken:
        raise ImageError(f"a layer of an .npz file cannot be called {' or '.join(sorted(taken))}; use .exr")
    known = np.array(json.dumps({key: value for key, value in metadata.items() if value is not None}, default=_plain))
    arrays = {_IMAGE: pixels, **layers, _METADATA: known}
    # Else an archive that meets a full disk in its middle says something else first.
    claim_space(path, sum(array.nbytes + _SLACK for array in arrays.values()))
    with path.open("rb+") as file:
        # Passed on as they are, since names of layers may be those of parameters.
        with zipfile.ZipFile(file, "w") as archive:
            for name, array in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, array, allow_pickle=False)
        file.truncate()


def _plain(value: Any) -> Any:
    """What JSON has for a number of NumPy or an array, else a text."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)


def read_archive(path: Path) -> tuple[NDArray[Any], Arrays, dict[str, Any]]:
    """Image, layers and metadata of a NumPy archive.

    Raises:
        ImageError: the file is damaged, or holds no image.
    """
    try:
        archive = np.load(path, allow_pickle=False)
        if isinstance(archive, np.ndarray):
            raise ValueError("it is a single array; call it .npy")
        with archive:
            arrays = {name: archive[name] for name in archive.files}
        metadata = json.loads(str(arrays.pop(_METADATA, "{}")))
        pixels = arrays.pop(_IMAGE, None)
        strange = [name for name, array in arrays.items() if array.dtype.kind not in "fiu"]
        if strange:
            raise ValueError(f"{strange[0]} is no array of numbers")
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise ImageError(f"{path}: cannot be read: {' '.join(str(error).split()) or 'the file is damaged'}") from None
    if pixels is None:
        raise ImageError(f"{path}: cannot be read: it holds no array called {_IMAGE!r}")
    # JSON has no tuples, and matrices are tuples elsewhere.
    return pixels, arrays, {k: tuple(v) if isinstance(v, list) else v for k, v in metadata.items()}
