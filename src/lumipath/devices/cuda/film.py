"""Adding to the film from GPU threads, each of which has its pixels for itself."""

from __future__ import annotations

from ...kernels.light_layers import all_columns
from ...lang import kernel, load, store
from ...lang.maths import exact_add, exact_sub


@kernel
def add_exactly(sums, losses, i, value):
    """Add a number to a sum, keeping the digits that float32 cannot hold (Knuth's two-sum)."""
    before = load(sums, i)
    total = exact_add(before, value)
    c = exact_sub(total, before)
    lost = exact_add(exact_sub(before, exact_sub(total, c)), exact_sub(value, c))
    store(sums, i, total)
    store(losses, i, load(losses, i) + lost)


@kernel
def add_vector(sums, losses, i, value):
    """Add three numbers to three sums that follow one another."""
    add_exactly(sums, losses, i, value.x)
    add_exactly(sums, losses, i + 1, value.y)
    add_exactly(sums, losses, i + 2, value.z)


@kernel
def add_samples(film, place, total):
    """Add the sum of a pixel's samples to the film."""
    add_vector(film.total, film.lost, place * 3, total)


@kernel
def put_in_film(scene, film, place, column, value):
    """Add three numbers to the columns of a pixel's layers."""
    add_vector(film.parts, film.parts_lost, place * all_columns(scene) + column, value)
