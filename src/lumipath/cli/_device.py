"""The options that choose a device."""

from __future__ import annotations

from typing import Annotated

import typer

from ..errors import UsageError

DeviceOption = Annotated[str, typer.Option(metavar="auto|cpu|cuda|cuda:N|cuda:all", help="Where to render.")]
GpuFlag = Annotated[bool, typer.Option("-g", help="The same as --device cuda.")]


def device_from(device: str, gpu: bool) -> str:
    """The device that the two options name together.

    Raises:
        UsageError: they contradict each other.
    """
    if gpu and device == "cpu":
        raise UsageError("-g asks for the GPU and --device cpu for the CPU; give one of them")
    return "cuda" if gpu and device == "auto" else device
