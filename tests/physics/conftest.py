"""Renders on the CPU that are left in the middle of a pass, on slow machines and on fast ones."""

from __future__ import annotations

import numpy as np
import pytest

from lumipath.devices import cpu
from lumipath.devices.cpu_batch import CANCELLED, NEXT_TILE, REJECTED
from lumipath.pack.layout import TILE

_SHARES = 5


@pytest.fixture
def eager(monkeypatch):
    """Passes that report all the time: after the last tiles, a few at once, then while threads render the others.

    Whoever leaves the loop at one of the first reports leaves some tiles without the samples of others.
    """
    monkeypatch.setattr(cpu, "_LOOK_SECONDS", 0.0005)
    render = cpu.CpuDevice.render

    def in_parts(device, scene, view, film, last):
        tiles = -(-view.film_width // TILE) * -(-view.film_height // TILE)
        step = max(1, tiles // _SHARES)
        for first in range(tiles - step, (tiles - 1) // 2, -step):
            device._control = control = np.zeros(4, np.int64)
            control[NEXT_TILE] = first
            before = film.counts.copy()
            cpu.renderer_of(scene)(scene, view, film, device._batches[0], control, last)
            if (film.counts != before).any():
                yield int(control[REJECTED])
            if control[CANCELLED]:
                return
        yield from render(device, scene, view, film, last)

    monkeypatch.setattr(cpu.CpuDevice, "render", in_parts)
