"""Image files to linear pixels, textures and environments; everything goes through OpenImageIO."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageError
from ..scene import Environment, Texture
from ..scene.values import Floats
from .cubemap import equirectangular, find_faces, stack_faces
from .files import require_file
from .srgb import decode_srgb

_MAX_PIXELS = 2**28


def read_pixels(path: str | Path) -> Floats:
    """The pixels of an image file, linear Rec.709, (H, W, 3) float32, row 0 at the top.

    Whole-number formats (PNG, JPEG, ...) hold sRGB and are made linear; floating-point ones (EXR, HDR, ...) are linear
    already. Alpha is dropped and does not change the colour; grey becomes three equal parts.

    Raises:
        ImageError: missing, a folder, unreadable, no image, damaged, larger than 2^28 pixels, or with pixels that are
            not finite.
    """
    pixels, _ = _read_stored(Path(path), alpha=False)
    return _linear_of_srgb(pixels.dtype.str)[pixels] if pixels.dtype.kind == "u" else pixels


def read_texture(path: str | Path, *, srgb: bool = True, alpha: bool = False, **options: Any) -> Texture:
    """The texture in an image file; images of 8 bits stay 8 bits wide.

    Args:
        path: the file.
        srgb: whether whole-number formats (PNG, JPEG, ...) hold colours, by the sRGB curve. False for data such as
            roughness or normals.
        alpha: whether to keep alpha, which is 1 in an image without one.
        options: further fields of `Texture`.

    Raises:
        ImageError: the file cannot be read.
        SceneError: it has negative values.
    """
    pixels, shown = _read_stored(Path(path), alpha)
    if pixels.dtype == np.uint16:
        most = np.float32(65535)
        colours = _linear_of_srgb(pixels.dtype.str)[pixels[:, :, :3]] if srgb else pixels[:, :, :3] / most
        pixels = np.concatenate([colours, pixels[:, :, 3:] / most], axis=2)
    if alpha and not shown:
        opaque = np.full((*pixels.shape[:2], 1), 255 if pixels.dtype == np.uint8 else 1, pixels.dtype)
        pixels = np.concatenate([pixels, opaque], axis=2)
    return Texture(pixels, name=Path(path).name, srgb=srgb, **options)


def _read_stored(path: Path, alpha: bool) -> tuple[NDArray[Any], bool]:
    """(H, W, 3) as stored, or (H, W, 4) with an alpha that was asked for and is there; and whether it is."""
    require_file(path, ImageError)
    raw, names, which = _read_raw(path)
    if raw.size == 0:
        raise ImageError(f"{path}: the image has no pixels")
    shown = alpha and which >= 0
    pixels = raw[:, :, _colour_channels(names, which) + ([which] if shown else [])]
    if raw.dtype.kind != "u":
        if not np.isfinite(pixels).all():
            row, column = (int(i) for i in np.argwhere(~np.isfinite(pixels).all(axis=2))[0])
            raise ImageError(f"{path}: the pixel in column {column}, row {row} is not finite: repair the image")
        pixels = np.ascontiguousarray(pixels, np.float32)
    return pixels, shown


def read_environment(path: str | Path) -> Environment:
    """The environment in an equirectangular image: its middle column lies along -z, its right quarter along +x.

    Raises:
        ImageError: the file cannot be read.
        SceneError: it has negative values.
    """
    return Environment(image=read_pixels(path), name=Path(path).name)


def read_cubemap(path: str | Path) -> Environment:
    """The environment in six square images: `path` is one of them, the others are found in its folder.

    Their names contain pos or neg and then x, y or z. Each shows what is seen in its direction from inside, with +y
    up: negz is straight ahead, posx to its right. posy joins negz with its bottom edge, negy with its top edge.

    Raises:
        ImageError: a face is missing, doubled, unreadable, not square, or of another size than the others.
        SceneError: it has negative values.
    """
    path = Path(path)
    require_file(path, ImageError)
    files = find_faces(path)
    faces = stack_faces({face: read_pixels(file) for face, file in files.items()}, files)
    return Environment(image=equirectangular(faces), name=path.name)


def _read_raw(path: Path) -> tuple[NDArray[Any], list[str], int]:
    """The pixels as stored, (H, W, C) uint8, uint16 or float32; the names of the channels; which is alpha, or -1."""
    import OpenImageIO

    options = OpenImageIO.ImageSpec()
    # Else the colours of transparent pixels come multiplied by alpha.
    options.attribute("oiio:UnassociatedAlpha", 1)
    file = OpenImageIO.ImageInput.open(str(path), options)
    if file is None:
        raise ImageError(f"{path}: no image that can be read: {_first_line(OpenImageIO.geterror())}")
    spec = file.spec()
    if spec.width * spec.height > _MAX_PIXELS:
        raise ImageError(f"{path}: {spec.width} x {spec.height} pixels are too many: {_MAX_PIXELS} are possible")
    stored = {OpenImageIO.UINT8: OpenImageIO.UINT8, OpenImageIO.UINT16: OpenImageIO.UINT16}.get(
        spec.format.basetype, OpenImageIO.FLOAT
    )
    pixels = file.read_image(0, 0, 0, spec.nchannels, stored)
    message = file.geterror()
    file.close()
    if pixels is None or message:
        raise ImageError(f"{path}: the image is damaged: {_first_line(message)}")
    return pixels, list(spec.channelnames), int(spec.alpha_channel)


def _first_line(message: str) -> str:
    return message.strip().split("\n", 1)[0] or "no reason given"


def _colour_channels(names: list[str], alpha: int) -> list[int]:
    """Which three channels are red, green and blue; a grey image has the same one three times."""
    if {"R", "G", "B"} <= set(names):
        return [names.index(name) for name in "RGB"]
    colours = [index for index in range(len(names)) if index != alpha] or [0]
    return colours[:3] if len(colours) >= 3 else colours[:1] * 3


@cache
def _linear_of_srgb(dtype: str) -> Floats:
    """The linear value of each number of an unsigned type, by the sRGB curve: (256,) or (65536,) float32."""
    count = np.iinfo(dtype).max + 1
    return decode_srgb(np.linspace(0.0, 1.0, count))
