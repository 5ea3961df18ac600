"""Lights that are not surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from ..errors import SceneError
from .values import Floats, affine, colour, float_array, group_name


def unit_vector(value: Any, name: str) -> tuple[float, float, float]:
    """Three numbers scaled to length 1.

    Raises:
        SceneError: not three finite numbers, or all 0.
    """
    vector = float_array(value, (3,), name).astype(np.float64)
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise SceneError(f"{name} is (0, 0, 0): it must point somewhere")
    x, y, z = vector / length
    return (float(x), float(y), float(z))


def _point(value: Any, name: str) -> tuple[float, float, float]:
    x, y, z = float_array(value, (3,), name).tolist()
    return (x, y, z)


@frozen(eq=False, kw_only=True)
class PointLight:
    """A point that gives a white diffuse surface facing it the radiance colour * min(1, 1 / (a + b d + c d^2)).

    Args:
        position: metres.
        colour: linear Rec.709; the irradiance is pi times as much.
        attenuation: a, b (1/m) and c (1/m^2), each 0 or more, not all 0.
        group: name of the light group that it belongs to, for the layers of `light_groups`.
    """

    position: tuple[float, float, float] = field(converter=lambda v: _point(v, "point light: position"))
    colour: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "point light: colour")
    )
    attenuation: tuple[float, float, float] = field(
        default=(0.0, 0.0, 1.0), converter=lambda v: colour(v, "point light: attenuation")
    )
    group: str = field(default="", converter=lambda v: group_name(v, "point light: group"))

    def __attrs_post_init__(self) -> None:
        if max(self.attenuation) == 0:
            raise SceneError("point light: all three attenuation coefficients are 0; give at least one of them")


@frozen(eq=False, kw_only=True)
class DirectionalLight:
    """Parallel light along `direction` that gives a white diffuse surface facing it the radiance `colour`.

    Its `group` is as for `PointLight`.
    """

    direction: tuple[float, float, float] = field(
        default=(0.0, 0.0, -1.0), converter=lambda v: unit_vector(v, "directional light: direction")
    )
    colour: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "directional light: colour")
    )
    group: str = field(default="", converter=lambda v: group_name(v, "directional light: group"))


@frozen(eq=False, kw_only=True)
class AmbientLight:
    """Light from nowhere, for Whitted ray tracing; the path tracer ignores it."""

    colour: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "ambient light: colour")
    )


@frozen(eq=False, kw_only=True)
class Environment:
    """Light from infinitely far away, by direction.

    Args:
        image: (H, W, 3) float32 radiance, equirectangular: the middle column lies along -z, the right quarter along
            +x, row 0 along +y.
        scale: factor on the radiance.
        rotation: 4 x 4 affine, environment to world; its translation has no effect.
        name: for messages, usually the file.
        group: as for `PointLight`.
    """

    image: Floats = field()
    scale: float = 1.0
    rotation: NDArray[np.float64] = field(
        factory=lambda: np.eye(4), converter=lambda value: affine(value, "environment: rotation")
    )
    name: str = ""
    group: str = field(default="", converter=lambda v: group_name(v, "environment: group"))

    def __attrs_post_init__(self) -> None:
        image = float_array(self.image, (None, None, 3), f"environment {self.name or 'image'}")
        if image.shape[0] == 0 or image.shape[1] == 0:
            raise SceneError(f"environment {self.name or 'image'} has no pixels")
        if (image < 0).any():
            raise SceneError(f"environment {self.name or 'image'} has negative radiance; it must be 0 or more")
        if isinstance(self.scale, bool) or not isinstance(self.scale, (int, float)) or not 0 <= self.scale <= 1e12:
            raise SceneError(f"environment: scale is {self.scale!r}: it must be a number from 0 to 1e12")
        object.__setattr__(self, "image", image)


Light = PointLight | DirectionalLight | AmbientLight
