"""How much an image differs from a reference."""

from __future__ import annotations

import math
from importlib.util import find_spec
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..errors import ImageError, UsageError
from ..rendering.image import Image
from ..rendering.tonemap import to_display
from .falsecolour import colour_map

FLIP_HINT = "FLIP is not installed; install it with: pip install 'lumipath[flip]'"

# What keeps dark pixels of the reference from deciding alone (Rousselle et al. 2011).
_RELATIVE_FLOOR = 0.01
# Below it the FLIP library finds no exposure for a reference.
_BLACK = 1e-12


@frozen(eq=False)
class Comparison:
    """Differences between an image and a reference.

    Attributes:
        mse: mean squared error of linear values.
        relative_mse: mean of (a - b)² / (b² + 0.01), b being the reference (Rousselle et al. 2011).
        psnr: in decibels, of the pictures that 8-bit files show, whose peak is 1; infinite for equal ones.
        flip: mean FLIP error, 0 to 1; None where FLIP is not installed.
        flip_kind: `LDR` (Andersson et al. 2020) or `HDR` (Andersson et al. 2021).
        not_finite: pixels that are not finite in one of the two; they are left out of all but FLIP, where they are
            black.
        flip_map: (H, W) float32, FLIP of each pixel, or None.
    """

    mse: float
    relative_mse: float
    psnr: float
    flip: float | None
    flip_kind: str
    not_finite: int
    flip_map: NDArray[np.float32] | None

    def as_dict(self) -> dict[str, Any]:
        """The numbers, ready for JSON, which knows no infinity."""
        names = ("mse", "relative_mse", "psnr", "flip", "flip_kind", "not_finite")
        values = {name: getattr(self, name) for name in names}
        return {**values, "psnr": self.psnr if math.isfinite(self.psnr) else None}

    def heat_map(self) -> Image:
        """FLIP of each pixel as a colour, from black (0) by red to white (1).

        Raises:
            UsageError: FLIP is not installed.
        """
        if self.flip_map is None:
            raise UsageError(FLIP_HINT)
        return Image(colour_map(self.flip_map, "magma"))


def compare(image: Image, reference: Image, *, hdr: bool = True) -> Comparison:
    """Compare an image with a reference of the same size.

    Args:
        image: what is judged.
        reference: what it should look like.
        hdr: whether FLIP looks at all exposures that show something of the reference, or at the picture as an 8-bit
            file shows it.

    Raises:
        ImageError: the sizes differ, or no pixel is finite in both.
    """
    if image.shape != reference.shape:
        raise ImageError(
            f"the images differ in size: {image.width} x {image.height} and {reference.width} x {reference.height}"
        )
    finite = (np.isfinite(image.pixels) & np.isfinite(reference.pixels)).all(axis=2)
    if not finite.any():
        raise ImageError("there is no pixel that is finite in both images")
    a, b = image.pixels[finite].astype(np.float64), reference.pixels[finite].astype(np.float64)
    squares = (a - b) ** 2
    shown = to_display(image.pixels[finite]).astype(np.float64) - to_display(reference.pixels[finite])
    shown_mse = float(np.mean(shown**2))
    flip_map = _flip(image, reference, hdr) if find_spec("flip_evaluator") else None
    return Comparison(
        mse=float(squares.mean()),
        relative_mse=float(np.mean(squares / (b**2 + _RELATIVE_FLOOR))),
        psnr=-10 * math.log10(shown_mse) if shown_mse > 0 else math.inf,
        flip=None if flip_map is None else float(flip_map.mean(dtype=np.float64)),
        flip_kind="HDR" if hdr else "LDR",
        not_finite=int(finite.size - np.count_nonzero(finite)),
        flip_map=flip_map,
    )


def _flip(image: Image, reference: Image, hdr: bool) -> NDArray[np.float32]:
    """(H, W) float32: FLIP of each pixel, by its authors' library."""
    import flip_evaluator

    if hdr:
        pair = [np.maximum(np.where(np.isfinite(i.pixels), i.pixels, 0), 0) for i in (reference, image)]
    else:
        pair = [to_display(i.pixels) for i in (reference, image)]
    # The library ends the process where the reference is black, unless it is told an exposure.
    black = hdr and float(pair[0].max()) < _BLACK
    parameters = {"startExposure": 0.0, "stopExposure": 1.0, "numExposures": 2} if black else {}
    kind = "HDR" if hdr else "LDR"
    errors, _, _ = flip_evaluator.evaluate(
        *(np.ascontiguousarray(pixels, np.float32) for pixels in pair),
        kind,
        applyMagma=False,
        parameters=parameters,
    )
    return np.asarray(errors, np.float32).reshape(reference.height, reference.width)
