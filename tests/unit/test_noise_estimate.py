"""The estimate of a film's noise, against samples whose scatter is known, and the goals that follow from it."""

import numpy as np
import pytest

from lumipath.devices.device import goals_of
from lumipath.rendering.film import Film, level
from lumipath.rendering.noise import (
    begin_goals,
    needed_samples,
    next_goal,
    raise_goals,
    tile_errors,
    worst_error,
)


def film_of(samples):
    """An adaptive film of the samples (N, H, W) of grey pixels."""
    count, height, width = samples.shape
    film = Film(width, height, adaptive=True)
    film.total[...] = samples.sum(axis=0)[..., None]
    film.squares[...] = (samples**2).sum(axis=0)
    film.counts[...] = count
    film.goals[...] = count
    return film


def noisy(mean, scatter, count=64, size=(48, 64), seed=1):
    """(count, H, W): normal samples; mean and scatter are numbers, or one for each pixel."""
    return np.random.default_rng(seed).normal(mean, scatter, (count, *size))


def in_tile(row, column, value, size=(48, 64), other=0.0):
    values = np.full(size, other)
    values[row * 16 : row * 16 + 16, column * 16 : column * 16 + 16] = value
    return values


class TestErrors:
    @pytest.mark.parametrize("count", [2, 16, 256])
    @pytest.mark.parametrize("size", [(48, 64), (41, 37), (5, 3)])
    def test_is_the_standard_error_of_the_mean(self, count, size):
        errors = tile_errors(film_of(noisy(2.0, 0.5, count, size)))
        assert errors.shape == (-(-size[0] // 16), -(-size[1] // 16))
        # All tiles are equally bright, so that the floor adds a hundredth to the square of each.
        exact = 0.5 / np.sqrt(count) / (2.0 * np.sqrt(1.01))
        np.testing.assert_allclose(errors.mean(), exact, rtol=0.25 if size == (5, 3) else 0.08)

    def test_the_scatter_of_the_pixel_means_agrees(self):
        films = [film_of(noisy(1.0, 0.3, 25, seed=seed)) for seed in range(30)]
        scatter = np.std([film.mean()[..., 0] for film in films], axis=0, ddof=1)
        estimate = np.mean([tile_errors(film).mean() for film in films]) * np.sqrt(1.01)
        np.testing.assert_allclose(estimate, np.sqrt((scatter**2).mean()), rtol=0.03)

    def test_without_scatter_there_is_none(self):
        # Float32 sums of squares are not exact: what rounding leaves is far below the smallest setting.
        assert tile_errors(film_of(noisy(0.3, 0.0, 4096))).max() < 5e-4
        assert (tile_errors(film_of(noisy(0.0, 0.0))) == 0).all()

    def test_the_brightness_of_the_scene_does_not_matter(self):
        samples = noisy(1.0, 0.3)
        np.testing.assert_allclose(tile_errors(film_of(samples * 1e4)), tile_errors(film_of(samples)), rtol=1e-5)
        np.testing.assert_allclose(tile_errors(film_of(samples * 1e-4)), tile_errors(film_of(samples)), rtol=1e-5)

    def test_dark_tiles_are_measured_by_the_picture(self):
        dark = in_tile(2, 3, 1e-6, other=1.0)
        errors = tile_errors(film_of(noisy(dark, in_tile(0, 0, 1.0) + in_tile(2, 3, 1e-6))))
        assert 0 < errors[2, 3] < 1e-4 * errors[0, 0]

    def test_a_lamp_does_not_make_everything_else_dark(self):
        samples = noisy(1.0, 0.3, size=(80, 80))
        with_lamp = samples + in_tile(0, 4, 1e5, size=(80, 80))
        far = np.s_[2:, :3]
        np.testing.assert_allclose(tile_errors(film_of(with_lamp))[far], tile_errors(film_of(samples))[far], rtol=1e-3)

    def test_a_noisy_tile_keeps_its_neighbours_going(self):
        errors = tile_errors(film_of(noisy(1.0, in_tile(1, 1, 1.0))))
        assert errors[1, 1] == errors.max()
        # Of a tent, in squares: an eighth beside it, a sixteenth at its corners.
        np.testing.assert_allclose(errors[1, 2] / errors[1, 1], np.sqrt(1 / 8), rtol=1e-3)
        np.testing.assert_allclose(errors[2, 2] / errors[1, 1], np.sqrt(1 / 16), rtol=1e-3)
        assert (errors[:, 3] == 0).all()

    def test_negative_values_count_by_their_size(self):
        np.testing.assert_allclose(tile_errors(film_of(noisy(-1.0, 0.3))), tile_errors(film_of(-noisy(-1.0, 0.3))))

    def test_the_worst_one(self):
        film = film_of(noisy(1.0, in_tile(1, 1, 1.0)))
        assert worst_error(film) == tile_errors(film).max()
        film.counts[0, 0] = 1
        assert worst_error(film) is None
        assert worst_error(Film(4, 4)) is None


class TestGoals:
    def test_stops(self):
        stops = [next_goal(0)]
        while stops[-1] < 1000:
            stops.append(next_goal(stops[-1]))
        assert stops == [32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024]
        assert [next_goal(goal) for goal in (8, 31, 33, 50, 100)] == [32, 32, 48, 64, 128]

    def test_a_new_film(self):
        film = Film(40, 20, adaptive=True)
        begin_goals(film, 1000)
        assert (film.goals == 32).all()
        begin_goals(film, 8)
        assert (film.goals == 8).all()

    def test_tiles_that_are_not_good_enough_go_on(self):
        film = Film(48, 16, adaptive=True)
        film.goals[...] = 64
        assert raise_goals(film, np.array([[0.2, 0.1, 0.05]]), 0.1, 1000)
        assert film.goals.tolist() == [[96, 96, 64]]

    def test_those_with_the_fewest_samples_go_first(self):
        film = Film(48, 16, adaptive=True)
        film.goals[...] = [[128, 32, 64]]
        assert raise_goals(film, np.array([[0.2, 0.01, 0.2]]), 0.1, 1000)
        assert film.goals.tolist() == [[128, 32, 96]]

    def test_no_goal_is_above_the_limit(self):
        film = Film(32, 16, adaptive=True)
        film.goals[...] = 64
        assert raise_goals(film, np.array([[0.2, 0.01]]), 0.1, 70)
        assert film.goals.tolist() == [[70, 64]]
        assert not raise_goals(film, np.array([[0.2, 0.01]]), 0.1, 70)

    def test_it_ends_when_all_are_good_enough(self):
        film = Film(32, 16, adaptive=True)
        film.goals[...] = 64
        assert not raise_goals(film, np.array([[0.09, 0.01]]), 0.1, 1000)
        assert (film.goals == 64).all()

    def test_needed_samples(self):
        film = Film(32, 16, adaptive=True)
        film.goals[...] = 64
        assert needed_samples(film, np.array([[0.2, 0.01]]), 0.1, 1000) == (256 + 64) / 2
        assert needed_samples(film, np.array([[0.2, 0.01]]), 0.1, 100) == (100 + 64) / 2


class TestFilm:
    def test_goals_of_pixels(self):
        film = Film(20, 17, adaptive=True)
        film.goals[...] = [[64, 32], [48, 96]]
        goals = goals_of(film.arrays, 50)
        assert goals.shape == (17, 20)
        assert (goals[:16, :16] == 50).all()
        assert (goals[:16, 16:] == 32).all()
        assert (goals[16:, :16] == 48).all()
        assert (goals_of(Film(20, 17).arrays, 50) == 50).all()

    def test_fewest_samples_of_those_that_lack_some(self):
        film = Film(20, 17, adaptive=True)
        film.goals[...] = [[64, 32], [48, 96]]
        film.counts[...] = goals_of(film.arrays, 1000)
        assert film.fewest(1000) is None
        film.counts[0, 0], film.counts[16, 19] = 50, 90
        assert film.fewest(1000) == 50
        assert film.fewest(40) is None

    def test_squares_add_up(self):
        samples = noisy(1.0, 0.4, 60)
        film, whole = film_of(samples[:20]), film_of(samples)
        film.add(film_of(samples[20:]))
        np.testing.assert_allclose(film.squares, whole.squares, rtol=1e-6)
        np.testing.assert_allclose(tile_errors(film), tile_errors(whole), rtol=1e-4)
        assert (film.goals == 60).all()

    def test_squares_of_a_part_are_dropped(self):
        film, plain = film_of(noisy(1.0, 0.4, size=(8, 8))), Film(8, 8)
        plain.counts[...] = 3
        film.add(plain)
        assert (film.counts == 67).all()
        assert not film.is_adaptive
        assert not film.goals.size

    def test_level_brings_tiles_to_their_goals(self):
        film = Film(40, 20, adaptive=True)
        film.goals[...] = [[32, 48, 32], [32, 48, 48]]
        film.counts[...] = 32
        film.counts[2:5, 18:22] = 40
        film.total[...] = film.counts[..., None]
        film.squares[...] = film.counts
        done = []

        def render(missing, last):
            first = int(missing.counts.min())
            done.append((first, last))
            missing.total += np.float32(last - first)
            missing.squares += np.float32(last - first)
            missing.counts[...] = last

        level(film, render)
        assert done == [(32, 40)]
        np.testing.assert_array_equal(film.counts, goals_of(film.arrays, 40))
        np.testing.assert_array_equal(film.total[..., 1], film.counts)
        np.testing.assert_array_equal(film.squares, film.counts)
        assert film.goals.tolist() == [[32, 48, 32], [32, 48, 48]]
