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


def layered(count, *names, value=0.5, width=3, height=2):
    """A film of equal samples, the k-th layer of which is k times the image; `variance` is of one outlier."""
    film = Film(width, height, layer_names=names)
    film.total[...], film.counts[...] = value * count, count
    for k in range(len(names)):
        film.parts[..., 3 * k : 3 * k + 3] = k * value * count
    return film


class TestLayers:
    def test_means(self):
        layers = layered(4, "emission", "direct").layers()
        assert [float(layers[name].mean()) for name in ("emission", "direct")] == [0, 0.5]
        assert Film(3, 2).layers() == {}

    def test_variance_is_that_of_the_mean_with_bessels_correction(self):
        samples = np.random.default_rng(3).random((5, 2, 3, 3))
        film = Film(3, 2, layer_names=("variance",))
        film.total[...], film.parts[...], film.counts[...] = samples.sum(axis=0), (samples**2).sum(axis=0), 5
        np.testing.assert_allclose(film.layers()["variance"], samples.var(axis=0, ddof=1) / 5, rtol=1e-4)

    @pytest.mark.parametrize("count", [0, 1])
    def test_fewer_than_two_samples_have_no_variance(self, count):
        film = layered(count, "variance")
        film.parts[...] = 7
        assert not film.layers()["variance"].any()

    def test_digits_past_two_to_the_24_count(self):
        film, one = layered(1 << 24, "emission", "direct", value=0.1), layered(1, "emission", "direct", value=0.1)
        before = film.parts.astype(np.float64) + film.parts_lost
        for _ in range(50):
            film.add(one)
        added = film.parts.astype(np.float64) + film.parts_lost - before
        np.testing.assert_allclose(added[..., 3:], 5, rtol=1e-6)
        assert not added[..., :3].any()

    def test_only_common_layers_survive_a_sum(self):
        film = layered(4, "emission", "direct", "variance")
        film.add(layered(2, "variance", "direct"))
        assert film.layer_names == ("direct", "variance")
        # A sum of 4 times 0.5 times 1, the number of the layer, and one of 2 times 0.5 times 1.
        np.testing.assert_array_equal(film.parts[..., :3], 3)
        np.testing.assert_array_equal(film.parts[..., 3:], 2 * 0.5 * 4)

    def test_levelling_adds_layers_where_samples_are_missing(self):
        film = layered(4, "direct", "emission")
        film.counts[0, 0] = 2

        def render(missing, last):
            assert missing.layer_names == film.layer_names
            missing.parts[...] = last - missing.counts[..., None]
            missing.counts[...] = last

        level(film, render)
        assert film.parts[0, 0].tolist() == [2, 2, 2, 4, 4, 4]
        assert film.parts[1, 1].tolist() == [0, 0, 0, 2, 2, 2]

    def test_their_memory_is_asked_for(self, monkeypatch):
        monkeypatch.setattr(memory, "available_memory", lambda: 10_000)
        with pytest.raises(UsageError, match=f"need {100 * 100 * (BYTES_PER_PIXEL + 2 * 36)} bytes"):
            Film(100, 100, layer_names=("direct", "variance"))


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
