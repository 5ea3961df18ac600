"""The light of what is infinitely far away, the environment and suns, where a path's ray has hit nothing."""

from __future__ import annotations

from ..lang import i32, kernel
from ..pack.layout import SUNS
from .environment import environment_from
from .functions import strategy_weight
from .punctual import sun_from


@kernel
def environment_light(scene, path):
    """What a path that has escaped brings of the environment."""
    seen = environment_from(scene, path.ray.d)
    return path.throughput * seen.radiance * strategy_weight(path.pdf, seen.pdf * scene.environment_probability)


@kernel
def sun_light(scene, path, light):
    """What a path that has escaped brings of a sun, which is light number `light`."""
    sun = sun_from(scene, light, path.ray.d)
    return path.throughput * sun.radiance * strategy_weight(path.pdf, sun.pdf)


@kernel(needs=SUNS, otherwise=environment_light)
def far_light(scene, path):
    """What a path that has escaped brings of the environment and of all suns."""
    light = environment_light(scene, path)
    for k in range(scene.sun_count):
        light = light + sun_light(scene, path, i32(scene.first_sun + k))
    return light
