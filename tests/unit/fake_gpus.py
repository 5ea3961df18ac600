"""GPUs that are not there: their memory is the host's, and nothing runs on them."""

from __future__ import annotations

import numpy as np

from lumipath.devices.cuda import device as module
from lumipath.devices.cuda.device import CudaDevice

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

    def download(self, target, first=0):
        target[...] = self[first : first + len(target)]

    def __new__(cls, shape, dtype):
        return np.empty(shape, dtype).view(cls)

    @staticmethod
    def zeros(shape, dtype):
        return np.zeros(shape, dtype).view(HostArray)

    def upload(self, source):
        self[: len(source)] = source

    @staticmethod
    def of(array):
        return array.copy().view(HostArray)


def to_host(value):
    if isinstance(value, np.ndarray):
        return HostArray.of(value)
    return type(value)(*(to_host(item) for item in value)) if isinstance(value, tuple) else value


def device_of(monkeypatch):
    """A device of all such GPUs."""
    monkeypatch.setattr(module, "Gpu", Gpu)
    monkeypatch.setattr(module, "device_count", lambda: GPUS)
    monkeypatch.setattr(module, "DeviceArray", HostArray)
    monkeypatch.setattr(module, "to_device", to_host)
    return CudaDevice(None)
