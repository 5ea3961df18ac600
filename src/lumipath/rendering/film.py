"""The film: sums of samples, added up so that nothing is lost and merging is addition."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..devices.device import goals_of
from ..pack.layout import TILE, FilmArrays
from .memory import require_memory

BYTES_PER_PIXEL = 40
"""Sums, what they lost and counts, and the image that is made of them."""

_BYTES_OF_SQUARE = 4

_MOST_SAMPLES = (1 << 32) - 1
_ROWS = 64


class Film:
    """Sums of the samples of each pixel.

    Args:
        width, height: pixels across and down.
        adaptive: whether it keeps what its noise is estimated from, and a goal for each tile.

    Attributes:
        total: (H, W, 3) float32 sums of radiance.
        lost: (H, W, 3) float32 what rounding took from `total`; the true sum is total + lost.
        counts: (H, W) uint32 samples in each pixel.
        squares: (H, W) float32 sums of the squared luminance of samples; (0, 0) if not adaptive.
        goals: (H / 16, W / 16), rounded up, int32 samples that the pixels of each tile of 16 x 16 are to have; (0, 0)
            if not adaptive.
        rejected: samples that were not finite and count as black.

    Raises:
        UsageError: there is not enough memory for a film of that size.
    """

    def __init__(self, width: int, height: int, adaptive: bool = False) -> None:
        require_memory(width, height, BYTES_PER_PIXEL + (_BYTES_OF_SQUARE if adaptive else 0), "film and image")
        self.total: NDArray[np.float32] = np.zeros((height, width, 3), np.float32)
        self.lost: NDArray[np.float32] = np.zeros((height, width, 3), np.float32)
        self.counts: NDArray[np.uint32] = np.zeros((height, width), np.uint32)
        self.squares: NDArray[np.float32] = np.zeros((height, width) if adaptive else (0, 0), np.float32)
        tiles = (-(-height // int(TILE)), -(-width // int(TILE)))
        self.goals: NDArray[np.int32] = np.zeros(tiles if adaptive else (0, 0), np.int32)
        self.rejected = 0

    @property
    def is_adaptive(self) -> bool:
        """Whether it keeps squares and goals."""
        return self.squares.size > 0

    @property
    def arrays(self) -> FilmArrays:
        """The sums as kernels see them."""
        return FilmArrays(self.total, self.lost, self.counts, self.squares, self.goals)

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

    def fewest(self, last: int) -> int | None:
        """The smallest number of samples of a pixel that lacks some to `last` or its goal; None: none does."""
        lacking = self.counts < goals_of(self.arrays, last)
        return int(self.counts[lacking].min()) if lacking.any() else None

    def clear(self) -> None:
        """No samples."""
        for array in self.arrays:
            array.fill(0)
        self.rejected = 0

    def mean(self) -> NDArray[np.float32]:
        """(H, W, 3) float32: the mean radiance of each pixel; 0 where there is no sample yet."""
        image = np.empty(self.total.shape, np.float32)
        # Some rows at a time: float64 copies of everything would take more memory than the film.
        for top in range(0, self.height, _ROWS):
            rows = slice(top, top + _ROWS)
            counts = np.maximum(self.counts[rows], 1).astype(np.float64)[..., None]
            image[rows] = (self.total[rows].astype(np.float64) + self.lost[rows]) / counts
        return image

    def add(self, other: Film) -> None:
        """Add the samples of another film of the same size.

        Raises:
            ValueError: the sizes differ, or there are more samples than can be counted.
        """
        if other.total.shape != self.total.shape:
            raise ValueError(f"films of {self.width} x {self.height} and {other.width} x {other.height} do not add up")
        if int(self.counts.max()) + int(other.counts.max()) > _MOST_SAMPLES:
            raise ValueError(f"a pixel of the sum would have more than {_MOST_SAMPLES} samples")
        for top in range(0, self.height, _ROWS):
            rows = slice(top, top + _ROWS)
            sums = self.total[rows].astype(np.float64) + self.lost[rows] + other.total[rows] + other.lost[rows]
            self.total[rows] = sums
            self.lost[rows] = sums - self.total[rows]
        self.counts += other.counts
        if self.is_adaptive and other.is_adaptive:
            self.squares += other.squares
            self.goals += other.goals
        elif self.is_adaptive:
            # Squares of a part of the samples say nothing.
            self.squares, self.goals = other.squares.copy(), other.goals.copy()
        self.rejected += other.rejected


def level(film: Film, render: Callable[[Film, int], None]) -> None:
    """Bring all pixels of a film up to the number of samples that the first of them have, or to their tile's goal.

    Args:
        film: whose pixels have different numbers of samples, as after an interruption.
        render: brings all pixels of a film, which have equal counts, up to a number of samples.
    """
    goals = goals_of(film.arrays, int(film.counts.max()))
    lacking = film.counts < goals
    steps = [int(count) for count in np.union1d(film.counts[lacking], goals[lacking])]
    for low, high in pairwise(steps):
        missing = Film(film.width, film.height, film.is_adaptive)
        missing.counts[...] = low
        missing.goals[...] = high
        render(missing, high)
        missing.counts -= np.uint32(low)
        others = (film.counts != low) | (film.counts >= goals)
        for array in (missing.total, missing.lost, missing.counts, *([missing.squares] if film.is_adaptive else [])):
            array[others] = 0
        # The film has its own.
        missing.goals.fill(0)
        film.add(missing)
