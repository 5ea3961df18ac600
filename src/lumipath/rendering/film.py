"""The film: sums of samples, added up so that nothing is lost and merging is addition."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..devices.device import goals_of
from ..pack.layout import TILE, FilmArrays
from .memory import require_memory

BYTES_PER_PIXEL = 40
"""Sums, what they lost and counts, and the image that is made of them."""

_BYTES_OF_SQUARE = 4
# Sums, what they lost, and the layer that is made of them.
_BYTES_OF_LAYER = 36
# The columns of a layer.
_COLUMNS = 3

_MOST_SAMPLES = (1 << 32) - 1
_ROWS = 64


class Film:
    """Sums of the samples of each pixel.

    Args:
        width, height: pixels across and down.
        adaptive: whether it keeps what its noise is estimated from, and a goal for each tile.
        layer_names: of the layers that its samples add to, as `pack.scene.film_layers` orders them.

    Attributes:
        total: (H, W, 3) float32 sums of radiance.
        lost: (H, W, 3) float32 what rounding took from `total`; the true sum is total + lost.
        counts: (H, W) uint32 samples in each pixel.
        squares: (H, W) float32 sums of the squared luminance of samples; (0, 0) if not adaptive.
        goals: (H / 16, W / 16), rounded up, int32 samples that the pixels of each tile of 16 x 16 are to have; (0, 0)
            if not adaptive.
        parts: (H, W, 3 N) float32 sums of the N layers, of radiance or, for `variance`, of squares; (0, 0, 0) without.
        parts_lost: as parts, what rounding took from them.
        rejected: samples that were not finite and count as black.

    Raises:
        UsageError: there is not enough memory for a film of that size.
    """

    def __init__(self, width: int, height: int, adaptive: bool = False, layer_names: Sequence[str] = ()) -> None:
        needed = BYTES_PER_PIXEL + (_BYTES_OF_SQUARE if adaptive else 0) + _BYTES_OF_LAYER * len(layer_names)
        require_memory(width, height, needed, "film and image")
        self.layer_names = tuple(layer_names)
        self.total: NDArray[np.float32] = np.zeros((height, width, 3), np.float32)
        self.lost: NDArray[np.float32] = np.zeros((height, width, 3), np.float32)
        self.counts: NDArray[np.uint32] = np.zeros((height, width), np.uint32)
        self.squares: NDArray[np.float32] = np.zeros((height, width) if adaptive else (0, 0), np.float32)
        tiles = (-(-height // int(TILE)), -(-width // int(TILE)))
        self.goals: NDArray[np.int32] = np.zeros(tiles if adaptive else (0, 0), np.int32)
        columns = _COLUMNS * len(self.layer_names)
        self.parts: NDArray[np.float32] = np.zeros((height, width, columns) if columns else (0, 0, 0), np.float32)
        self.parts_lost: NDArray[np.float32] = np.zeros_like(self.parts)
        self.rejected = 0

    @property
    def is_adaptive(self) -> bool:
        """Whether it keeps squares and goals."""
        return self.squares.size > 0

    @property
    def arrays(self) -> FilmArrays:
        """The sums as kernels see them."""
        return FilmArrays(self.total, self.lost, self.counts, self.squares, self.goals, self.parts, self.parts_lost)

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
        for rows in self._bands():
            image[rows] = self._mean_of(self.total, self.lost, rows)
        return image

    def layers(self) -> dict[str, NDArray[np.float32]]:
        """The layers of the samples so far by name, (H, W, 3) float32 each.

        `variance` is that of the pixel's mean, s^2 / n with Bessel's correction, as if samples were independent; 0
        where a pixel has fewer than two. The other layers are means like the image.
        """
        made = {name: np.empty(self.total.shape, np.float32) for name in self.layer_names}
        for rows in self._bands():
            for number, (name, layer) in enumerate(made.items()):
                columns = slice(_COLUMNS * number, _COLUMNS * (number + 1))
                mean = self._mean_of(self.parts[..., columns], self.parts_lost[..., columns], rows)
                layer[rows] = self._variance_of(mean, rows) if name == "variance" else mean
        return made

    def _bands(self) -> Iterator[slice]:
        """Some rows at a time: float64 copies of everything would take more memory than the film."""
        return (slice(top, top + _ROWS) for top in range(0, self.height, _ROWS))

    def _mean_of(self, total: NDArray[np.float32], lost: NDArray[np.float32], rows: slice) -> NDArray[np.float64]:
        return (total[rows].astype(np.float64) + lost[rows]) / np.maximum(self.counts[rows], 1)[..., None]

    def _variance_of(self, squares: NDArray[np.float64], rows: slice) -> NDArray[np.float64]:
        counts = self.counts[rows].astype(np.float64)[..., None]
        # Rounding may make a constant's negative.
        of_samples = np.maximum(squares - self._mean_of(self.total, self.lost, rows) ** 2, 0)
        return np.where(counts > 1, of_samples / np.maximum(counts - 1, 1), 0)

    def keep_layers(self, names: Sequence[str]) -> None:
        """Have only these layers, in this order, of those that it has."""
        if tuple(names) == self.layer_names:
            return
        columns = [_COLUMNS * self.layer_names.index(name) + k for name in names for k in range(_COLUMNS)]
        self.layer_names = tuple(names)
        self.parts, self.parts_lost = (
            np.ascontiguousarray(array[..., columns]) if columns else np.zeros((0, 0, 0), np.float32)
            for array in (self.parts, self.parts_lost)
        )

    def take(self, other: Film) -> None:
        """Have the samples of another film of the same size and layers, without squares that nobody will go on with."""
        for array, kept in zip(self.arrays, other.arrays):
            if array.size:
                array[...] = kept
        self.rejected = other.rejected

    def add(self, other: Film) -> None:
        """Add the samples of another film of the same size; layers that only one of them has are lost, of both.

        Raises:
            ValueError: the sizes differ, or there are more samples than can be counted.
        """
        if other.total.shape != self.total.shape:
            raise ValueError(f"films of {self.width} x {self.height} and {other.width} x {other.height} do not add up")
        if int(self.counts.max()) + int(other.counts.max()) > _MOST_SAMPLES:
            raise ValueError(f"a pixel of the sum would have more than {_MOST_SAMPLES} samples")
        common = [name for name in self.layer_names if name in other.layer_names]
        self.keep_layers(common)
        other.keep_layers(common)
        for total, lost, their_total, their_lost in (
            (self.total, self.lost, other.total, other.lost),
            (self.parts, self.parts_lost, other.parts, other.parts_lost),
        ):
            for rows in self._bands():
                sums = total[rows].astype(np.float64) + lost[rows] + their_total[rows] + their_lost[rows]
                total[rows] = sums
                lost[rows] = sums - total[rows]
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
        missing = Film(film.width, film.height, film.is_adaptive, film.layer_names)
        missing.counts[...] = low
        missing.goals[...] = high
        render(missing, high)
        missing.counts -= np.uint32(low)
        others = (film.counts != low) | (film.counts >= goals)
        for array in (missing.total, missing.lost, missing.counts, missing.squares, missing.parts, missing.parts_lost):
            if array.size:
                array[others] = 0
        # The film has its own.
        missing.goals.fill(0)
        film.add(missing)
