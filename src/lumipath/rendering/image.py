"""An image: linear pixels, what is known about them, and its files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from ..errors import ImageError, UsageError
from .channels import read_archive, side_by_side, write_archive
from .display import Picture, layer_to_display, page_of
from .files import claim_space, replacing, target_of, temporary_for, try_to_write
from .oiio import exr_header, read_pixels, write_pixels
from .tonemap import DATA_INTEGRATORS, check_tonemap, data_to_display, to_display

Floats = NDArray[np.float32]

SUFFIXES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".npy", ".npz")
LAYER_SUFFIXES = (".exr", ".npz")
"""Files that can hold layers."""

# Longest value that `repr` shows.
_SHORT = 60


def _pixels(value: Any) -> Floats:
    pixels = np.ascontiguousarray(value, np.float32)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        have = " x ".join(map(str, pixels.shape)) or "a single number"
        raise ImageError(f"an image must have the shape height x width x 3, not {have}")
    return pixels


def _layers(value: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Each as (H, W, C): int32 where it is given as whole numbers, else float32."""
    layers = {}
    for name, given in value.items():
        array = np.asarray(given)
        array = np.ascontiguousarray(array, np.int32 if array.dtype.kind in "iu" else np.float32)
        layers[name] = array[..., None] if array.ndim == 2 else array
    return layers


@define(eq=False)
class Image:
    """A rendered image, with its layers.

    Args:
        pixels: (H, W, 3) float32, linear Rec.709 radiance; row 0 is the top.
        metadata: what is known about it: samples, seed, seconds, version, scene and so on; numbers, strings, and 4 x 4
            matrices as 16 numbers. EXR and NPZ files keep it, the other formats have no place for it.
        layers: by name, (H, W) or (H, W, C); they become (H, W, C) float32, or int32 for whole numbers.

    Raises:
        ImageError: the pixels or a layer have another shape.
    """

    pixels: Floats = field(converter=_pixels)
    metadata: dict[str, Any] = field(factory=dict)
    layers: dict[str, NDArray[Any]] = field(factory=dict, converter=_layers)

    def __attrs_post_init__(self) -> None:
        for name, layer in self.layers.items():
            if layer.ndim != 3 or layer.shape[:2] != self.pixels.shape[:2] or not layer.shape[2]:
                shape = " x ".join(map(str, layer.shape))
                raise ImageError(f"layer {name} has the shape {shape}, the image {self.height} x {self.width} pixels")

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

    @property
    def layer_names(self) -> tuple[str, ...]:
        """What can stand in `image[...]`."""
        return tuple(self.layers)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The layer of that name, (H, W, C) float32 or int32.

        Raises:
            UsageError: the image has no such layer; the message lists those it has.
        """
        if name not in self.layers:
            have = f"it has {', '.join(self.layers)}" if self.layers else "it has none; render it with aov=..."
            raise UsageError(f"the image has no layer {name!r}: {have}")
        return self.layers[name]

    def select_layers(self, *names: str) -> Image:
        """The same image with only these layers, of those it has."""
        return Image(
            self.pixels, dict(self.metadata), {name: self.layers[name] for name in names if name in self.layers}
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.pixels, dtype, copy=copy)

    def __repr__(self) -> str:
        known = self._known() | ({"layers": ", ".join(self.layers)} if self.layers else {})
        return f"Image({self.width} x {self.height}{''.join(f', {key}={value!r}' for key, value in known.items())})"

    def show(self, exposure: float = 0.0, tonemap: str = "none", layer: str | None = None) -> Picture:
        """The image, or one of its layers, as a picture that a notebook shows.

        Args:
            exposure: stops; of light, so of layers such as `direct` too.
            tonemap: the same: one of `settings.TONEMAPS`.
            layer: name of the layer; None: the image itself. Layers that are no light are shown as `layer_to_display`
                says.

        Raises:
            UsageError: no such layer, no such tonemap.
        """
        if layer is None:
            return Picture(self.to_uint8(exposure, tonemap))
        return Picture(layer_to_display(layer, self[layer], exposure, check_tonemap(tonemap)))

    def _repr_png_(self) -> bytes:
        """The image as a notebook shows it that knows no HTML."""
        return self.show()._repr_png_()

    def _repr_html_(self) -> str:
        """The image, its layers as small pictures, and what is known about it, for a notebook."""
        small = {name: self.show(layer=name) for name in self.layers}
        return page_of(self.show(), small, self._known())

    def _known(self) -> dict[str, Any]:
        """Metadata that people read: matrices and lists of names would fill the screen."""
        return {key: value for key, value in self.metadata.items() if len(str(value)) <= _SHORT}

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

        `.png`, `.jpg`, `.jpeg`: 8 bits, display-encoded. `.exr`, `.npz`: float32, linear, every value as it is, with
        layers and metadata. `.npy`: the same, of the image alone. `.hdr`: linear RGBE. A pixel with a NaN or an
        infinity becomes black in the 8-bit formats and in `.hdr`.

        Args:
            path: where to; an existing file is replaced once the new one is complete.
            exposure: of 8-bit formats, in stops.
            tonemap: of 8-bit formats: one of `settings.TONEMAPS`.

        Raises:
            ImageError: the file cannot be written, or the image has layers and the format has none; an earlier file
                of this name is still there.
            UsageError: no such tonemap.
        """
        check_tonemap(tonemap)
        target = _target(Path(path))
        if self.layers and target.suffix.lower() not in LAYER_SUFFIXES:
            raise ImageError(
                f"{path}: the layers {', '.join(self.layers)} fit only into {' and '.join(LAYER_SUFFIXES)} files; use "
                "one of these, or save image.select_layers(), which has none"
            )
        suffix = target.suffix.lower()
        temporary = temporary_for(target)
        with replacing(target, temporary, ImageError):
            if suffix == ".npy":
                _write_npy(temporary, self.pixels)
            elif suffix == ".exr":
                data, names = side_by_side(self.pixels, self.layers)
                write_pixels(temporary, data, exr_header(self.metadata), names)
            elif suffix == ".npz":
                write_archive(temporary, self.pixels, self.layers, self.metadata)
            elif suffix == ".hdr":
                finite = np.isfinite(self.pixels).all(axis=-1, keepdims=True)
                write_pixels(temporary, np.where(finite, np.maximum(self.pixels, 0), np.float32(0)), {})
            else:
                shown = self.to_uint8(exposure, tonemap)
                # libjpeg ends the whole process when the disk is full, so the room is claimed beforehand.
                if suffix != ".png":
                    claim_space(temporary, shown.nbytes)
                colour_space = "linear" if tonemap == "linear" or self._shows_data else "sRGB"
                write_pixels(temporary, shown, {"CompressionQuality": 95, "oiio:ColorSpace": colour_space})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Image:
        """Read an image file; 8- and 16-bit formats are taken as sRGB and made linear, alpha is dropped.

        Channels of an EXR file that are named like `normal.X` become layers.

        Raises:
            ImageError: no such file, an unknown suffix, or not a readable image.
        """
        path = Path(path)
        _check_suffix(path)
        if path.is_dir():
            raise ImageError(f"{path} is a directory, not an image")
        if not path.exists():
            raise ImageError(f"{path}: there is no such file")
        if path.suffix.lower() == ".npz":
            pixels, layers, metadata = read_archive(path)
            return cls(pixels, metadata, layers)
        return cls(_read_npy(path)) if path.suffix.lower() == ".npy" else cls(*read_pixels(path))


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


def _read_npy(path: Path) -> NDArray[Any]:
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ImageError(f"{path}: cannot be read: {error}") from None
    if not isinstance(array, np.ndarray) or array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise ImageError(f"{path}: it must hold one array of numbers of the shape height x width x 3")
    return array
