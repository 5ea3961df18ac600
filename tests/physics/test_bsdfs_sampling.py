"""Matt surfaces, metal, glass: directions are drawn with the density that is claimed, and weighed by what is left."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_calls import EVALS, SAMPLES, at_angle, numbers, packed_with
from scipy import stats

from lumipath.scene import Material

COUNT = 200_000
ALPHA = 1e-4
ROWS, COLUMNS = 24, 32
# Points in a cell; refraction hardly spreads what arrives face to face.
DOWN, ACROSS = 96, 6

INSIDE, OUTSIDE = 1 / 1.5, 1.5
CASES = [
    ("metal", 1.0, (0.2, 0.2), 0.6, 0.0),
    ("metal", 1.0, (1.0, 1.0), 0.15, 0.0),
    ("metal", 1.0, (0.6, 0.15), 0.5, 0.1),
    ("glass", OUTSIDE, (0.4, 0.4), 1.0, 0.0),
    ("glass", OUTSIDE, (0.3, 0.3), 0.2, 0.0),
    ("glass", OUTSIDE, (1.0, 1.0), 0.7, 0.3),
    ("glass", INSIDE, (0.2, 0.2), 0.9, 0.0),
    ("glass", INSIDE, (0.4, 0.4), 0.3, 0.6),
    ("glass", INSIDE, (1.0, 1.0), 0.6, 0.0),
    ("glass", 1.2, (0.7, 0.7), 0.4, 0.0),
    ("glass", 2.4, (0.5, 0.2), 0.5, 0.15),
    ("sheet", 1.5, (0.3, 0.3), 0.4, 0.0),
    ("sheet", 1.5, (0.8, 0.8), 0.9, 0.2),
    ("matt", 1.0, (0.0, 0.0), 0.4, 0.0),
    ("matt", 1.0, (1.0, 1.0), 0.7, 0.2),
]


@pytest.fixture(scope="module")
def scene():
    return packed_with(Material(transmissive=1.0))


def drawn(scene, case, seed):
    """Wi, weight and density of many samples of a case."""
    kind, eta, alphas, cosine, turn = case
    found = SAMPLES[kind](scene, eta, *alphas, *at_angle(cosine, turn)[:, None], *numbers(seed, COUNT, 3))
    return found[:3], found[3], found[4]


def evaluated(scene, case, wi):
    """Value and density towards wi."""
    kind, eta, alphas, cosine, turn = case
    return EVALS[kind](scene, eta, *alphas, *at_angle(cosine, turn)[:, None], *wi)


def density_by_cells(scene, case):
    """(ROWS, COLUMNS): probability of each cell of equal solid angle on the sphere, by integration of the density."""
    z = (np.arange(ROWS * DOWN) + 0.5) / (ROWS * DOWN) * 2 - 1
    turn = (np.arange(COLUMNS * ACROSS) + 0.5) / (COLUMNS * ACROSS) - 0.5
    pdf = evaluated(scene, case, at_angle(z[:, None], turn[None]).reshape(3, -1))[1].astype(float)
    cells = pdf.reshape(ROWS, DOWN, COLUMNS, ACROSS).mean(axis=(1, 3))
    return cells * (4 * np.pi / (ROWS * COLUMNS))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_directions_are_drawn_with_their_density(scene, case):
    wi, _, pdf = drawn(scene, case, 1)
    lives = pdf > 0
    angle = np.arctan2(wi[1], wi[0])[lives]
    observed = np.histogram2d(wi[2][lives], angle, (ROWS, COLUMNS), ((-1, 1), (-np.pi, np.pi)))[0].ravel()
    expected = density_by_cells(scene, case).ravel()
    # What goes nowhere is one more cell.
    observed = np.append(observed, COUNT - lives.sum())
    expected = np.append(expected, max(1 - expected.sum(), 0)) * COUNT
    few = expected < 20
    observed = np.append(observed[~few], observed[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    possible = expected > 0
    assert (observed[~possible] == 0).all()
    observed, expected = observed[possible], expected[possible]
    assert expected.sum() == pytest.approx(COUNT, rel=0.002)
    assert stats.chisquare(observed, expected * observed.sum() / expected.sum()).pvalue > ALPHA


def test_the_chi_square_test_tells_densities_of_other_cases(scene):
    wi, _, pdf = drawn(scene, CASES[4], 1)
    observed = np.histogram2d(
        wi[2][pdf > 0], np.arctan2(wi[1], wi[0])[pdf > 0], (ROWS, COLUMNS), ((-1, 1), (-np.pi, np.pi))
    )[0].ravel()
    expected = np.maximum(density_by_cells(scene, CASES[3]).ravel(), 1e-3)
    assert stats.chisquare(observed, expected * observed.sum() / expected.sum()).pvalue < ALPHA


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_weight_is_the_value_over_the_density(scene, case):
    wi, weight, pdf = (part[..., :20_000] for part in drawn(scene, case, 2))
    lives = pdf > 0
    value, density = evaluated(scene, case, wi[:, lives])
    # Facets are found again from two directions, which takes digits where they nearly agree.
    relative = np.abs(density / pdf[lives] - 1)
    assert np.quantile(relative, 0.99) < 2e-3
    assert np.median(relative) < 1e-5
    np.testing.assert_allclose(value / density, weight[lives], rtol=2e-4)
    assert (weight[~lives] == 0).all()


@pytest.mark.parametrize("kind", ["metal", "glass", "sheet", "matt"])
def test_two_directions_may_change_places(scene, kind):
    opaque = kind in ("metal", "matt")
    eta = 1.0 if opaque else 1.5
    z, turn = numbers(3, 2000) * np.float32([[0.98], [1.0]]) + np.float32([[0.01], [0.0]])
    other = numbers(4, 2000)
    wo = at_angle(z, turn)
    for side in (1,) if opaque else (1, -1):
        wi = at_angle(side * (0.01 + 0.98 * other[0]), other[1])
        value, _ = EVALS[kind](scene, eta, 0.5, 0.3 if kind != "sheet" else 0.5, *wo, *wi)
        # Seen from the other side, the first direction is above again.
        flip = np.float32([[1], [1], [side]])
        refracts = side < 0 and kind == "glass"
        back, _ = EVALS[kind](
            scene, 1 / eta if refracts else eta, 0.5, 0.3 if kind != "sheet" else 0.5, *(wi * flip), *(wo * flip)
        )
        f, g = value / np.abs(wi[2]), back / np.abs(wo[2])
        # Of basic radiance refraction is not symmetric by itself: f / eta^2 is, with eta as either side sees it.
        f, g = (f / eta**2, g * 1.0) if refracts else (f, g)
        lit = (f > 1e-4) & (g > 1e-4)
        assert lit.mean() > 0.2
        np.testing.assert_allclose(f[lit], g[lit], rtol=3e-3)


@pytest.mark.parametrize("kind", ["glass", "sheet"])
@pytest.mark.parametrize("eta", [1.5, 1 / 1.5, 2.4])
def test_smooth_glass_follows_fresnel(scene, kind, eta):
    if kind == "sheet" and eta < 1:
        pytest.skip("a sheet has the same index on both sides")
    for cosine in (0.1, 0.5, 0.8, 1.0):
        wo = at_angle(cosine)
        x, y, z, weight, pdf = SAMPLES[kind](scene, eta, 0.0, 0.0, *wo[:, None], *numbers(5, 20_000, 3))
        sine = np.sqrt(1 - cosine**2) / eta
        if sine >= 1:
            assert (z > 0).all()
            continue
        through = np.sqrt(1 - sine**2)
        s = ((cosine - eta * through) / (cosine + eta * through)) ** 2
        p = ((eta * cosine - through) / (eta * cosine + through)) ** 2
        reflectance = (s + p) / 2
        if kind == "sheet":
            # The sum of all reflections between the two sides.
            reflectance += (1 - reflectance) ** 2 * reflectance / (1 - reflectance**2)
        assert (pdf == 0).all()
        assert (weight == 1).all()
        assert (z > 0).mean() == pytest.approx(reflectance, abs=0.015)
        np.testing.assert_allclose(x[z < 0], -wo[0] / (1 if kind == "sheet" else eta), atol=1e-5)
        np.testing.assert_allclose(x**2 + y**2 + z**2, 1, atol=1e-5)
