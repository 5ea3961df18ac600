"""Images from files of any kind that holds a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import CheckpointError, ImageError
from ..rendering.checkpoint import Checkpoint
from ..rendering.image import SUFFIXES, Image


def is_image_name(path: Path) -> bool:
    """Whether the suffix is that of an image; other files are taken for checkpoints."""
    return path.suffix.lower() in SUFFIXES


def open_image(path: Path) -> Image:
    """The image in an image file, or that of a checkpoint.

    Raises:
        ImageError: the image is missing or cannot be read.
        CheckpointError: so is the checkpoint.
    """
    if is_image_name(path):
        return Image.load(path)
    try:
        return Checkpoint.load(path).image()
    except CheckpointError as error:
        raise CheckpointError(f"{error}; images end in {', '.join(SUFFIXES)}") from None


def read_layer(path: Path, layer: str, parts: str) -> NDArray[np.float32] | None:
    """The channels `layer.PART` of an EXR file, (H, W, number of parts) float32; None where there are none.

    Raises:
        ImageError: the file cannot be read.
    """
    if path.suffix.lower() != ".exr":
        return None
    import OpenImageIO

    source = OpenImageIO.ImageInput.open(str(path))
    if source is None:
        raise ImageError(f"{path}: cannot be read: {OpenImageIO.geterror().strip().splitlines()[0]}")
    names = list(source.spec().channelnames)
    wanted = [f"{layer}.{part}" for part in parts]
    found = source.read_image(OpenImageIO.FLOAT) if set(wanted) <= set(names) else None
    source.close()
    if found is None:
        return None
    return np.ascontiguousarray(found[:, :, [names.index(name) for name in wanted]], np.float32)
