"""Whether images agree, judged by their own noise: no fixed thresholds.

Two sets of independent renders are compared block by block, and as a whole, by Welch's t-test; so is one set with an
image that is known exactly. The smallest p-value is corrected for the number of tests (Sidak 1967), as in Mitsuba's
`test_renders.py`. Seeds are fixed, so a verdict never changes from run to run.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from renders import Renders
from scipy import stats

ALPHA = 1e-3
# Rays start a little off their surface, by 1.5e-5 of its coordinates, and so see lights a little larger: differences of
# this relative size are no faults, however small the noise.
ROUNDING = 3e-5


def block_means(images: ArrayLike, size: int) -> NDArray[np.float64]:
    """(R, H, W, 3) to (R, H / size, W / size, 3); rows and columns that do not fill a block are left out."""
    images = np.asarray(images, np.float64)
    count, height, width, channels = images.shape
    rows, columns = height // size, width // size
    cut = images[:, : rows * size, : columns * size]
    return cut.reshape(count, rows, size, columns, size, channels).mean(axis=(2, 4))


def p_value(a: Renders, b: ArrayLike, block: int = 4) -> float:
    """How likely renders differ as much as these if they show the same scene.

    Args:
        a: (R, H, W, 3) independent renders.
        b: (S, H, W, 3) others, or (H, W, 3) or less: the image that `a` should converge to, exactly.
        block: pixels on the side of a block.
    """
    exact = np.ndim(b) < 4
    b = np.broadcast_to(b, a.shape[1:])[None] if exact else np.asarray(b, np.float64)
    assert a.shape[1:] == b.shape[1:]
    sets = [
        (block_means(a, size).reshape(len(a), -1, 3), block_means(b, size).reshape(len(b), -1, 3))
        for size in (block, min(a.shape[1:3]))
    ]
    # Each channel of each block; each channel of the whole image, and their mean: half of the risk for either family.
    local, whole = ([v.reshape(len(v), -1) for v in pair] for pair in sets)
    whole = [np.concatenate([v, v.mean(axis=1, keepdims=True)], axis=1) for v in whole]
    families = [_welch(*local, exact), _welch(*whole, exact)]
    return min(1.0, 2 * min(_sidak(p) for p in families))


def _sidak(p: NDArray[np.float64]) -> float:
    """The smallest of p-values, corrected for their number."""
    return float(-np.expm1(len(p) * np.log1p(-min(p.min(), 1 - 1e-16))))


def _welch(x: NDArray[np.float64], y: NDArray[np.float64], exact: bool) -> NDArray[np.float64]:
    floor = (ROUNDING * np.maximum(np.abs(x.mean(axis=0)), np.abs(y.mean(axis=0)))) ** 2
    vx = x.var(axis=0, ddof=1) / len(x)
    vy = np.zeros_like(vx) if exact else y.var(axis=0, ddof=1) / len(y)
    total = vx + vy + floor + 1e-30
    freedom = total**2 / (vx**2 / (len(x) - 1) + (0 if exact else vy**2 / (len(y) - 1)) + 1e-300)
    return 2 * stats.t.sf(np.abs(x.mean(axis=0) - y.mean(axis=0)) / np.sqrt(total), np.minimum(freedom, 1e6))


def assert_same(a: Renders, b: ArrayLike, block: int = 4) -> None:
    """Fail where two sets of renders, or renders and their exact image, differ by more than their noise."""
    p = p_value(a, b, block)
    if p < ALPHA:
        mean, other = a.mean(axis=0), np.mean(b, axis=0) if np.ndim(b) == 4 else np.broadcast_to(b, a.shape[1:])
        difference = block_means((mean - other)[None], block)[0]
        row, column, _ = np.unravel_index(np.abs(difference).argmax(), difference.shape)
        raise AssertionError(
            f"p = {p:.2e}; means {mean.mean((0, 1))} and {np.mean(other, (0, 1))}, ratio "
            f"{mean.mean() / max(np.mean(other), 1e-30):.5f}; largest difference {difference[row, column]} in block "
            f"at row {row * block}, column {column * block}"
        )
