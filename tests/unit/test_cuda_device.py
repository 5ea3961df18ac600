"""How the samples of a render are shared among GPUs, without one: stand-ins take the place of their schedulers."""

import signal

import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

from lumipath.devices import open_device
from lumipath.devices.cuda import device as module
from lumipath.devices.cuda.device import CudaDevice, joint_name, slice_samples
from lumipath.devices.cuda.work import item_count
from lumipath.devices.device import goals_of
from lumipath.errors import DeviceError, UsageError
from lumipath.pack.scene import pack_view
from lumipath.rendering.film import Film
from lumipath.scene import Camera
from lumipath.settings import RenderSettings

GPUS = 2


class Gpu:
    name = "none"

    def __init__(self, index):
        self.index = index

    def open(self):
        pass

    def synchronize(self):
        pass


class HostArray(np.ndarray):
    """An array that is copied like one on a GPU."""

    def download(self, target):
        target[...] = self

    def upload(self, source):
        self[...] = source

    @staticmethod
    def zeros(shape, dtype):
        return np.zeros(shape, dtype).view(HostArray)

    @staticmethod
    def of(array):
        return array.copy().view(HostArray)


class Scheduler:
    """Counts launches; each sample adds 1."""

    def __init__(self, during=lambda: None):
        self.launches = []
        self.during = during

    def run(self, scene, view, film, first, last):
        self.launches.append((first, last))
        self.during()
        film.total[...] += last - first
        if film.goals.size:
            # As the kernels do: tiles whose goal is reached take no part.
            film.total[goals_of(film, 1 << 30) <= first] -= last - first
            film.squares[...] = film.total[..., 0]
        return 0


@pytest.fixture
def device(monkeypatch):
    monkeypatch.setattr(module, "Gpu", Gpu)
    monkeypatch.setattr(module, "device_count", lambda: GPUS)
    monkeypatch.setattr(module, "DeviceArray", HostArray)
    monkeypatch.setattr(module, "to_device", to_host)
    made = CudaDevice(None)
    schedule(made, Scheduler())
    return made


def to_host(value):
    if isinstance(value, np.ndarray):
        return HostArray.of(value)
    return type(value)(*(to_host(item) for item in value)) if isinstance(value, tuple) else value


def schedule(device, scheduler):
    for worker in device._workers:
        worker._scheduler = scheduler


def render(device, film, last, **settings):
    view = pack_view(Camera(), RenderSettings(width=film.width, height=film.height, **settings))
    return device.render(None, view, film.arrays, last)


def launches(device):
    return sorted(device._workers[0]._scheduler.launches)


def test_all_gpus_together_render_every_sample_once(device):
    film = Film(4, 3)
    list(render(device, film, 100, first_sample=1000))
    assert [sample for first, last in launches(device) for sample in range(first, last)] == list(range(1000, 1100))
    device.download(film.arrays)
    assert (film.counts == 100).all()
    assert (film.total == 100).all()
    assert sum(worker.has_sums for worker in device._workers) == 2 * GPUS


def test_a_later_pass_adds_to_the_sums_of_the_film(device):
    film = Film(4, 3)
    film.total[...] = 7
    film.counts[...] = 7
    list(render(device, film, 9))
    assert launches(device) == [(7, 8), (8, 9)]
    device.download(film.arrays)
    assert (film.total == 9).all()
    list(render(device, film, 12))
    device.download(film.arrays)
    assert (film.total == 12).all()


def test_tiles_that_have_reached_their_goal_stay_as_they_are(device):
    film = Film(40, 20, adaptive=True)
    film.goals[...] = [[64, 32, 64], [32, 32, 64]]
    list(render(device, film, 20))
    assert (film.counts == 20).all()
    list(render(device, film, 32))
    assert (film.counts == 32).all()
    list(render(device, film, 50))
    np.testing.assert_array_equal(film.counts[::16, ::16], [[50, 32, 50], [32, 32, 50]])
    # A tile that goes on later, while others are ahead.
    film.goals[1, 0] = 48
    list(render(device, film, 1 << 30))
    device.download(film.arrays)
    np.testing.assert_array_equal(film.counts, goals_of(film.arrays, 1 << 30))
    np.testing.assert_array_equal(film.total[..., 0], film.counts)
    np.testing.assert_array_equal(film.squares, film.counts)
    list(render(device, film, 1 << 30))
    assert (film.counts.max(), film.counts.min()) == (64, 32)


def test_goals_of_all_kinds_in_one_pass(device):
    film = Film(40, 20, adaptive=True)
    film.goals[...] = [[64, 33, 64], [7, 48, 1]]
    list(render(device, film, 1 << 30))
    device.download(film.arrays)
    np.testing.assert_array_equal(film.counts, goals_of(film.arrays, 1 << 30))
    np.testing.assert_array_equal(film.total[..., 0], film.counts)
    np.testing.assert_array_equal(film.squares, film.counts)


def test_a_film_without_any_pass_stays_as_it_is(device):
    film = Film(4, 3)
    film.total[...] = 7
    device.download(film.arrays)
    assert (film.total == 7).all()


def test_a_cancelled_pass_ends_after_its_slices(device):
    film = Film(4, 3)
    work = render(device, film, 1 << 30)
    next(work)
    device.cancel()
    assert sum(work) == 0
    done = int(film.counts[0, 0])
    assert 0 < done < 1 << 30
    # The next pass is not cancelled.
    list(render(device, film, done + 1))
    device.download(film.arrays)
    assert (film.counts == done + 1).all()
    assert (film.total == done + 1).all()


def test_an_iterator_that_is_closed_leaves_true_counts(device):
    film = Film(4, 3)
    work = render(device, film, 1 << 30)
    next(work)
    work.close()
    device.download(film.arrays)
    np.testing.assert_array_equal(film.total[:, :, 0], film.counts)
    assert film.counts[0, 0] > 0


def test_an_interrupt_in_a_launch_leaves_true_counts(device):
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        schedule(device, Scheduler(during=lambda: signal.raise_signal(signal.SIGINT)))
        film = Film(4, 3)
        with pytest.raises(KeyboardInterrupt):
            list(render(device, film, 1 << 20))
    finally:
        signal.signal(signal.SIGINT, before)
    device.download(film.arrays)
    np.testing.assert_array_equal(film.total[:, :, 0], film.counts)
    assert film.counts[0, 0] > 0


def test_an_error_on_a_gpu_reaches_the_caller(device):
    def fail():
        raise DeviceError("the GPU is on fire")

    schedule(device, Scheduler(during=fail))
    with pytest.raises(DeviceError, match="on fire"):
        list(render(device, Film(4, 3), 10))


def test_it_wants_even_counts():
    assert CudaDevice.even_counts


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
