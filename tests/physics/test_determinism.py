"""The same samples give the same bits, however they are divided."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from judging import ALPHA, p_value
from renders import renders

from lumipath.rendering.film import Film
from lumipath.rendering.session import Session
from lumipath.scenes import builtin

# More than one tile, and tiles cut off at the edges.
SIZE = {"width": 41, "height": 37, "max_depth": 5, "rr_depth": None}


@pytest.fixture
def device():
    """The CPU: a GPU sums each launch in float32, so its last bits depend on the launches."""
    return "cpu"


def film_of(session, *stops, packed=None, first=0):
    """A new film after passes that end at the given numbers of samples, the first of which is `first`."""
    film = Film(session.width, session.height)
    film.counts[...] = first
    session.device.clear()
    for stop in stops:
        for rejected in session.device.render(packed or session._packed, session._view, film.arrays, stop):
            assert rejected == 0
    session.device.download(film.arrays)
    return film


def normal(images):
    """(R, H, W): the noise of renders, scaled to the variance 1 in every pixel."""
    grey = images.mean(axis=-1)
    return (grey - grey.mean(axis=0)) / (grey.std(axis=0) + 1e-12)


def bits(film):
    return film.total.tobytes() + film.lost.tobytes() + film.counts.tobytes()


@pytest.fixture(scope="module")
def scene():
    return builtin("cornell-box")


@pytest.mark.parametrize("threads", [1, 3, 5])
def test_the_number_of_threads_does_not_change_a_bit(device, scene, threads):
    two = film_of(Session(scene, device=device, threads=2, **SIZE), 6)
    assert bits(film_of(Session(scene, device=device, threads=threads, **SIZE), 6)) == bits(two)


def test_which_thread_takes_which_tile_does_not_change_a_bit(device, scene):
    session = Session(scene, device=device, threads=4, **SIZE)
    assert len({bits(film_of(session, 6)) for _ in range(6)}) == 1


@pytest.mark.parametrize("stops", [(1, 2, 3, 4, 5, 6, 7, 40), (17, 40), (39, 40), (3, 20, 21, 40)])
def test_the_partition_into_passes_does_not_change_a_bit(device, scene, stops):
    session = Session(scene, device=device, threads=2, **SIZE)
    assert bits(film_of(session, *stops)) == bits(film_of(session, 40))


@pytest.mark.parametrize("crop", [(0, 0, 41, 37), (5, 7, 39, 36), (16, 16, 32, 32), (40, 36, 41, 37), (0, 20, 41, 21)])
def test_a_crop_equals_that_part_of_the_whole_image_to_the_bit(device, scene, crop):
    whole = film_of(Session(scene, device=device, threads=2, **SIZE), 9)
    part = film_of(Session(scene, device=device, threads=2, crop=crop, **SIZE), 9)
    left, top, right, bottom = crop
    np.testing.assert_array_equal(part.total, whole.total[top:bottom, left:right])
    np.testing.assert_array_equal(part.lost, whole.lost[top:bottom, left:right])


def test_a_pickled_scene_renders_the_same_bits(device, scene):
    session = Session(scene, device=device, threads=2, **SIZE)
    copy = pickle.loads(pickle.dumps(session._packed))
    assert bits(film_of(session, 5, packed=copy)) == bits(film_of(session, 5))


def test_packing_a_scene_twice_gives_the_same_bits(device):
    first, second = (Session(builtin("cornell-box"), device=device, threads=2, **SIZE) for _ in range(2))
    for a, b in zip(first._packed, second._packed):
        assert pickle.dumps(a) == pickle.dumps(b)


def test_films_of_two_ranges_add_up_to_the_film_of_both(device, scene):
    session = Session(scene, device=device, threads=2, **SIZE)
    first, both, rest = film_of(session, 10), film_of(session, 30), film_of(session, 30, first=10)
    rest.counts -= np.uint32(10)
    first.add(rest)
    np.testing.assert_array_equal(first.counts, both.counts)
    np.testing.assert_allclose(first.mean(), both.mean(), rtol=2e-7, atol=1e-9)


def test_going_on_from_uneven_counts_does_not_change_a_bit(device, scene):
    session = Session(scene, device=device, threads=2, **SIZE)
    # What an interruption leaves: some tiles have the samples of the pass, the others do not.
    film, later = film_of(session, 3), film_of(session, 20)
    for rows, columns in ((slice(0, 16), slice(0, 16)), (slice(16, 32), slice(32, 41)), (slice(32, 37), slice(16, 32))):
        for array, other in zip(film.arrays, later.arrays):
            array[rows, columns] = other[rows, columns]
    for _ in session.device.render(session._packed, session._view, film.arrays, 40):
        pass
    assert bits(film) == bits(film_of(session, 40))


def test_the_first_sample_is_where_the_random_numbers_begin(device, scene):
    late = film_of(Session(scene, device=device, threads=2, first_sample=10, **SIZE), 20)
    session = Session(scene, device=device, threads=2, **SIZE)
    same = film_of(session, 30, first=10)
    assert late.total.tobytes() + late.lost.tobytes() == same.total.tobytes() + same.lost.tobytes()
    early, both = film_of(session, 10), film_of(session, 30)
    early.add(late)
    np.testing.assert_array_equal(early.counts, both.counts)
    np.testing.assert_allclose(early.mean(), both.mean(), rtol=2e-7, atol=1e-9)


def test_another_seed_changes_the_noise_and_nothing_else(device, scene):
    settings = {"width": 32, "spp": 32, "max_depth": 5, "device": device}
    a, b = renders(scene, seeds=12, **settings), renders(scene, seeds=12, first_seed=12, **settings)
    assert p_value(a, b) > ALPHA
    lit = a.mean(axis=(0, 3)) > 0.01
    assert ((a[:, lit] != b[:, lit]).any(axis=-1)).mean() > 0.95
    # Noise of different seeds is independent.
    x, y = (normal(v)[:, lit] for v in (a, b))
    assert abs((x * y).mean()) < 5 / np.sqrt(x.size)


def test_noise_of_neighbouring_pixels_is_independent(device, scene):
    noise = normal(renders(scene, width=32, spp=16, seeds=24, max_depth=3, device=device))
    for a, b in ((noise[:, :, 1:], noise[:, :, :-1]), (noise[:, 1:], noise[:, :-1])):
        lit = (np.abs(a) > 0) & (np.abs(b) > 0)
        assert abs((a * b)[lit].mean()) < 5 / np.sqrt(lit.sum())
