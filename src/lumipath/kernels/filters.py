"""Pixel filters by importance sampling: where in and about a pixel a sample lies, and how much it counts.

Samples are not shared between pixels. Each is drawn with a density proportional to the filter about its own pixel, so
that the pixel is their plain mean (Ernst, Stamminger and Greiner 2006, Filter Importance Sampling; pbrt, 4th edition,
section 8.8). All filters here are products of one function of x and the same function of y.

A filter with negative lobes is drawn from its absolute value, and samples from its negative parts count negatively. A
fixed share of the samples is negative, of those that a stratified number says: any `1 / NEGATIVE_SHARE` samples in a
row of Sobol's have exactly one such number, so that their weights add up to their count and what is even stays even.
"""

from __future__ import annotations

from ..lang import f32, i32, kernel, load, load4, sqrt, struct
from ..pack.layout import FILTER, FILTER_CELLS, FILTER_TABLES, FILTER_WEIGHTS, SIGNED_FILTER
from .alias import resolve_alias

# Of samples, those that count negatively; close to the share that makes least noise with Mitchell's filter.
NEGATIVE_SHARE = f32(0.0625)

_NEGATIVE_TABLE = i32(FILTER_TABLES + FILTER_CELLS + 1)


@struct
class FilterSample:
    """A place in pixels from the top left corner of the pixel, right and down, and how much a sample there counts."""

    x: f32
    y: f32
    weight: f32


@kernel
def filter_distance(view, table, u):
    """Signed distance from the middle of the pixel along one axis, in pixels, drawn from a table.

    The table has the inverse of the cumulated filter, from its middle outwards, at 1 - (1 - k / FILTER_CELLS)^2: close
    together towards its edge, where the filter falls to 0. Ascending with u, so that well spread numbers stay so.
    """
    v = abs(2.0 * u - 1.0)
    t = (1.0 - sqrt(max(0.0, 1.0 - v))) * f32(FILTER_CELLS)
    k = min(i32(t), i32(FILTER_CELLS - 1))
    near = load(view.lens, table + k)
    distance = near + (load(view.lens, table + k + 1) - near) * (t - f32(k))
    return distance if u >= 0.5 else -distance


@kernel
def box_sample(scene, view, u, v):
    """Evenly over the pixel's square."""
    return FilterSample(u, v, 1.0)


@kernel(needs=FILTER, otherwise=box_sample)
def positive_sample(scene, view, u, v):
    """From a filter that is nowhere negative, or from the positive part of one that is."""
    x = filter_distance(view, FILTER_TABLES, u)
    return FilterSample(0.5 + x, 0.5 + filter_distance(view, FILTER_TABLES, v), 1.0)


@kernel(needs=SIGNED_FILTER, otherwise=positive_sample)
def filter_sample(scene, view, u, v):
    """A sample of the pixel's filter.

    Args:
        scene: PackedScene.
        view: View.
        u: in [0, 1), places the sample across.
        v: in [0, 1), places the sample down.
    """
    weights = load4(view.lens, FILTER_WEIGHTS)
    # The product is negative where one of the factors is ...
    sign = resolve_alias(i32(1), i32(0), NEGATIVE_SHARE, u)
    negative = sign.index == 1
    # ... the one across or the one down, alike; or else both are, or neither.
    which = resolve_alias(i32(1), i32(0), 0.5 if negative else weights[2], sign.rest)
    across = which.index == 1
    down = across != negative
    x = filter_distance(view, _NEGATIVE_TABLE if across else FILTER_TABLES, which.rest)
    y = filter_distance(view, _NEGATIVE_TABLE if down else FILTER_TABLES, v)
    return FilterSample(0.5 + x, 0.5 + y, weights[1] if negative else weights[0])
