"""Where kernels run: upload, compile, render, download. The only package that names a device."""

from __future__ import annotations

import re
import warnings
from typing import TYPE_CHECKING

from ..errors import DeviceError, LumipathWarning, UsageError

if TYPE_CHECKING:
    from .device import Device, DeviceInfo

CHOICES = "auto, cpu, cuda, cuda:N or cuda:all"


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
        name: `cpu`, `cuda` (the first GPU), `cuda:1`, `cuda:all` (every GPU of this machine, together), or `auto`: a
            GPU where one can be used, else the CPU.
        threads: of the CPU; all cores where None.
        kernel: of a GPU: `auto`, `megakernel` or `wavefront`.

    Raises:
        UsageError: no such name.
        DeviceError: the device cannot be used; the message says why.
    """
    match = re.fullmatch(r"auto|cpu|cuda(?::(\d{1,3}|all))?", name)
    if not match:
        raise UsageError(f"device is {name!r}: it must be {CHOICES}")
    if name == "auto":
        return _open_gpu_if_any(kernel) or _open_cpu(threads)
    if name == "cpu":
        return _open_cpu(threads)
    return _open_gpu(None if match.group(1) == "all" else int(match.group(1) or 0), kernel)


def _open_cpu(threads: int | None) -> Device:
    from .cpu import CpuDevice

    return CpuDevice(threads)


def _open_gpu(index: int | None, kernel: str) -> Device:
    from .cuda.driver import device_count, require_installed

    require_installed()
    # Numba's support takes half a second to import, which is wasted where there is no GPU.
    device_count()
    from .cuda.device import CudaDevice

    return CudaDevice(index, kernel)


def _open_gpu_if_any(kernel: str) -> Device | None:
    """The first GPU, if there is one; a warning where there is one that cannot be used."""
    from .cuda.driver import NoGpuError

    try:
        return _open_gpu(0, kernel)
    except NoGpuError:
        return None
    except DeviceError as error:
        warn_of_fallback(error)
        return None


def warn_of_fallback(error: DeviceError) -> None:
    """Say that the CPU renders although there is a GPU."""
    warnings.warn(f"rendering on the CPU: {error}", LumipathWarning, stacklevel=2)
