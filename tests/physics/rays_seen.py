"""The radiance of single rays under Whitted ray tracing."""

from __future__ import annotations

import numpy as np
import pytest
from parts import hidden, quad

from lumipath.rendering.session import Session
from lumipath.scene import Camera, DirectionalLight, Material, PointLight, Scene

# So faint that they change nothing: all scenes share their kernels.
FAINT = [PointLight(position=(0, 50, 0), colour=1e-20), DirectionalLight(colour=1e-20)]
NO_ATTENUATION = (1.0, 0.0, 0.0)


def image_of(scene, device, **settings):
    """(H, W, 3): the picture of the integrator whitted."""
    return np.asarray(Session(scene, device=device, integrator="whitted", **settings).run(), np.float64)


def seen(device, shapes, lights=(), *, start=(0, 0, 4), towards=(0, 0, 0), environment=None, **settings):
    """(3,): radiance along the ray from `start` to `towards`."""
    camera = Camera.look_at(start, towards, up=(0.1, 1, 0.2), fov=0.002)
    scene = Scene(
        shapes=[*shapes, *hidden("quadric", "glass", "mirror", "one-sided", "lamp")],
        lights=[*lights, *FAINT],
        cameras=[camera],
        environment=environment,
    )
    return image_of(scene, device, width=1, spp=4, **settings)[0, 0]


def about(*values):
    return pytest.approx(values if len(values) == 3 else values * 3, rel=1e-3, abs=1e-6)


def lamp(radiance, *corners):
    """A black wall that emits."""
    return quad(*corners, material=Material(emission=radiance))


def wall(radiance, z):
    """A large wall across the z axis that emits."""
    return lamp(radiance, (-50, -50, z), (50, -50, z), (50, 50, z), (-50, 50, z))
