"""A clear sky as an image to be sampled, and its sun as a light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scene import DirectionalLight, Environment, Sky
from .atmosphere import Array, Atmosphere, air_phase, haze_phase

_ROWS = 256
# Angles about the vertical at which light is integrated; phase functions are applied at every texel.
_TURNS = np.pi * (1 - np.cos(np.pi * np.arange(13) / 12)) / 2
_WAVELENGTHS: Array = np.linspace(400, 700, 16)
_SUN_TEMPERATURE = 5772.0


def colour_matching(wavelengths: Array) -> Array:
    """(N, 3): the CIE 1931 colour matching functions; nm (the fits of Wyman, Sloan and Shirley 2013)."""

    def lobe(height: float, middle: float, left: float, right: float) -> Array:
        off = wavelengths - middle
        return height * np.exp(-0.5 * (off / np.where(off < 0, left, right)) ** 2)

    x = lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2)
    y = lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1)
    z = lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8)
    return np.stack([x, y, z], -1)


# IEC 61966-2-1.
_XYZ_TO_RGB = np.array([(3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570)])


def _to_colour() -> Array:
    """(wavelengths, 3): from fractions of sunlight to Rec.709, the whole having the luminance 1."""
    micrometres = _WAVELENGTHS / 1000
    # Planck's law, in any unit.
    sunlight = 1 / (micrometres**5 * np.expm1(14387.8 / (micrometres * _SUN_TEMPERATURE)))
    xyz = colour_matching(_WAVELENGTHS) * sunlight[:, None]
    return (xyz / xyz[:, 1].sum()) @ _XYZ_TO_RGB.T


def _spectral(albedo: tuple[float, float, float]) -> Array:
    """A reflectance spectrum of about this colour."""
    return np.interp(_WAVELENGTHS, (450, 545, 610), albedo[::-1])


def _dome(air: Atmosphere, sky: Sky) -> Array:
    """(rows, columns, wavelengths): radiance from every direction, for a sun of irradiance 1."""
    height = np.radians(sky.elevation)
    elevation = np.pi * (0.5 - (np.arange(_ROWS) + 0.5) / _ROWS)
    azimuth = 2 * np.pi * ((np.arange(2 * _ROWS) + 0.5) / (2 * _ROWS) - 0.5)
    found = air.seen_from_the_ground(elevation[:, None] + 0 * _TURNS, _TURNS + 0 * elevation[:, None], height)
    # The sky is the same on both sides of the sun.
    turn = np.abs((azimuth - np.radians(sky.azimuth) + np.pi) % (2 * np.pi) - np.pi)
    k = np.clip(np.searchsorted(_TURNS, turn, side="right") - 1, 0, len(_TURNS) - 2)
    share = ((turn - _TURNS[k]) / (_TURNS[k + 1] - _TURNS[k]))[:, None]

    def around(values: Array) -> Array:
        return values[:, k] * (1 - share) + values[:, k + 1] * share

    up, across = np.sin(elevation)[:, None], np.cos(elevation)[:, None]
    along = (up * np.sin(height) + across * np.cos(height) * np.cos(turn))[..., None]
    radiance = around(found.air) * air_phase(along) + around(found.haze) * haze_phase(along) + around(found.multiple)
    # The ground shines back what falls onto it, and is seen through the air before it.
    cells = np.maximum(up, 0) * across * (np.pi / _ROWS) ** 2
    falling = (radiance * cells[..., None]).sum(axis=(0, 1)) + air.sunlight(height) * max(np.sin(height), 0)
    ground = around(found.transmittance) * (air.albedo * falling / np.pi)
    return radiance + ground * (up < 0)[..., None]


def sky_image(sky: Sky) -> NDArray[np.float32]:
    """(256, 512, 3): radiance of a sky without its sun and without its scale, as an environment's image."""
    air = Atmosphere(_WAVELENGTHS, sky.turbidity, _spectral(sky.albedo))
    # The sun above the air gives a white surface the radiance 1: its irradiance is pi.
    image = np.pi * _dome(air, sky) @ _to_colour()
    return np.maximum(image, 0).astype(np.float32)


def sun_colour(sky: Sky) -> Array:
    """(3,): radiance of a white diffuse surface on the ground that faces the sun, without scale."""
    air = Atmosphere(_WAVELENGTHS, sky.turbidity, _spectral(sky.albedo))
    return np.maximum(air.sunlight(np.radians(sky.elevation)) @ _to_colour(), 0)


def far_light(environment: Environment | Sky | None) -> tuple[Environment | None, list[DirectionalLight]]:
    """An environment as an image, and the sun that goes with it, if any."""
    if not isinstance(environment, Sky):
        return environment, []
    group = environment.group
    image = Environment(image=sky_image(environment), scale=environment.scale, name="sky", group=group)
    if not environment.sun:
        return image, []
    colour = sun_colour(environment) * environment.scale
    away = [-x for x in environment.direction]
    return image, [DirectionalLight(direction=away, colour=colour, angle=environment.sun_angle, group=group)]
