"""Cubemaps: six square images to one equirectangular one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError
from ..scene.values import Floats

MAX_WIDTH = 8192
_ROWS_AT_ONCE = 32
_NAME = re.compile(r"(pos|neg)(?:itive|ative)?[^a-z0-9]*([xyz])")
_SUFFIXES = {".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".exr", ".hdr", ".pic", ".webp", ".ppm", ".pfm"}
# For each face: where it looks, what is to the right in it, and what is up, as seen from inside.
_FRAMES = {
    "posx": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "negx": ((-1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "posy": ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    "negy": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
    "posz": ((0, 0, 1), (-1, 0, 0), (0, 1, 0)),
    "negz": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
}
FACES = tuple(_FRAMES)


def face_of(path: Path) -> str | None:
    """Which face a file holds by its name, such as `posx`; None if the name says nothing."""
    match = _NAME.search(path.stem.lower())
    return match[1] + match[2] if match else None


def find_faces(path: Path) -> dict[str, Path]:
    """The files of all six faces, found in the folder of one of them.

    Raises:
        ImageError: the name of `path` says no face, or a face is missing or found twice.
    """
    if face_of(path) is None:
        raise ImageError(f"{path}: the name of a cubemap face must contain pos or neg and then x, y or z")
    suffixes = _SUFFIXES | {path.suffix.lower()}
    found: dict[str, list[Path]] = {face: [] for face in FACES}
    for file in _listed(path.parent):
        # Some systems put a hidden file of notes beside each file.
        face = face_of(file) if not file.name.startswith(".") else None
        if face is not None and file.suffix.lower() in suffixes and file.is_file():
            found[face].append(file)
    missing = [face for face, files in found.items() if not files]
    if missing:
        raise ImageError(f"{path}: its folder has no {', '.join(missing)}; a cubemap needs all of {', '.join(FACES)}")
    doubled = [file.name for files in found.values() if len(files) > 1 for file in files]
    if doubled:
        raise ImageError(f"{path}: its folder has a face twice: {', '.join(doubled)}; keep one cubemap in a folder")
    return {face: files[0] for face, files in found.items()}


def _listed(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as cause:
        raise ImageError(f"cannot list the folder {str(folder)!r}: {cause.strerror}; check its permissions") from None


def stack_faces(images: Mapping[str, Floats], files: Mapping[str, Path]) -> Floats:
    """Six images, each (F, F, 3), as one array (6, F, F, 3) in the order of `FACES`; `files` is for messages.

    Raises:
        ImageError: one is not square, or they differ in size.
    """
    first = images[FACES[0]].shape
    for face in FACES:
        height, width, _ = images[face].shape
        if height != width:
            raise ImageError(f"{files[face]}: a cubemap face must be square, not {width} x {height} pixels")
        if height != first[0]:
            message = f"{width} x {height} pixels, but {files[FACES[0]].name} has {first[1]} x {first[0]}"
            raise ImageError(f"{files[face]}: {message}; all faces must have one size")
    return np.stack([images[face] for face in FACES])


def equirectangular(faces: Floats) -> Floats:
    """A cubemap (6, F, F, 3) resampled bilinearly to (2 F, 4 F, 3) float32, at most 8192 wide.

    The middle column lies along -z, the right quarter along +x, row 0 along +y.
    """
    width = min(4 * faces.shape[1], MAX_WIDTH)
    height = width // 2
    angle = 2.0 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    image = np.empty((height, width, 3), np.float32)
    # By bands, so that the temporary arrays stay small beside the image.
    for top in range(0, height, _ROWS_AT_ONCE):
        polar = np.pi * (np.arange(top, min(top + _ROWS_AT_ONCE, height)) + 0.5)[:, None] / height
        x, y, z = np.sin(polar) * np.sin(angle), np.cos(polar), -np.sin(polar) * np.cos(angle)
        directions = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
        image[top : top + _ROWS_AT_ONCE] = _look_up(faces, directions)
    return image


def _look_up(faces: Floats, directions: NDArray[np.float64]) -> Floats:
    """The colours seen along directions, (..., 3) to (..., 3)."""
    frames = np.array([_FRAMES[face] for face in FACES], np.float64)
    ahead = directions @ frames[:, 0].T
    which = np.argmax(ahead, axis=-1)
    depth = np.take_along_axis(ahead, which[..., None], axis=-1)[..., 0]
    across = (directions * frames[which, 1]).sum(axis=-1) / depth
    upward = (directions * frames[which, 2]).sum(axis=-1) / depth
    return _bilinear(faces, which, (across + 1.0) / 2.0, (1.0 - upward) / 2.0)


def _bilinear(faces: Floats, which: NDArray[np.intp], across: NDArray[np.float64], down: NDArray[np.float64]) -> Floats:
    """Colours at points of faces, 0 .. 1 from the left and from the top; clamped to the edge pixels of the face."""
    size = faces.shape[1]
    column = np.clip(across * size - 0.5, 0.0, size - 1.0)
    row = np.clip(down * size - 0.5, 0.0, size - 1.0)
    left, top = column.astype(np.intp), row.astype(np.intp)
    right, bottom = np.minimum(left + 1, size - 1), np.minimum(top + 1, size - 1)
    u, v = (column - left)[..., None], (row - top)[..., None]
    upper = faces[which, top, left] * (1.0 - u) + faces[which, top, right] * u
    lower = faces[which, bottom, left] * (1.0 - u) + faces[which, bottom, right] * u
    return (upper * (1.0 - v) + lower * v).astype(np.float32)
