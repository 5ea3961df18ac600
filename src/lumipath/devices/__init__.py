"""Where kernels run: upload, compile, render, download. The only package that names a device."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from ..errors import DeviceError, UsageError

if TYPE_CHECKING:
    from .device import Device, DeviceInfo

CHOICES = "auto, cpu, cuda or cuda:N"


def list_devices() -> list[DeviceInfo]:
    """Every device of this machine, the CPU first."""
    from .cpu import cpu_info
    from .cuda.driver import is_installed

    infos = [cpu_info()]
    if is_installed():
        from .cuda.device import cuda_infos

        infos += cuda_infos()
    return infos


def open_device(name: str = "auto", threads: int | None = None, kernel: str = "auto") -> Device:
    """The device of that name.

    Args:
        name: `cpu`, `cuda` (the first GPU), `cuda:1`, or `auto`: a GPU where one can be used, else the CPU.
        threads: of the CPU; all cores where None.
        kernel: of a GPU: `auto`, `megakernel` or `wavefront`.

    Raises:
        UsageError: no such name.
        DeviceError: the device cannot be used; the message says why.
    """
    match = re.fullmatch(r"auto|cpu|cuda(?::(\d{1,3}))?", name)
    if not match:
        raise UsageError(f"device is {name!r}: it must be {CHOICES}")
    if name != "cpu":
        try:
            return _open_gpu(int(match.group(1) or 0), kernel)
        except DeviceError:
            if name != "auto":
                raise
    from .cpu import CpuDevice

    return CpuDevice(threads)


def _open_gpu(index: int, kernel: str) -> Device:
    from .cuda.driver import require_installed

    require_installed()
    from .cuda.device import CudaDevice

    return CudaDevice(index, kernel)
