"""Pixel filters as tables to draw from; `kernels/filters.py` does so."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..kernels.filters import NEGATIVE_SHARE
from ..settings import FILTER_RADII
from .layout import FILTER_CELLS

_Floats = NDArray[np.float64]

# Steps at which a filter is looked at.
_FINE = 1 << 15


def _box(x: _Floats) -> _Floats:
    return np.ones_like(x)


def _gaussian(x: _Floats) -> _Floats:
    # A standard deviation of a third of the radius, lowered so that it ends at 0 (pbrt, 4th edition, section 8.8).
    return np.asarray(np.exp(-4.5 * x * x) - np.exp(-4.5))


def _blackman_harris(x: _Floats) -> _Floats:
    # Harris 1978, On the Use of Windows for Harmonic Analysis, the window of four terms and least side lobes.
    turns = np.cos(np.pi * np.arange(4)[:, None] * x)
    return np.asarray(np.array([0.35875, 0.48829, 0.14128, 0.01168]) @ turns)


def _mitchell(x: _Floats) -> _Floats:
    # Mitchell and Netravali 1988, with B = C = 1/3; its radius is 2 there.
    x = 2 * x
    inner = 7 * x**3 - 12 * x**2 + 16 / 3
    outer = -7 / 3 * x**3 + 12 * x**2 - 20 * x + 32 / 3
    return np.where(x < 1, inner, outer)


_SHAPES: dict[str, Callable[[_Floats], _Floats]] = {
    "box": _box,
    "gaussian": _gaussian,
    "blackman-harris": _blackman_harris,
    "mitchell": _mitchell,
}


def filter_numbers(name: str, radius: float | None) -> tuple[NDArray[np.float32], bool] | None:
    """What kernels read of a filter: the numbers of `View.lens` from `FILTER_WEIGHTS` on, and whether it has negative
    parts. None: the box of one pixel, which needs none.

    Args:
        name: of `lumipath.settings.FILTERS`.
        radius: beyond which the filter is 0, pixels; None: that of the literature.
    """
    usual = FILTER_RADII[name]
    radius = usual if radius is None else radius
    if name == "box" and radius == usual:
        return None
    middles = (np.arange(_FINE) + 0.5) / _FINE
    values = _SHAPES[name](middles) / _FINE
    positive, negative = np.maximum(values, 0), np.maximum(-values, 0)
    # Shares of one axis: their difference is 1.
    total = values.sum()
    p, n = positive.sum() / total, negative.sum() / total
    share = float(NEGATIVE_SHARE)
    weights = [1.0, 0.0, 0.0, 0.0]
    tables = [_inverse(positive)]
    if n > 0:
        weights = [(p * p + n * n) / (1 - share), -2 * p * n / share, n * n / (p * p + n * n), 0.0]
        tables.append(_inverse(negative))
    return np.concatenate([weights, *(radius * table for table in tables)]).astype(np.float32), n > 0


def _inverse(masses: _Floats) -> _Floats:
    """(FILTER_CELLS + 1,): how far out a share 1 - (1 - k / FILTER_CELLS)^2 of the masses of equal steps of 0..1 lies.

    Masses are above 0 in one stretch only.
    """
    inside = np.flatnonzero(masses)
    edges = np.arange(inside[0], inside[-1] + 2) / len(masses)
    cumulated = np.concatenate([[0.0], np.cumsum(masses[inside])])
    steps = np.arange(int(FILTER_CELLS) + 1) / int(FILTER_CELLS)
    return np.interp(1 - (1 - steps) ** 2, cumulated / cumulated[-1], edges)
