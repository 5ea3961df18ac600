"""Built-in scenes look as they did: renders against stored references, judged by the noise of both."""

from __future__ import annotations

import numpy as np
import pytest
from golden import REFERENCE_SEEDS, SCENES, rendered, stored
from judging import ALPHA, ROUNDING
from scipy import stats

SEEDS = 16


def p_value(images, mean, variance, block=4):
    """How likely renders differ as much as these from a reference that is known with some variance."""
    height, width = (side // block * block for side in mean.shape[:2])

    def blocks(image):
        cut = np.asarray(image)[..., :height, :width, :]
        return cut.reshape(*cut.shape[:-3], height // block, block, width // block, block, 3).mean(axis=(-4, -2))

    ours = blocks(images)
    theirs = blocks(mean)
    total = ours.var(axis=0, ddof=1) / len(images) + blocks(variance) / block**2
    total = total + (ROUNDING * np.abs(theirs)) ** 2 + 1e-30
    # The reference's variance is known so well that the freedom is at least that of our renders.
    p = 2 * stats.t.sf(np.abs(ours.mean(axis=0) - theirs) / np.sqrt(total), len(images) - 1)
    return float(-np.expm1(p.size * np.log1p(-min(p.min(), 1 - 1e-16))))


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_looks_as_it_did(device, name):
    mean, variance = stored(name)
    assert p_value(rendered(name, SEEDS, 64, device=device), mean, variance) > ALPHA


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_is_two_percent_brighter_is_noticed(name):
    mean, variance = stored(name)
    assert p_value(rendered(name, SEEDS, 64), mean * 1.02, variance) < ALPHA


@pytest.mark.parametrize("name", SCENES)
def test_a_reference_is_clean_and_has_light_and_shadow(name):
    mean, variance = stored(name)
    assert REFERENCE_SEEDS > 10
    assert mean.shape == variance.shape
    assert np.isfinite(mean).all()
    assert mean.max() > 0.2
    lit = mean > 0.05 * mean.max()
    assert np.median(np.sqrt(variance[lit]) / mean[lit]) < 0.01
