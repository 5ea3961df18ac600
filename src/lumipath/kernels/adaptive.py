"""What an adaptive film needs beside the sums: squares of samples, and how many samples a tile is to have."""

from __future__ import annotations

from ..lang import i32, kernel, load, store
from ..pack.layout import ADAPTIVE, TILE
from .vectors import luminance


@kernel
def no_square(scene, c):
    """Nobody asks for the noise."""
    return 0.0


@kernel(needs=ADAPTIVE, otherwise=no_square)
def square_of(scene, c):
    """The squared luminance of a sample."""
    y = luminance(c)
    return y * y


@kernel
def drop_square(scene, film, place, square):
    """Nobody asks for the noise."""


@kernel(needs=ADAPTIVE, otherwise=drop_square)
def add_square(scene, film, place, square):
    """Add the squares of samples to those of their pixel."""
    store(film.squares, place, load(film.squares, place) + square)


@kernel
def same_goal(scene, film, tile, last):
    """All tiles go as far as the pass does."""
    return i32(last)


@kernel(needs=ADAPTIVE, otherwise=same_goal)
def goal_of(scene, film, tile, last):
    """How many samples the pixels of a tile have after a pass that goes up to `last`."""
    return min(load(film.goals, tile), i32(last))


@kernel
def always(scene, view, film, column, row, sample):
    """All pixels take part."""
    return True


@kernel(needs=ADAPTIVE, otherwise=always)
def takes(scene, view, film, column, row, sample):
    """Whether the tile of a place on the film takes the sample of this number, as the view numbers them."""
    across = (view.film_width + TILE - 1) // TILE
    # Threads that stand for pixels beyond the edge must not read beyond the goals.
    tile = (min(row, i32(view.film_height - 1)) // TILE) * across + min(column, i32(view.film_width - 1)) // TILE
    return load(film.goals, tile) > i32(sample - view.first_sample)
