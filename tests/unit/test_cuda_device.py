"""What a GPU is asked to do, without one: a stand-in takes the place of its scheduler."""

import signal
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

from lumipath.devices.cuda import device as module
from lumipath.devices.cuda.device import CudaDevice
from lumipath.pack.scene import pack_view
from lumipath.rendering.film import Film
from lumipath.scene import Camera
from lumipath.settings import RenderSettings


class Gpu:
    name = "none"

    def __init__(self, index):
        pass

    def open(self):
        pass


class Scheduler:
    """Counts launches; each sample adds 1."""

    def __init__(self, during=lambda: None):
        self.launches = []
        self.during = during

    def run(self, scene, view, film, first, last):
        self.launches.append((first, last))
        self.during()
        film.total[...] += last - first


@pytest.fixture
def device(monkeypatch):
    monkeypatch.setattr(module, "Gpu", Gpu)
    monkeypatch.setattr(module, "to_device", lambda value: value)
    made = CudaDevice()
    made._scheduler = Scheduler()
    return made


def render(device, film, last, **settings):
    view = pack_view(Camera(), RenderSettings(width=film.width, height=film.height, **settings))
    return device.render(None, view, film.arrays, last)


def test_samples_are_numbered_from_the_first(device):
    film = Film(4, 3)
    list(render(device, film, 3, first_sample=100))
    device._rate = 1e9
    list(render(device, film, 9, first_sample=100))
    launches = device._scheduler.launches
    assert launches[0][0] == 100
    assert launches[-1][1] == 109
    assert all(before[1] == after[0] for before, after in pairwise(launches))
    assert (film.counts == 9).all()
    assert (film.total == 9).all()


def test_a_cancelled_pass_ends_after_its_slice(device):
    film = Film(4, 3)
    device._rate = 0.0
    work = render(device, film, 1 << 20)
    next(work)
    device.cancel()
    assert sum(work) == 0
    assert 0 < film.counts[0, 0] < 1 << 20
    # The next pass is not cancelled.
    stop = int(film.counts[0, 0]) + 1
    list(render(device, film, stop))
    assert (film.counts == stop).all()


def test_an_interrupt_in_a_launch_leaves_true_counts(device):
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        device._scheduler = Scheduler(during=lambda: signal.raise_signal(signal.SIGINT))
        film = Film(4, 3)
        with pytest.raises(KeyboardInterrupt):
            list(render(device, film, 4))
    finally:
        signal.signal(signal.SIGINT, before)
    np.testing.assert_array_equal(film.total[:, :, 0], film.counts)
    assert film.counts[0, 0] > 0


def test_it_wants_even_counts():
    assert CudaDevice.even_counts
