"""The film: sums of samples, added up so that nothing is lost and merging is addition."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..pack.layout import FilmArrays


class Film:
    """Sums of the samples of each pixel.

    Attributes:
        total: (H, W, 3) float32 sums of radiance.
        lost: (H, W, 3) float32 what rounding took from `total`; the true sum is total + lost.
        counts: (H, W) uint32 samples in each pixel.
        rejected: samples that were not finite and count as black.
    """

    def __init__(self, width: int, height: int) -> None:
        self.total: NDArray[np.float32] = np.zeros((height, width, 3), np.float32)
        self.lost: NDArray[np.float32] = np.zeros((height, width, 3), np.float32)
        self.counts: NDArray[np.uint32] = np.zeros((height, width), np.uint32)
        self.rejected = 0

    @property
    def arrays(self) -> FilmArrays:
        """The sums as kernels see them."""
        return FilmArrays(self.total, self.lost, self.counts)

    @property
    def width(self) -> int:
        """Pixels across."""
        return self.total.shape[1]

    @property
    def height(self) -> int:
        """Pixels down."""
        return self.total.shape[0]

    @property
    def samples(self) -> float:
        """Mean number of samples of a pixel."""
        return float(self.counts.mean(dtype=np.float64))

    def clear(self) -> None:
        """No samples."""
        for array in self.arrays:
            array.fill(0)
        self.rejected = 0

    def mean(self) -> NDArray[np.float32]:
        """(H, W, 3) float32: the mean radiance of each pixel; 0 where there is no sample yet."""
        counts = np.maximum(self.counts, 1).astype(np.float64)[..., None]
        return ((self.total.astype(np.float64) + self.lost) / counts).astype(np.float32)

    def add(self, other: Film) -> None:
        """Add the samples of another film of the same size.

        Raises:
            ValueError: the sizes differ.
        """
        if other.total.shape != self.total.shape:
            raise ValueError(f"films of {self.width} x {self.height} and {other.width} x {other.height} do not add up")
        sums = self.total.astype(np.float64) + self.lost + other.total + other.lost
        self.total[...] = sums
        self.lost[...] = sums - self.total
        self.counts += other.counts
        self.rejected += other.rejected
