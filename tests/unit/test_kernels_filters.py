"""Pixel filters: samples have the density of the filter, and weights that add up to it."""

from __future__ import annotations

import numpy as np
import pytest
from filter_shapes import RADII, SHAPES, cumulated
from kernel_calls import looped
from scipy import stats

from lumipath.errors import UsageError
from lumipath.kernels.camera import central_numbers
from lumipath.kernels.filters import NEGATIVE_SHARE, filter_sample
from lumipath.kernels.sampler import camera_numbers
from lumipath.lang import Features
from lumipath.pack.layout import FILTER, SIGNED_FILTER
from lumipath.pack.scene import layer_features, pack_scene, pack_view, settings_features
from lumipath.scene import Camera, Scene, Sphere
from lumipath.settings import FILTER_RADII, FILTERS, RenderSettings

COUNT = 400_000
ALPHA = 1e-4
PACKED = pack_scene(Scene(shapes=[Sphere()])).scene
CASES = [
    ("box", 0.5),
    ("box", 1.2),
    *((name, RADII[name]) for name in FILTERS[1:]),
    ("gaussian", 3.0),
    ("mitchell", 1.0),
]


def _draw(pair, u, v):
    scene, view = pair
    s = filter_sample(scene, view, u, v)
    return s.x, s.y, s.weight


draw = looped(_draw, outputs=3, scene=True)


def _draw_pixel(pair, pixel, sample):
    scene, view = pair
    numbers = camera_numbers(scene, pixel, sample, view.seed)
    s = filter_sample(scene, view, numbers.a, numbers.b)
    return s.x, s.y, s.weight


draw_pixel = looped(_draw_pixel, outputs=3, scene=True)


def _middle(pair, unused):
    scene, view = pair
    numbers = central_numbers()
    s = filter_sample(scene, view, numbers.c, numbers.d)
    return s.x, s.y, s.weight


def scene_and_view(name, radius=None, **settings):
    settings = RenderSettings(filter=name, filter_radius=radius, **settings)
    features = settings_features(settings, Camera())
    return PACKED._replace(features=Features(features)), pack_view(Camera(), settings)


def numbers(seed, count=COUNT):
    return np.minimum(np.random.default_rng(seed).random((2, count), np.float32), np.float32(1 - 2**-24))


def cells(name, radius, bins=24):
    """Edges of cells across the filter, and the integrals over them of one axis' positive and negative part."""
    edges = np.linspace(-radius, radius, bins + 1)
    fine = np.linspace(-radius, radius, bins * 400 + 1)
    values = SHAPES[name]((fine[1:] + fine[:-1]) / 2, radius)
    values = values / values.sum()
    parts = (np.maximum(values, 0), np.maximum(-values, 0))
    return edges, [part.reshape(bins, -1).sum(axis=1) for part in parts]


def chi_square(observed, expected):
    """p-value; cells that expect little are pooled."""
    observed, expected = np.ravel(observed), np.ravel(expected) * (observed.sum() / expected.sum())
    few = expected < 10
    observed = np.append(observed[~few], observed[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    assert observed[expected == 0].sum() == 0, "samples where the filter is 0"
    return stats.chisquare(observed[expected > 0], expected[expected > 0]).pvalue


@pytest.mark.parametrize(("name", "radius"), CASES)
def test_samples_have_the_density_of_the_filter(name, radius):
    x, y, weight = draw(scene_and_view(name, radius), *numbers(1)).astype(float)
    x, y = x - 0.5, y - 0.5
    assert max(np.abs(x).max(), np.abs(y).max()) <= radius * (1 + 1e-6)
    edges, (p, n) = cells(name, radius)
    found = [np.histogram2d(x[w], y[w], (edges, edges))[0] for w in (weight > 0, weight < 0)]
    assert chi_square(found[0], np.outer(p, p) + np.outer(n, n)) > ALPHA
    if name == "mitchell":
        assert chi_square(found[1], np.outer(p, n) + np.outer(n, p)) > ALPHA
        assert (weight < 0).mean() == pytest.approx(float(NEGATIVE_SHARE), abs=2e-3)
        assert len(np.unique(weight)) == 2
    else:
        assert (weight == 1).all()


def test_the_chi_square_test_tells_a_gaussian_from_a_window():
    x, y, _ = draw(scene_and_view("gaussian"), *numbers(1)).astype(float)
    edges, (p, _) = cells("blackman-harris", 1.5)
    assert chi_square(np.histogram2d(x - 0.5, y - 0.5, (edges, edges))[0], np.outer(p, p)) < ALPHA


@pytest.mark.parametrize(("name", "radius"), CASES)
def test_weighted_means_are_integrals_over_the_filter(name, radius):
    x, y, weight = draw(scene_and_view(name, radius), *numbers(2)).astype(float)
    x, y = x - 0.5, y - 0.5
    distance, total = cumulated(name, radius)
    middle, mass = (distance[1:] + distance[:-1]) / 2, np.diff(total)
    second = (middle**2 * mass).sum()
    for values, exact in ((x * 0 + 1, 1.0), (x, 0.0), (x**2, second), (x**2 * y**2, second**2), (x * y, 0.0)):
        weighted = weight * values
        assert abs(weighted.mean() - exact) < 4.5 * weighted.std() / np.sqrt(COUNT) + 1e-4 * radius**2


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_weights_of_sobol_samples_add_up_to_their_number(sampler):
    pair = scene_and_view("mitchell", sampler=sampler)
    pixel = np.repeat(np.arange(200, dtype=np.uint32), 64)
    sample = np.tile(np.arange(64, dtype=np.uint32), 200)
    weight = draw_pixel(pair, pixel, sample)[2].astype(float)
    sums = weight.reshape(-1, 16).mean(axis=1)
    if sampler == "sobol":
        np.testing.assert_allclose(sums, 1, atol=1e-6)
    else:
        assert np.abs(sums - 1).max() > 0.1
    assert weight.mean() == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("name", FILTERS[1:])
def test_places_ascend_with_the_numbers_so_that_these_stay_well_spread(name):
    # Layers use the positive part alone.
    settings = RenderSettings(filter=name)
    features = layer_features(0, settings, Camera())
    assert features & FILTER
    assert not features & SIGNED_FILTER
    u = np.linspace(0, 1, 5000, endpoint=False, dtype=np.float32)
    pair = PACKED._replace(features=Features(features)), pack_view(Camera(), settings)
    x, y, weight = draw(pair, u, u[::-1].copy()).astype(float)
    assert (np.diff(x) > 0).all()
    assert (np.diff(y) < 0).all()
    assert (weight == 1).all()
    # The middle of the pixel, for what is not filtered.
    np.testing.assert_allclose(looped(_middle, outputs=3, scene=True)(pair, u[:1])[:, 0], [0.5, 0.5, 1])


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("u", [0.0, 2**-24, 0.0625, 0.5, 1 - 2**-24])
def test_the_ends_of_the_numbers_stay_in_the_filter(name, u):
    x, y, weight = draw(scene_and_view(name), *np.float32([[u] * 3, [0, 0.5, 1 - 2**-24]]))
    assert np.abs(np.stack([x, y]) - 0.5).max() <= RADII[name] + 1e-6
    assert np.isfinite(weight).all()


def test_the_box_of_one_pixel_is_the_numbers_themselves():
    u, v = numbers(3, 1000)
    scene, view = scene_and_view("box")
    assert not scene.features.mask & FILTER
    x, y, _ = draw((scene, view), u, v)
    np.testing.assert_array_equal(x, u)
    np.testing.assert_array_equal(y, v)


@pytest.mark.parametrize("integrator", ["albedo", "normal", "depth", "ao"])
def test_quick_looks_have_no_negative_samples(integrator):
    settings = RenderSettings(filter="mitchell", integrator=integrator)
    assert settings_features(settings, Camera()) & (FILTER | SIGNED_FILTER) == FILTER


def test_the_usual_radii_are_those_of_the_literature():
    assert FILTER_RADII == RADII


@pytest.mark.parametrize("radius", [0.0, -1.0, 65.0, "2"])
def test_a_wrong_radius_names_its_range(radius):
    with pytest.raises(UsageError, match=r"^filter_radius is .*: it must be a number from 0.001 to 64$"):
        RenderSettings(filter="gaussian", filter_radius=radius)


def test_an_unknown_filter_names_those_there_are():
    with pytest.raises(UsageError, match=r"^filter is 'lanczos': it must be one of box, gaussian, blackman-harris, mi"):
        RenderSettings(filter="lanczos")
