"""Adding to the film on the CPU: each thread has its pixels for itself."""

from __future__ import annotations

from ..kernels.light_layers import all_columns
from ..lang import kernel, load, store


@kernel(precise=True)
def two_sum(a, b):
    """A + b rounded, and what the rounding lost, exactly (Knuth 1969, TAOCP 2, 4.2.2)."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@kernel
def add_exactly(sums, lost, i, value):
    """Add a number to a sum, keeping the digits that float32 cannot hold."""
    total, rest = two_sum(load(sums, i), value)
    store(sums, i, total)
    store(lost, i, load(lost, i) + rest)


@kernel
def add_to_film(film, i, value):
    """Add one number of a sample to the film."""
    add_exactly(film.total, film.lost, i, value)


@kernel
def put_in_film(scene, film, place, column, value):
    """Add three numbers to the columns of a pixel."""
    at = place * all_columns(scene) + column
    add_exactly(film.parts, film.parts_lost, at, value.x)
    add_exactly(film.parts, film.parts_lost, at + 1, value.y)
    add_exactly(film.parts, film.parts_lost, at + 2, value.z)
