"""How much memory the wavefront takes where a GPU has little left; a stand-in takes the place of its arrays."""

import pytest

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

import numpy as np

from lumipath.devices.cuda import schedulers
from lumipath.devices.cuda.driver import OutOfMemoryError
from lumipath.devices.cuda.schedulers import Wavefront

SLOT_BYTES = 136


class Memory:
    """A GPU's memory: arrays take their share of it, and give it back with the last reference."""

    def __init__(self, free):
        self.free = free

    def array(self, shape, dtype):
        return Array(self, shape[0], np.dtype(dtype).itemsize)


class Array:
    def __init__(self, memory, count, size):
        self.shape, self._memory, self._bytes = (count,), memory, 0
        if count * size > memory.free:
            raise OutOfMemoryError("no room")
        self._bytes = count * size
        memory.free -= self._bytes

    def __del__(self):
        self._memory.free += self._bytes


@pytest.fixture
def wavefront(monkeypatch):
    """Makes the part of a wavefront that keeps slots, on a GPU with so many bytes."""

    def make(free):
        monkeypatch.setattr(schedulers, "DeviceArray", Memory(free).array)
        made = Wavefront.__new__(Wavefront)
        made._state = made._queue = None
        made._most_slots = schedulers._SLOTS
        return made

    return make


def slots(wavefront, items, samples):
    state, queue = wavefront._room_for(items, samples)
    assert state.shape[0] * 4 + queue.shape[0] * 4 == queue.shape[0] // 2 * SLOT_BYTES
    return queue.shape[0] // 2


def test_there_are_slots_for_each_sample_up_to_what_fills_a_gpu(wavefront):
    made = wavefront(1 << 30)
    assert slots(made, 1024, 3) == 3072
    assert slots(made, 1024, 10**6) == 1 << 22
    # What is there is used for smaller films, too.
    assert slots(made, 32, 1) == 1 << 22


def test_a_film_of_more_pixels_is_rendered_in_parts(wavefront):
    assert slots(wavefront(1 << 30), 1 << 24, 8) == 1 << 22


@pytest.mark.parametrize(("free", "fit"), [(300 << 20, 1 << 21), (200 << 20, 1 << 20), (10 << 20, 1 << 16)])
def test_where_memory_is_short_there_are_half_as_many_slots_until_they_fit(wavefront, free, fit):
    made = wavefront(free)
    assert slots(made, 4096, 1 << 20) == fit
    assert slots(made, 1 << 22, 1) == fit


def test_a_gpu_that_is_full_is_an_error(wavefront):
    made = wavefront(1 << 20)
    with pytest.raises(OutOfMemoryError, match="no room"):
        made._room_for(4096, 100)
    assert made._state is None
