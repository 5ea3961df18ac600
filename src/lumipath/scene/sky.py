"""The sky of a clear day, by a few numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from attrs import field, frozen

from .lights import number, unit_vector
from .values import colour, group_name


@frozen(eq=False, kw_only=True)
class Sky:
    """Earth's clear sky with its sun, computed from the scattering of sunlight by air, haze and ozone; +y is up.

    Radiance 1 is that of a white diffuse surface that faces the sun above the atmosphere; 40,600 cd/m^2 in nature. A
    white floor at noon has about 1, the blue of the zenith 0.1, the sun itself some 40,000.

    Args:
        elevation: of the sun above the horizon, degrees, -18 (night) to 90 (zenith).
        azimuth: of the sun, degrees: 0 is -z, 90 is +x, 180 is +z.
        turbidity: optical thickness of air and haze over that of air alone, at 550 nm, 1 to 10: 1.5 is very clear, 2.5
            a clear day, 6 hazy.
        albedo: of the ground, which fills the lower half and brightens the sky; one number or (3,), each 0 to 1.
        sun: whether the sun itself is there, as a light of its own. Without it the sky is that of its elevation still.
        sun_angle: diameter of the sun, degrees, 0 to 20. A larger one makes softer shadows; its light stays the same.
        scale: factor on all of it.
        group: name of the light group that sky and sun belong to, for the layers of `light_groups`.

    Raises:
        SceneError: a value is out of range.
    """

    elevation: float = field(default=45.0, converter=lambda value: number(value, -18, 90, "sky: elevation", "degrees"))
    azimuth: float = field(default=0.0, converter=lambda value: number(value, -1e6, 1e6, "sky: azimuth", "degrees"))
    turbidity: float = field(default=2.5, converter=lambda value: number(value, 1, 10, "sky: turbidity"))
    albedo: tuple[float, float, float] = field(
        default=(0.3, 0.3, 0.3), converter=lambda value: colour(value, "sky: albedo", 1.0)
    )
    sun: bool = field(default=True, converter=bool)
    sun_angle: float = field(default=0.53, converter=lambda value: number(value, 0, 20, "sky: sun_angle", "degrees"))
    scale: float = field(default=1.0, converter=lambda value: number(value, 0, 1e12, "sky: scale"))
    group: str = field(default="", converter=lambda value: group_name(value, "sky: group"))

    @classmethod
    def facing(cls, direction: Any, **options: Any) -> Sky:
        """The sky with its sun in a direction, (3,) of any length; other fields as `options`.

        Raises:
            SceneError: the direction is too far below the horizon, or (0, 0, 0).
        """
        x, y, z = unit_vector(direction, "sky: direction")
        elevation = float(np.degrees(np.arcsin(np.clip(y, -1.0, 1.0))))
        return cls(elevation=elevation, azimuth=float(np.degrees(np.arctan2(x, -z))), **options)

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit vector to the sun."""
        elevation, azimuth = np.radians(self.elevation), np.radians(self.azimuth)
        across = np.cos(elevation)
        return (float(across * np.sin(azimuth)), float(np.sin(elevation)), float(-across * np.cos(azimuth)))
