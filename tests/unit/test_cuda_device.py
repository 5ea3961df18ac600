"""How the samples of a render are shared among GPUs; needs none."""

import pytest

from lumipath.devices import open_device
from lumipath.devices.cuda.device import joint_name, slice_samples
from lumipath.devices.cuda.work import item_count
from lumipath.errors import DeviceError, UsageError


def test_the_first_slice_is_one_sample():
    assert slice_samples(0.0, 1000, 2) == 1


def test_slices_take_some_50_ms():
    assert slice_samples(1000.0, 10**6, 2) == 50


@pytest.mark.parametrize("workers", [1, 2, 16])
def test_slices_become_shorter_towards_the_end_and_cover_all_samples(workers):
    left, slices = 1000, []
    while left:
        slices.append(slice_samples(1e9, left, workers))
        left -= slices[-1]
    assert sum(slices) == 1000
    assert slices == sorted(slices, reverse=True)
    assert slices[-1] == 1


def test_equal_gpus_are_counted():
    assert joint_name(["H200"]) == "H200"
    assert joint_name(["H200", "H200", "A100"]) == "2 x H200, A100"


@pytest.mark.parametrize(("size", "items"), [((8, 4), 32), ((9, 4), 64), ((1, 1), 32), ((16, 5), 128)])
def test_tiles_cover_the_film(size, items):
    assert item_count(*size) == items


@pytest.mark.parametrize("name", ["cuda:", "cuda:x", "gpu", "cuda:all:1", ""])
def test_a_wrong_name_is_a_usage_error(name):
    with pytest.raises(UsageError, match="cuda:all"):
        open_device(name)


def test_a_gpu_that_is_not_there_is_an_error_that_names_those_that_are():
    with pytest.raises(DeviceError):
        open_device("cuda:999")
