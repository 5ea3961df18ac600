"""Where kernels run: upload, compile, render. The only package that names a device."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import DeviceError

if TYPE_CHECKING:
    from .device import Device, DeviceInfo


def list_devices() -> list[DeviceInfo]:
    """Every device of this machine."""
    from .cpu import cpu_info

    return [cpu_info()]


def open_device(name: str = "auto", threads: int | None = None) -> Device:
    """The device of that name: `auto` or `cpu`.

    Raises:
        DeviceError: there is no such device.
    """
    if name not in ("auto", "cpu"):
        raise DeviceError(f"unknown device {name!r}: use auto or cpu")
    from .cpu import CpuDevice

    return CpuDevice(threads)
