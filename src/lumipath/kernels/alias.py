"""Drawing from alias tables (Vose 1991), reusing what the choice leaves of the random number."""

from __future__ import annotations

from ..lang import as_int, f32, i32, kernel, load, struct

_BELOW_ONE = f32(0.99999994)


@struct
class Pick:
    """An outcome, and a new random number in [0, 1)."""

    index: i32
    rest: f32


@kernel
def resolve_alias(first, other, threshold, x):
    """`first` where x < threshold, else `other`; x in [0, 1)."""
    is_first = x < threshold
    # One division for both cases, and no branch, which could not be predicted.
    offset = x if is_first else x - threshold
    width = threshold if is_first else 1.0 - threshold
    return Pick(first if is_first else other, min(offset / width, _BELOW_ONE))


@kernel
def pick_alias(table, start, count, u):
    """Draw from the `count` rows of two floats, threshold and other outcome as bits, that start at row `start`."""
    x = u * f32(count)
    i = min(i32(x), i32(count - 1))
    row = (start + i) * 2
    return resolve_alias(i, as_int(load(table, row + 1)), load(table, row), x - f32(i))
