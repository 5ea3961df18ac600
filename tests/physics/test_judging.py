"""The judge itself: it lets equal images pass and catches small wrongs."""

from __future__ import annotations

import numpy as np
import pytest
from judging import ALPHA, assert_same, block_means, p_value
from parts import hidden
from renders import renders

from lumipath.scene import Camera, Material, PointLight, Scene, Square


def noisy(mean, noise, seed, count=16, shape=(16, 16, 3)):
    return np.random.default_rng(seed).gamma(1 / noise**2, noise**2 * mean, (count, *shape))


def test_equal_images_pass_as_often_as_they_should():
    p = [p_value(noisy(1.0, 0.3, 2 * k), noisy(1.0, 0.3, 2 * k + 1)) for k in range(200)]
    # Under the null hypothesis p is uniform, or larger.
    assert np.mean(np.array(p) < 0.5) < 0.65
    assert min(p) > ALPHA


def test_renders_of_an_exactly_known_image_pass():
    assert p_value(noisy(1.0, 0.3, 1), 1.0) > ALPHA
    assert p_value(np.full((4, 8, 8, 3), 0.5), 0.5 * (1 + 1e-5)) > ALPHA


def test_a_bias_of_one_percent_everywhere_fails():
    assert p_value(noisy(1.01, 0.3, 1, 64, (32, 32, 3)), noisy(1.0, 0.3, 2, 64, (32, 32, 3))) < ALPHA
    assert p_value(noisy(1.01, 0.3, 1, 64, (32, 32, 3)), 1.0) < ALPHA


def test_a_wrong_block_fails_though_the_mean_is_right():
    wrong = noisy(1.0, 0.3, 1)
    wrong[:, :4, :4] *= 1.3
    wrong[:, 4:8, 4:8] *= 0.7
    assert p_value(wrong, noisy(1.0, 0.3, 2)) < ALPHA
    with pytest.raises(AssertionError, match="row"):
        assert_same(wrong, noisy(1.0, 0.3, 2))


def test_a_wrong_image_without_noise_fails():
    assert p_value(np.full((4, 8, 8, 3), 0.5), 0.5002) < ALPHA


def test_block_means_leave_out_what_does_not_fill_a_block():
    image = np.arange(5 * 7 * 3, dtype=float).reshape(1, 5, 7, 3)
    means = block_means(image, 2)
    assert means.shape == (1, 2, 3, 3)
    np.testing.assert_allclose(means[0, 1, 2], image[0, 2:4, 4:6].mean((0, 1)))


def test_two_renders_of_unequal_albedo_fail():
    def wall(albedo):
        return Scene(
            shapes=[Square(transform=np.diag([9, 9, 1, 1]), material=Material(diffuse=albedo)), *hidden("quadric")],
            lights=[PointLight(position=(0, 0, 1), colour=1.0)],
            cameras=[Camera(position=(0, 0, 1))],
        )

    settings = {"seeds": 8, "spp": 16, "width": 16, "max_depth": 1}
    half = renders(wall(0.5), **settings)
    assert p_value(half, renders(wall(0.5), first_seed=8, **settings)) > ALPHA
    assert p_value(half, renders(wall(0.502), first_seed=8, **settings)) < ALPHA
