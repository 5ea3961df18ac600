"""Figure 1, measured in earnest, on images of a few pixels."""

from __future__ import annotations

import attrs
import numpy as np
import pytest

import lumipath as lp
from lumipath.bench.figure1 import FIGURE1_SETTINGS, Point, Timing, measure_points

TINY = attrs.evolve(FIGURE1_SETTINGS, width=12, height=8)


def points_of(*arguments, **options):
    return [item for item in measure_points(*arguments, **options) if isinstance(item, Point)]


def test_both_devices_render_the_picture_that_is_wanted(device):
    scene = lp.builtin("cornell-box")
    points = points_of([scene], [1, 16], TINY, device=device, against="cpu")
    assert [point.spp for point in points] == [1, 16]
    for point in points:
        assert point.relative_difference < 1e-3
        assert (point.device.kind, point.against.kind) == (device, "cpu")
        assert min(point.device.seconds, point.against.seconds, point.speed_up) > 0
        image = lp.render(scene, device="cpu", width=12, height=8, max_depth=3, rr_depth=None, spp=point.spp)
        np.testing.assert_allclose(point.against.mean_rgb, np.mean(image, axis=(0, 1)), rtol=1e-4)


def test_a_limit_of_nothing_still_measures_a_whole_sample():
    (point,) = points_of([lp.builtin("cornell-box")], [64], TINY, device="cpu", against="cpu", cpu_limit=0)
    for timing in (point.device, point.against):
        assert (timing.samples, timing.extrapolated) == (1, True)


@pytest.mark.parametrize(("means", "difference"), [((1.0, 2.0), 0.5), ((2.0, 1.0), 1.0), ((0, 0), 0), ((1, 0), 1)])
def test_the_difference_of_means_is_relative_to_the_device_compared_with(means, difference):
    ours, theirs = (Timing("cpu", "", 1.0, 1.0, False, 1.0, [mean] * 3, 0.0, 0.0) for mean in means)
    assert Point("", 0, 1, ours, theirs).relative_difference == difference
