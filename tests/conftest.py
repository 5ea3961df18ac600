"""What all tests share: the devices, and the way to the helper modules in `physics`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

# `kernel_calls`, `renders` and `judging` serve the unit tests and the golden images too.
sys.path.insert(0, str(Path(__file__).parent / "physics"))
sys.path.insert(0, str(Path(__file__).parent))

import small_memory

# Before test modules take `compile_ptx` by name.
small_memory.install()

DEVICES = ["cpu", "cuda"]


@pytest.fixture(params=DEVICES)
def device(request):
    """The name of a device; the test is skipped where this machine has none of that kind."""
    from lumipath.devices import list_devices

    if request.param not in {info.kind.split(":")[0] for info in list_devices()}:
        pytest.skip(f"this machine has no device of the kind {request.param}")
    return request.param
