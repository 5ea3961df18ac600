"""Merging checkpoints: what adds up, and what must not."""

import numpy as np
import pytest
from test_checkpoint import checkpoint_of, film_of

from lumipath.errors import CheckpointError
from lumipath.rendering.checkpoint import Checkpoint, SampleRange
from lumipath.rendering.merging import joined, merge


@pytest.fixture
def kept(tmp_path):
    """Write checkpoints of some settings; their paths."""

    def write(*settings, count=4):
        paths = []
        for number, given in enumerate(settings):
            paths.append(tmp_path / f"{number}.ckpt")
            checkpoint_of(film_of(count + number), **given).save(paths[-1])
        return paths

    return write


def test_other_seeds_add_up(kept):
    merged = merge(kept({"seed": 0}, {"seed": 5}, {"seed": 2}))
    films = [film_of(count) for count in (4, 5, 6)]
    np.testing.assert_array_equal(merged.film.counts, 15)
    expected = sum(film.total.astype(np.float64) + film.lost for film in films) / 15
    np.testing.assert_allclose(merged.film.mean(), expected, rtol=1e-6)
    assert merged.film.rejected == 9
    assert merged.seconds == 4.5
    assert merged.ranges == (SampleRange(0, 0, 4, True), SampleRange(2, 0, 6, True), SampleRange(5, 0, 5, True))
    assert "seed" not in merged.image().metadata
    with pytest.raises(CheckpointError, match="not resumed"):
        merged.require_start(0, 0, "sum")


def test_ranges_of_a_seed_become_one_and_can_go_on(kept, tmp_path):
    paths = kept({"first_sample": 0}, {"first_sample": 4}, {"first_sample": 9})
    merged = merge([paths[2], paths[0], paths[1]])
    assert merged.ranges == (SampleRange(0, 0, 15, True),)
    assert merged.image().metadata["seed"] == 0
    merged.save(tmp_path / "sum.ckpt")
    Checkpoint.load(tmp_path / "sum.ckpt").require_start(0, 0, "sum.ckpt")


def test_spp_may_differ(kept):
    assert merge(kept({"spp": 4}, {"spp": 400, "seed": 1})).film.samples == 9


def test_one_is_itself(kept):
    (path,) = kept({})
    assert merge([path]).ranges == (SampleRange(0, 0, 4, True),)


@pytest.mark.parametrize("first", [0, 3])
def test_samples_that_are_in_both_are_refused(kept, first):
    a, b = kept({}, {"first_sample": first})
    with pytest.raises(CheckpointError) as caught:
        merge([a, b])
    assert f"both hold samples {first} to 3 of seed 0, which would count twice" in str(caught.value)


def test_a_sum_remembers_what_is_in_it(kept, tmp_path):
    paths = kept({"seed": 0}, {"seed": 1}, {"seed": 2})
    merge(paths[:2]).save(tmp_path / "sum.ckpt")
    assert merge([tmp_path / "sum.ckpt", paths[2]]).film.samples == 15
    with pytest.raises(CheckpointError, match="both hold"):
        merge([tmp_path / "sum.ckpt", paths[1]])


def test_other_pictures_are_refused(kept):
    a, b = kept({}, {"max_depth": 2, "seed": 1})
    with pytest.raises(CheckpointError, match=r"1\.ckpt is of another picture than .*0\.ckpt: max_depth is 2 there"):
        merge([a, b])


def test_nothing_is_refused():
    with pytest.raises(CheckpointError, match="name at least one"):
        merge([])


def test_after_an_uneven_range_nothing_is_joined():
    # A pixel that lacks samples of the first would get those of the second again.
    uneven, next_one = SampleRange(0, 0, 8, False), SampleRange(0, 8, 16, True)
    assert joined([next_one, uneven]) == (uneven, next_one)
    assert joined([SampleRange(0, 0, 8, True), SampleRange(0, 8, 16, False)]) == (SampleRange(0, 0, 16, False),)


def test_empty_ranges_vanish():
    assert joined([SampleRange(0, 0, 0, True), SampleRange(1, 0, 4, True)]) == (SampleRange(1, 0, 4, True),)
