"""How noisy a film is, tile by tile, and which tiles need more samples.

The standard error of a pixel follows from the sums of its samples and of their squares. The error of a tile is the root
of the mean of their squares, relative to the tile's luminance. What is compared is a tile, not a pixel, as in the
hierarchical stopping condition of Dammertz et al. (2010): a pixel alone may be lucky. Dark tiles are measured by a part
of the picture's luminance, since errors that nobody can see are not worth their samples; Rousselle et al. (2011) add a
constant for the same end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..pack.layout import TILE
from .film import Film
from .tonemap import luminance

FIRST_GOAL = 32
"""Samples that every pixel gets before anything is estimated: fewer tell too little about their own scatter."""

_SIDE = int(TILE)
# Part of the picture's luminance below which a tile counts as dark.
_DARK = 0.1
# Part of the tiles, the brightest ones, that the picture's luminance leaves out: lamps and suns.
_LAMPS = 0.05


def next_goal(goal: int) -> int:
    """The stop after `goal` samples: 32, 48, 64, 96, 128 and so on, of which every other one is a power of two."""
    if goal < FIRST_GOAL:
        return FIRST_GOAL
    power = 1 << (goal.bit_length() - 1)
    return power * 3 // 2 if goal < power * 3 // 2 else power * 2


def tile_errors(film: Film) -> NDArray[np.float64]:
    """(rows, columns): the estimated relative standard error of each tile of 16 x 16 pixels of an adaptive film.

    With L the mean absolute luminance of a tile's pixels and V the mean of the variances of their means, the error is
    sqrt(V / (L^2 + (L0 / 10)^2)), where L0 is the mean of L over all tiles but the brightest twentieth. Its square is
    smoothed over 3 x 3 tiles, and a tile has the larger of both values: one that has not yet met the light that makes
    its neighbours noisy must not stop before them.
    """
    variances, light = _tile_means(film)
    tiles = np.sort(light.ravel())
    usual = tiles[: tiles.size - int(_LAMPS * tiles.size)].mean()
    scale = light**2 + (_DARK * usual) ** 2
    squared = np.divide(variances, scale, out=np.zeros_like(variances), where=variances > 0)
    return np.sqrt(np.maximum(squared, _smoothed(squared)))


def _tile_means(film: Film) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(rows, columns) each: mean over the pixels of a tile of the variance of their means, and of their luminance."""
    variances, light = np.zeros(film.goals.shape), np.zeros(film.goals.shape)
    # A row of tiles at a time: float64 copies of everything would take more memory than the film.
    for row in range(len(light)):
        rows = slice(row * _SIDE, (row + 1) * _SIDE)
        counts = np.maximum(film.counts[rows], 1).astype(np.float64)
        y = luminance((film.total[rows].astype(np.float64) + film.lost[rows]) / counts[..., None])
        # Of samples, with Bessel's correction, then of their mean; rounding may make a constant's negative.
        of_samples = np.maximum(film.squares[rows] / counts - y * y, 0) * counts / np.maximum(counts - 1, 1)
        variances[row] = _means_of_columns(of_samples / counts)
        light[row] = _means_of_columns(np.abs(y))
    return variances, light


def _means_of_columns(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of each block of 16 columns; the last one may be narrower."""
    starts = np.arange(0, values.shape[1], _SIDE)
    widths = np.minimum(values.shape[1] - starts, _SIDE)
    return np.add.reduceat(values.sum(axis=0), starts) / (widths * values.shape[0])


def _smoothed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """A tent filter over 3 x 3 tiles; edges repeat."""
    for axis in (0, 1):
        padded = np.pad(values, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], mode="edge")
        before, here, after = (padded.take(range(k, k + values.shape[axis]), axis) for k in range(3))
        values = (before + 2 * here + after) / 4
    return values


def worst_error(film: Film) -> float | None:
    """The largest error of a tile; None where the film keeps no squares, or a pixel has too few samples to tell."""
    if not film.is_adaptive or int(film.counts.min()) < 2:
        return None
    return float(tile_errors(film).max())


def raise_goals(film: Film, errors: NDArray[np.float64], noise: float, limit: int) -> bool:
    """Set the goals of the tiles that need more samples to their next stop; whether there are any.

    Args:
        film: every pixel of which has reached the goal of its tile.
        errors: (rows, columns) as from `tile_errors`.
        noise: the error below which a tile is good enough.
        limit: samples that no pixel may exceed.

    Of those tiles only the ones with the fewest samples go on, so that all that do have equally many.
    """
    needy = (errors >= noise) & (film.goals < limit)
    if not needy.any():
        return False
    fewest = int(film.goals[needy].min())
    film.goals[needy & (film.goals == fewest)] = min(next_goal(fewest), limit)
    return True


def begin_goals(film: Film, limit: int) -> None:
    """Set the goals of a film without samples."""
    film.goals[...] = min(FIRST_GOAL, limit)


def needed_samples(film: Film, errors: NDArray[np.float64], noise: float, limit: int) -> float:
    """About how many samples per pixel the picture will have in the end: errors fall with the root of the samples."""
    factors = np.maximum(errors / noise, 1.0) ** 2
    return float(np.minimum(film.goals * factors, limit).mean())
