"""Facts about an image file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError
from ..rendering.channels import side_by_side
from ..rendering.checkpoint import Checkpoint
from ..rendering.image import Image
from ..rendering.oiio import read_header
from .files import is_image_name

# As OpenImageIO calls them.
_TYPES = {"f": "float", "i": "int"}


def describe(path: Path) -> dict[str, Any]:
    """What an image file or a checkpoint holds, ready for JSON.

    `channels` has for each channel name, type, `min`, `max` and `mean` of its finite values (of the stored ones: an
    8-bit file goes from 0 to 1, not linear), and the number of values that are `not_finite`. `layers` has the names of
    the layers among them.

    Raises:
        ImageError: the image is missing or cannot be read.
        CheckpointError: so is the checkpoint.
    """
    if not is_image_name(path):
        return _of_checkpoint(path)
    return _of_arrays(path) if path.suffix.lower() in (".npy", ".npz") else _of_image(path)


def _of_checkpoint(path: Path) -> dict[str, Any]:
    held = Checkpoint.load(path)
    image = held.image()
    facts = _facts(path, "checkpoint", image.pixels, list("RGB"), ["float"] * 3, image.metadata)
    return {
        **facts,
        "ranges": [attrs.asdict(part) for part in held.ranges],
        "samples_of_a_pixel": [int(held.film.counts.min()), int(held.film.counts.max())],
        "rejected": held.film.rejected,
        "scene_digest": held.identity.scene,
        "settings": held.identity.settings,
    }


def _of_arrays(path: Path) -> dict[str, Any]:
    image = Image.load(path)
    data, names = side_by_side(image.pixels, image.layers)
    types = ["float"] * 3
    for layer in image.layers.values():
        types += [_TYPES[layer.dtype.kind]] * layer.shape[2]
    facts = _facts(path, path.suffix.lower()[1:], data, names, types, image.metadata)
    return {**facts, "layers": list(image.layers)}


def _of_image(path: Path) -> dict[str, Any]:
    import OpenImageIO

    # The errors of a missing or damaged file are those of every other reader.
    layers = list(Image.load(path).layers)
    source = OpenImageIO.ImageInput.open(str(path))
    if source is None:
        raise ImageError(f"{path}: cannot be read: {OpenImageIO.geterror().strip()}")
    spec = source.spec()
    pixels = np.asarray(source.read_image(OpenImageIO.FLOAT), np.float32)
    source.close()
    types = [str(spec.channelformat(channel)) for channel in range(spec.nchannels)]
    pixels = pixels.reshape(spec.height, spec.width, spec.nchannels)
    facts = _facts(path, path.suffix.lower()[1:], pixels, list(spec.channelnames), types, read_header(spec))
    return {**facts, "layers": layers}


def _facts(
    path: Path, kind: str, pixels: NDArray[np.float32], names: list[str], types: list[str], metadata: dict[str, Any]
) -> dict[str, Any]:
    return {
        "file": str(path),
        "format": kind,
        "width": int(pixels.shape[1]),
        "height": int(pixels.shape[0]),
        "channels": [_channel(pixels[:, :, k], name, types[k]) for k, name in enumerate(names)],
        "metadata": metadata,
    }


def _channel(values: NDArray[np.float32], name: str, kind: str) -> dict[str, Any]:
    finite = values[np.isfinite(values)]
    some = finite if finite.size else np.zeros(1, np.float32)
    return {
        "name": name,
        "type": kind,
        "min": float(some.min()),
        "max": float(some.max()),
        "mean": float(some.mean(dtype=np.float64)),
        "not_finite": int(values.size - finite.size),
    }
