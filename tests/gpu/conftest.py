"""Tests that need a GPU skip themselves where there is none."""

import pytest


@pytest.fixture(scope="session")
def gpu():
    """The name of the first GPU."""
    from lumipath.devices import list_devices

    if not any(info.kind == "cuda:0" for info in list_devices()):
        pytest.skip("this machine has no GPU that lumipath can use")
    return "cuda:0"
