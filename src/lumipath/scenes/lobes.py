"""Materials that are sums of lobes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene import Camera, Material, PointLight, Scene, Sphere, Texture
from ..scene.shapes import Shape
from ._build import UPRIGHT, floor, scale, sky, translate

_RADIUS = 0.42
_BLUE = (0.05, 0.15, 0.5)
_DIM_BLUE = (0.02, 0.06, 0.2)
_SILVER = (0.25, 0.25, 0.25)
_AMBER = (0.9, 0.4, 0.08)


def _ball(x: float, z: float, name: str, **lobes: Any) -> Sphere:
    transform = translate(x, _RADIUS, z) @ UPRIGHT @ scale(_RADIUS)
    return Sphere(transform=transform, material=Material(name=name, **lobes), name=name)


def _stripes() -> Texture:
    """Eight glowing rings around a ball, dark between them."""
    rows = np.where(np.arange(64) // 4 % 2 == 0, 1.0, 0.0)[:, None, None]
    return Texture((rows * (0.9, 0.25, 0.03)).repeat(4, axis=1).astype(np.float32), name="rings")


def _behind() -> list[Shape]:
    """One lobe each."""
    return [
        _ball(-1.1, -0.6, "matt", diffuse=_BLUE),
        _ball(0.0, -0.6, "mirror", specular=(0.9, 0.9, 0.9)),
        _ball(1.1, -0.6, "glass", transmissive=_AMBER, index=1.5),
    ]


def _before() -> list[Shape]:
    """Sums of two, three and four."""
    return [
        _ball(-1.65, 0.55, "matt and mirror", diffuse=_BLUE, specular=_SILVER),
        _ball(-0.55, 0.55, "matt and glass", diffuse=_DIM_BLUE, transmissive=_AMBER, index=1.5),
        _ball(
            0.55, 0.55, "matt, mirror and glass", diffuse=_DIM_BLUE, specular=_SILVER, transmissive=_AMBER, index=1.5
        ),
        _ball(1.65, 0.55, "all", diffuse=_DIM_BLUE, specular=_SILVER, transmissive=_AMBER, emission=_stripes()),
    ]


def many_lobes() -> Scene:
    """Seven balls: behind, a matt, a mirror and a glass one; before them, sums of these lobes.

    Look at how the front balls add up what stands behind: matt and mirror, matt and glass, all three, and all three
    with rings that glow. At each bounce one lobe is drawn in proportion to its weight.
    """
    ground = floor(10.0, material=Material(diffuse=(0.5, 0.47, 0.42), name="floor"))
    return Scene(
        shapes=[ground, *_behind(), *_before()],
        lights=[PointLight(position=(-3.0, 4.0, 3.0), colour=(15.0, 14.0, 12.5))],
        cameras=[Camera.look_at((0.0, 3.2, 5.6), (0.0, 0.25, 0.0), fov=26.0, aspect=1.6)],
        environment=sky(0.35),
        name="many-lobes",
    )
