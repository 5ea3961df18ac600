"""The film: sums that keep their digits, levelling, and memory that is not there."""

import numpy as np
import pytest

from lumipath.errors import UsageError
from lumipath.rendering import memory
from lumipath.rendering.film import BYTES_PER_PIXEL, Film, level


def film_of(value, count, width=3, height=200):
    """A film of equal samples, split as the two-sum splits them."""
    film = Film(width, height)
    film.total[...] = np.float64(value) * count
    film.lost[...] = np.float64(value) * count - film.total
    film.counts[...] = count
    return film


class TestManySamples:
    @pytest.mark.parametrize("count", [(1 << 24) - 1, (1 << 24) + 1, (1 << 31) + 12345])
    def test_the_mean_is_right(self, count):
        np.testing.assert_allclose(film_of(0.1, count).mean(), 0.1, rtol=1e-7)

    def test_every_added_sample_counts(self):
        film, one = film_of(0.1, 1 << 24), film_of(0.1, 1)
        for _ in range(50):
            film.add(one)
        assert (film.counts == (1 << 24) + 50).all()
        exact = np.float64(0.1) * ((1 << 24) + 50)
        np.testing.assert_allclose(film.total.astype(np.float64) + film.lost, exact, rtol=1e-9)
        # Which float32 sums alone could not tell from those without them.
        assert (film.mean() == np.float32(0.1)).all()

    def test_more_than_can_be_counted_is_refused(self):
        film = film_of(0.1, (1 << 32) - 5)
        with pytest.raises(ValueError, match="more than 4294967295 samples"):
            film.add(film_of(0.1, 5))
        film.add(film_of(0.1, 4))
        assert film.counts.max() == (1 << 32) - 1

    def test_no_samples_are_black(self):
        assert (Film(3, 4).mean() == 0).all()


class TestLevel:
    def test_every_pixel_gets_what_it_lacks(self):
        film = Film(4, 3)
        film.counts[...] = [[5, 5, 9, 9], [2, 9, 9, 9], [5, 5, 5, 2]]
        film.total[...] = film.counts[..., None]
        asked = []

        def render(missing, last):
            (first,) = np.unique(missing.counts)
            asked.append((int(first), last))
            missing.total += np.float32(last - first)
            missing.counts[...] = last
            missing.rejected += 1

        level(film, render)
        assert asked == [(2, 5), (5, 9)]
        assert (film.counts == 9).all()
        assert (film.total == 9).all()
        assert film.rejected == 2

    def test_a_level_film_needs_nothing(self):
        level(film_of(0.5, 7), lambda *_: pytest.fail("nothing is missing"))


class TestMemory:
    def test_a_film_that_does_not_fit_is_refused_with_its_bytes(self, monkeypatch):
        monkeypatch.setattr(memory, "available_memory", lambda: 10_000_000)
        with pytest.raises(UsageError) as caught:
            Film(1000, 1000)
        assert str(caught.value).startswith(
            "1000 x 1000 pixels need 40000000 bytes for film and image, and 10000000 are available"
        )
        assert Film(500, 500).width == 500

    def test_bytes_of_a_pixel(self):
        film = Film(10, 10)
        assert sum(array.nbytes for array in film.arrays) + film.mean().nbytes == 100 * BYTES_PER_PIXEL

    def test_bytes_of_a_pixel_of_an_adaptive_film(self, monkeypatch):
        sizes = {adaptive: sum(array.nbytes for array in Film(160, 160, adaptive).arrays) for adaptive in (False, True)}
        # A goal for each tile besides.
        assert sizes[True] == sizes[False] + 160 * 160 * 4 + 10 * 10 * 4
        monkeypatch.setattr(memory, "available_memory", lambda: 10_000)
        with pytest.raises(UsageError, match=f"need {160 * 160 * (BYTES_PER_PIXEL + 4)} bytes"):
            Film(160, 160, adaptive=True)

    def test_unknown_memory_refuses_nothing(self, monkeypatch):
        monkeypatch.setattr(memory, "available_memory", lambda: None)
        assert Film(4, 4).height == 4

    def test_this_machine_has_some(self):
        assert memory.available_memory() is None or memory.available_memory() > 1 << 20

    def test_free_memory_and_swap(self, tmp_path, monkeypatch):
        (tmp_path / "meminfo").write_text("MemTotal: 900 kB\nMemAvailable:     100 kB\nSwapFree: 20 kB\n")
        monkeypatch.setattr(memory, "_MEMINFO", tmp_path / "meminfo")
        monkeypatch.setattr(memory, "_LIMITS", (tmp_path / "none",))
        assert memory.available_memory() == 120 * 1024
        (tmp_path / "limit").write_text("65536\n")
        (tmp_path / "unlimited").write_text("max\n")
        monkeypatch.setattr(memory, "_LIMITS", (tmp_path / "unlimited", tmp_path / "limit"))
        assert memory.available_memory() == 65536
