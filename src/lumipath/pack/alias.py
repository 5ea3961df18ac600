"""Alias tables: drawing from a discrete distribution in constant time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..lang import compiled


@compiled
def _fill(scaled, threshold, other):
    """Vose's method (1991): pair each outcome that is too unlikely with one that is too likely."""
    count = len(scaled)
    small = np.empty(count, np.int64)
    large = np.empty(count, np.int64)
    smalls = 0
    larges = 0
    for i in range(count):
        threshold[i] = 1.0
        other[i] = i
        if scaled[i] < 1.0:
            small[smalls] = i
            smalls += 1
        else:
            large[larges] = i
            larges += 1
    while smalls > 0 and larges > 0:
        smalls -= 1
        s = small[smalls]
        g = large[larges - 1]
        threshold[s] = scaled[s]
        other[s] = g
        scaled[g] -= 1.0 - scaled[s]
        if scaled[g] < 1.0:
            larges -= 1
            small[smalls] = g
            smalls += 1


def alias_table(weights: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Thresholds and other outcomes for drawing i with the probability weights[i] / sum(weights).

    Args:
        weights: (N,) not negative; all 0 means all alike.
    """
    weights = np.asarray(weights, np.float64)
    total = weights.sum()
    probabilities = weights / total if total > 0 else np.full(len(weights), 1.0 / len(weights))
    threshold = np.empty(len(weights), np.float64)
    other = np.empty(len(weights), np.int32)
    _fill(probabilities * len(weights), threshold, other)
    return threshold.astype(np.float32), other
