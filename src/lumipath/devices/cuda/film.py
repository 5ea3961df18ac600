"""Adding to the film from GPU threads, each of which has its pixels for itself."""

from __future__ import annotations

from ...lang import kernel, load, store
from ...lang.maths import exact_add, exact_sub


@kernel
def add_exactly(film, i, value):
    """Add a number to the film, keeping the digits that float32 cannot hold (Knuth's two-sum)."""
    before = load(film.total, i)
    total = exact_add(before, value)
    c = exact_sub(total, before)
    lost = exact_add(exact_sub(before, exact_sub(total, c)), exact_sub(value, c))
    store(film.total, i, total)
    store(film.lost, i, load(film.lost, i) + lost)


@kernel
def add_samples(film, place, total):
    """Add the sum of a pixel's samples to the film."""
    add_exactly(film, place * 3, total.x)
    add_exactly(film, place * 3 + 1, total.y)
    add_exactly(film, place * 3 + 2, total.z)
