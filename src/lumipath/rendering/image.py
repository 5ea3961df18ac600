"""An image: linear pixels, what is known about them, and its files."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from ..errors import ImageError
from .files import claim_space, replacing, target_of, temporary_for, try_to_write
from .tonemap import DATA_INTEGRATORS, check_tonemap, data_to_display, decode_srgb, to_display

Floats = NDArray[np.float32]

_EIGHT_BIT = (".png", ".jpg", ".jpeg")
SUFFIXES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".npy")

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


def _pixels(value: Any) -> Floats:
    pixels = np.ascontiguousarray(value, np.float32)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        have = " x ".join(map(str, pixels.shape)) or "a single number"
        raise ImageError(f"an image must have the shape height x width x 3, not {have}")
    return pixels


@define(eq=False)
class Image:
    """A rendered image.

    Args:
        pixels: (H, W, 3) float32, linear Rec.709 radiance; row 0 is the top.
        metadata: what is known about it: samples, seed, seconds, version, scene and so on; numbers, strings, and 4 x 4
            matrices as 16 numbers. EXR files keep it in their header, the other formats have no place for it.

    Raises:
        ImageError: the pixels have another shape.
    """

    pixels: Floats = field(converter=_pixels)
    metadata: dict[str, Any] = field(factory=dict)

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.pixels.shape[0])

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.pixels.shape[1])

    @property
    def shape(self) -> tuple[int, int, int]:
        """(H, W, 3)."""
        return (self.height, self.width, 3)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.pixels, dtype, copy=copy)

    def __repr__(self) -> str:
        known = "".join(f", {key}={value!r}" for key, value in self.metadata.items())
        return f"Image({self.width} x {self.height}{known})"

    def _repr_png_(self) -> bytes:
        """The image as a notebook shows it."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "image.png")
            self.save(path)
            return path.read_bytes()

    def to_uint8(self, exposure: float = 0.0, tonemap: str = "none") -> NDArray[np.uint8]:
        """(H, W, 3) uint8 as `save` writes it to PNG and JPEG: exposure, tonemap, sRGB curve, rounded half up.

        With `linear` there is no sRGB curve: the bytes are floor(clamp(v, 0, 1) * 255 + 0.5). Pictures of the
        integrators `normal` and `depth` are no light and have no exposure, tonemap or curve; see `data_to_display`.
        """
        if self._shows_data:
            shown = data_to_display(self.pixels, self.metadata["integrator"])
        else:
            shown = to_display(self.pixels, exposure, tonemap)
        return np.floor(shown * np.float32(255) + np.float32(0.5)).astype(np.uint8)

    @property
    def _shows_data(self) -> bool:
        return self.metadata.get("integrator") in DATA_INTEGRATORS

    def save(self, path: str | os.PathLike[str], *, exposure: float = 0.0, tonemap: str = "none") -> None:
        """Write the image; the suffix chooses the format. Either the whole file is written or none of it.

        `.png`, `.jpg`, `.jpeg`: 8 bits, display-encoded. `.exr`, `.npy`: float32, linear, every value as it is. `.hdr`:
        linear RGBE. A pixel with a NaN or an infinity becomes black in the 8-bit formats and in `.hdr`.

        Args:
            path: where to; an existing file is replaced once the new one is complete.
            exposure: of 8-bit formats, in stops.
            tonemap: of 8-bit formats: one of `settings.TONEMAPS`.

        Raises:
            ImageError: the file cannot be written; an earlier file of this name is still there.
            UsageError: no such tonemap.
        """
        check_tonemap(tonemap)
        target = _target(Path(path))
        suffix = target.suffix.lower()
        temporary = temporary_for(target)
        with replacing(target, temporary, ImageError):
            if suffix == ".npy":
                _write_npy(temporary, self.pixels)
            elif suffix == ".exr":
                _write_with_oiio(temporary, self.pixels, _exr_header(self.metadata))
            elif suffix == ".hdr":
                finite = np.isfinite(self.pixels).all(axis=-1, keepdims=True)
                _write_with_oiio(temporary, np.where(finite, np.maximum(self.pixels, 0), np.float32(0)), {})
            else:
                data = self.to_uint8(exposure, tonemap)
                # libjpeg ends the whole process when the disk is full, so the room is claimed beforehand.
                if suffix != ".png":
                    claim_space(temporary, data.nbytes)
                colour_space = "linear" if tonemap == "linear" or self._shows_data else "sRGB"
                _write_with_oiio(temporary, data, {"CompressionQuality": 95, "oiio:ColorSpace": colour_space})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Image:
        """Read an image file; 8- and 16-bit formats are taken as sRGB and made linear, alpha is dropped.

        Raises:
            ImageError: no such file, an unknown suffix, or not a readable image.
        """
        path = Path(path)
        _check_suffix(path)
        if path.is_dir():
            raise ImageError(f"{path} is a directory, not an image")
        if not path.exists():
            raise ImageError(f"{path}: there is no such file")
        return cls(_read_npy(path)) if path.suffix.lower() == ".npy" else cls(*_read_with_oiio(path))


def check_writable(path: str | os.PathLike[str], suffixes: tuple[str, ...] = SUFFIXES) -> None:
    """Find out before a long render whether writing this file will be possible; leaves nothing behind.

    Args:
        path: the file; it may be there already.
        suffixes: those that it may have; by default the ones that `Image.save` knows.

    Raises:
        ImageError: unknown suffix, missing folder, a directory, no permission; the message says what to do.
    """
    try_to_write(_target(Path(path), suffixes), ImageError)


def _check_suffix(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> None:
    if path.suffix.lower() not in suffixes:
        kind = f"the suffix {path.suffix!r} is not known" if path.suffix else "there is no suffix"
        raise ImageError(f"{path}: {kind}; use one of {', '.join(suffixes)}")


def _target(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """The file that `path` means, after every check that needs no writing."""
    target = target_of(path, ImageError, "image.png")
    _check_suffix(path, suffixes)
    return target


def _write_npy(path: Path, pixels: Floats) -> None:
    with path.open("wb") as file:
        np.save(file, pixels, allow_pickle=False)


def _write_with_oiio(path: Path, data: NDArray[Any], attributes: dict[str, Any]) -> None:
    """Write (H, W, 3) uint8 or float32 data as it is.

    Raises:
        OSError: for whatever reason; OpenImageIO tells no more than a text.
    """
    import OpenImageIO

    height, width, _ = data.shape
    spec = OpenImageIO.ImageSpec(width, height, 3, OpenImageIO.UINT8 if data.dtype == np.uint8 else OpenImageIO.FLOAT)
    spec.channelnames = ("R", "G", "B")
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


def _exr_header(metadata: dict[str, Any]) -> dict[str, Any]:
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


def _read_npy(path: Path) -> NDArray[Any]:
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ImageError(f"{path}: cannot be read: {error}") from None
    if not isinstance(array, np.ndarray) or array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise ImageError(f"{path}: it must hold one array of numbers of the shape height x width x 3")
    return array


def _read_with_oiio(path: Path) -> tuple[Floats, dict[str, Any]]:
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
    if path.suffix.lower() in _EIGHT_BIT:
        return decode_srgb(pixels), {}
    return pixels, read_header(spec) if path.suffix.lower() == ".exr" else {}


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
