"""Renders of one scene with several seeds, so that their scatter tells the noise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lumipath.lang import aligned, f32
from lumipath.pack import layout
from lumipath.pack.layout import PackedScene
from lumipath.rendering.session import Session
from lumipath.scene import Scene

Renders = NDArray[np.float64]
"""(R, H, W, 3): independent renders of the same scene."""


def renders(
    scene: Scene,
    *,
    seeds: int = 16,
    first_seed: int = 0,
    change: Callable[[PackedScene], PackedScene] | None = None,
    **settings: Any,
) -> Renders:
    """(seeds, H, W, 3): the scene once for each seed; `change` may alter the packed scene before."""
    settings.setdefault("rr_depth", None)
    session = Session(scene, **settings)
    if change:
        session._packed = change(session._packed)
        # The features may be others: a GPU has one kernel for all calls until it is told.
        session.device.compile(session._packed, session._view, session.film.arrays)
    images = []
    for seed in range(first_seed, first_seed + seeds):
        session.restart(seed)
        images.append(np.asarray(session.run(), np.float64))
        assert session.film.rejected == 0, f"{session.film.rejected} samples of {scene.name} are not finite"
    return np.stack(images)


def without_light_sampling(packed: PackedScene) -> PackedScene:
    """The scene with lights that are found only by rays that happen to hit them, each with its full weight.

    Lights without a surface, which no ray can hit, go on.
    """
    lights = packed.lights.copy()
    kinds = lights.view(np.int32)[:, 3]
    # A light that is drawn with the density 0 gives no sample.
    lights[kinds == layout.TRIANGLE_LIGHT, 7] = 0
    lights[kinds == layout.QUADRIC_LIGHT, 19] = 0
    lights[kinds == layout.SUN_LIGHT, 12] = 0
    return packed._replace(
        lights=aligned(lights),
        emitter_density=aligned(packed.emitter_density * f32(0)),
        environment_probability=f32(0),
    )
