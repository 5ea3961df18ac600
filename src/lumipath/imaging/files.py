"""Images from files of any kind that holds a picture."""

from __future__ import annotations

from pathlib import Path

from ..errors import CheckpointError
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
