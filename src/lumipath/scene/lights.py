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


def number(value: Any, low: float, high: float, name: str, unit: str = "") -> float:
    """A number from `low` to `high`.

    Raises:
        SceneError: anything else.
    """
    wanted = isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high
    if not wanted:
        raise SceneError(f"{name} is {value!r}: it must be a number from {low:g} to {high:g}{unit and ' '}{unit}")
    return float(value)


_PLAIN = ((1.0, 1.0, 1.0), (0.0, 0.0, 1.0))


@frozen(eq=False, kw_only=True)
class PointLight:
    """A point that shines alike in all directions: by the formula of the .ray language, or physically by `intensity`.

    Args:
        position: metres.
        colour: linear Rec.709. A white diffuse surface facing the light at the distance d gets the radiance
            colour * min(1, 1 / (a + b d + c d^2)), so the irradiance pi times as much.
        attenuation: a, b (1/m) and c (1/m^2), each 0 or more, not all 0.
        intensity: radiant intensity, W/sr, in place of colour and attenuation: the irradiance of a surface facing the
            light is intensity / d^2, however near.
        group: name of the light group that it belongs to, for the layers of `light_groups`.

    Raises:
        SceneError: a value is out of range, or intensity is given together with colour or attenuation.
    """

    position: tuple[float, float, float] = field(converter=lambda v: _point(v, "point light: position"))
    colour: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "point light: colour")
    )
    attenuation: tuple[float, float, float] = field(
        default=(0.0, 0.0, 1.0), converter=lambda v: colour(v, "point light: attenuation")
    )
    intensity: tuple[float, float, float] | None = field(
        default=None, converter=lambda v: None if v is None else colour(v, "point light: intensity")
    )
    group: str = field(default="", converter=lambda v: group_name(v, "point light: group"))

    def __attrs_post_init__(self) -> None:
        if self.intensity is not None and (self.colour, self.attenuation) != _PLAIN:
            raise SceneError("point light: intensity takes the place of colour and attenuation; give one or the other")
        if max(self.attenuation) == 0:
            raise SceneError("point light: all three attenuation coefficients are 0; give at least one of them")


@frozen(eq=False, kw_only=True)
class SpotLight:
    """A point that shines into a cone about `direction`: a lamp with a shade.

    Within `inner_angle` the intensity is the whole; from there to `outer_angle` it falls to 0 with the square of
    (cos(angle) - cos(outer)) / (cos(inner) - cos(outer)), as glTF's KHR_lights_punctual recommends.

    Args:
        position: metres.
        direction: of the axis; any length but 0.
        intensity: radiant intensity on the axis, W/sr; the irradiance of a surface that faces the light there, at the
            distance d, is intensity / d^2.
        inner_angle: from the axis to where the intensity begins to fall, degrees, 0 to outer_angle; equal to
            outer_angle: a sharp edge.
        outer_angle: from the axis to the edge of the light, degrees, above 0 to 180.
        group: as for `PointLight`.

    Raises:
        SceneError: a value is out of range.
    """

    position: tuple[float, float, float] = field(converter=lambda v: _point(v, "spot light: position"))
    direction: tuple[float, float, float] = field(
        default=(0.0, -1.0, 0.0), converter=lambda v: unit_vector(v, "spot light: direction")
    )
    intensity: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "spot light: intensity")
    )
    inner_angle: float = field(default=0.0, converter=lambda v: number(v, 0, 180, "spot light: inner_angle", "degrees"))
    outer_angle: float = field(
        default=45.0, converter=lambda v: number(v, 0.01, 180, "spot light: outer_angle", "degrees")
    )
    group: str = field(default="", converter=lambda v: group_name(v, "spot light: group"))

    def __attrs_post_init__(self) -> None:
        if self.inner_angle > self.outer_angle:
            raise SceneError(
                f"spot light: inner_angle is {self.inner_angle:g}, more than outer_angle, {self.outer_angle:g}; "
                "both count from the axis"
            )


@frozen(eq=False, kw_only=True)
class DirectionalLight:
    """Light along `direction` that gives a white diffuse surface facing it the radiance `colour`.

    Args:
        direction: in which the light travels; any length but 0.
        colour: linear Rec.709; the irradiance of a surface that faces the light is pi times as much.
        angle: diameter of the light as seen from the scene, degrees, 0 to 180. 0 is parallel light with sharp shadows;
            above, it is a disc of uniform radiance, which is seen where nothing hides it. Earth's sun has 0.53. The
            irradiance is the same for each.
        group: as for `PointLight`.
    """

    direction: tuple[float, float, float] = field(
        default=(0.0, 0.0, -1.0), converter=lambda v: unit_vector(v, "directional light: direction")
    )
    colour: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "directional light: colour")
    )
    angle: float = field(default=0.0, converter=lambda v: number(v, 0, 180, "directional light: angle", "degrees"))
    group: str = field(default="", converter=lambda v: group_name(v, "directional light: group"))


@frozen(eq=False, kw_only=True)
class AmbientLight:
    """Light from nowhere, for Whitted ray tracing; the path tracer ignores it."""

    colour: tuple[float, float, float] = field(
        default=(1.0, 1.0, 1.0), converter=lambda v: colour(v, "ambient light: colour")
    )


def _rotation(value: Any) -> NDArray[np.float64]:
    """A matrix, or the one that turns about +y by a number of degrees, counter-clockwise seen from above."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return affine(value, "environment: rotation")
    angle = np.radians(number(value, -1e6, 1e6, "environment: rotation", "degrees"))
    matrix = np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(angle)
    matrix[0, 2], matrix[2, 0] = np.sin(angle), -np.sin(angle)
    return matrix


@frozen(eq=False, kw_only=True)
class Environment:
    """Light from infinitely far away, by direction.

    Args:
        image: (H, W, 3) float32 radiance, equirectangular: the middle column lies along -z, the right quarter along
            +x, row 0 along +y.
        scale: factor on the radiance.
        rotation: 4 x 4 affine, environment to world, of which translation and scale have no effect; or one number,
            degrees about +y, counter-clockwise seen from above.
        name: for messages, usually the file.
        group: as for `PointLight`.
    """

    image: Floats = field()
    scale: float = 1.0
    rotation: NDArray[np.float64] = field(factory=lambda: np.eye(4), converter=_rotation)
    name: str = ""
    group: str = field(default="", converter=lambda v: group_name(v, "environment: group"))

    def __attrs_post_init__(self) -> None:
        image = float_array(self.image, (None, None, 3), f"environment {self.name or 'image'}")
        if image.shape[0] == 0 or image.shape[1] == 0:
            raise SceneError(f"environment {self.name or 'image'} has no pixels")
        if (image < 0).any():
            raise SceneError(f"environment {self.name or 'image'} has negative radiance; it must be 0 or more")
        number(self.scale, 0, 1e12, "environment: scale")
        object.__setattr__(self, "image", image)

    @classmethod
    def constant(cls, radiance: Any = 1.0) -> Environment:
        """The same radiance from everywhere: W/(m^2 sr), one number or (3,)."""
        parts = colour(radiance, "environment: radiance")
        return cls(image=np.broadcast_to(np.array(parts, np.float32), (1, 2, 3)), name="constant")


Light = PointLight | SpotLight | DirectionalLight | AmbientLight
