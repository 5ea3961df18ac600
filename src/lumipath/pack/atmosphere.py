"""Sunlight scattered by Earth's air: radiance of a clear sky, wavelength by wavelength, seen from the ground.

Single scattering is integrated along the ray; all further orders are taken for isotropic, as in Hillaire 2020, A
Scalable and Production Ready Sky and Atmosphere Rendering Technique. Air, haze and ozone with exponential and tent
profiles as in Bruneton and Neyret 2008, Precomputed Atmospheric Scattering, and Bruneton's implementation of 2017.
Lengths are km, extinctions 1/km.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

Array = NDArray[np.float64]

GROUND = 6360.0
_TOP = 6460.0
_EYE = 0.002
_AIR_HEIGHT = 8.0
_HAZE_HEIGHT = 1.2
# Of haze: exponent of the wavelength (Angstrom), share of light that is scattered and not absorbed, asymmetry.
_HAZE_EXPONENT = 1.3
_HAZE_ALBEDO = 0.92
_HAZE_ASYMMETRY = 0.76

# Absorption cross-section of ozone, 1e-25 m^2, every 20 nm from 400 nm (rounded from Serdyuchenko et al. 2014).
_OZONE = (0.015, 0.055, 0.158, 0.367, 0.775, 1.48, 2.14, 3.09, 4.27, 4.40, 5.02, 3.74, 2.66, 1.85, 1.21, 0.75)
# 300 Dobson units in a tent from 10 to 40 km: greatest density, 1e25 / (m^2 km).
_OZONE_DENSITY = 300 * 2.687e20 / 15 * 1e-25

_VIEW_STEPS = 40
_SUN_STEPS = 32
# Where orders above the first are known: heights in km and elevations of the sun in degrees.
_HEIGHTS = np.array([0, 0.5, 1, 2, 4, 8, 16, 32, 64, 100.0])
_SUN_SINES = np.sin(np.radians([-20, -14, -10, -7, -5, -3, -1, 0, 1, 2, 4, 6, 9, 13, 18, 25, 35, 50, 90.0]))


def air_thickness(wavelengths: Any) -> Array:
    """Optical thickness of air alone, straight up from the sea; nm (Hansen and Travis 1974)."""
    x = np.asarray(wavelengths, np.float64) / 1000
    return 0.008569 / x**4 * (1 + 0.0113 / x**2 + 0.00013 / x**4)


def air_phase(cosine: Array) -> Array:
    """Rayleigh's phase function, 1/sr."""
    return 3 / (16 * np.pi) * (1 + cosine**2)


def haze_phase(cosine: Array) -> Array:
    """The phase function of Cornette and Shanks 1992, 1/sr."""
    g = _HAZE_ASYMMETRY
    return 3 / (8 * np.pi) * (1 - g * g) * (1 + cosine**2) / ((2 + g * g) * (1 + g * g - 2 * g * cosine) ** 1.5)


@frozen(eq=False)
class Scattered:
    """What comes along rays of the shape (...), for a sun of irradiance 1: each (..., wavelengths), 1/sr and less.

    air, haze: to be multiplied by their phase functions; multiple: orders above the first; transmittance: to the end.
    """

    air: Array
    haze: Array
    multiple: Array
    transmittance: Array


def _to_top(radius: Array | float, cosine: Array) -> Array:
    """Distance from a radius, along a ray at an angle to the vertical, to the top of the atmosphere."""
    return np.sqrt(np.maximum(_TOP**2 - radius**2 * (1 - cosine**2), 0)) - radius * cosine


def _to_ground(radius: Array | float, cosine: Array) -> Array:
    """The same to the ground; infinite where the ray does not meet it."""
    inside = GROUND**2 - radius**2 * (1 - cosine**2)
    meets = (cosine < 0) & (inside >= 0)
    return np.where(meets, -radius * cosine - np.sqrt(np.maximum(inside, 0)), np.inf)


def _densities(height: Array) -> tuple[Array, Array, Array]:
    """Of air, haze and ozone, as fractions of their greatest."""
    ozone = np.maximum(0, 1 - np.abs(height - 25) / 15)
    return np.exp(-height / _AIR_HEIGHT), np.exp(-height / _HAZE_HEIGHT), ozone


@frozen(eq=False)
class Atmosphere:
    """Earth's air with haze.

    Args:
        wavelengths: (N,) nm.
        turbidity: optical thickness of air and haze over that of air, at 550 nm.
        albedo: of the ground, (N,).
    """

    wavelengths: Array
    turbidity: float
    albedo: Array
    _multiple: list[Array] = field(factory=list, init=False)

    @property
    def scattering(self) -> tuple[Array, Array]:
        """Greatest scattering coefficients of air and haze, (N,) each."""
        air = air_thickness(self.wavelengths) / _AIR_HEIGHT
        haze = (self.turbidity - 1) * air_thickness(550) / _HAZE_HEIGHT * (self.wavelengths / 550) ** -_HAZE_EXPONENT
        return air, haze * _HAZE_ALBEDO

    @property
    def extinction(self) -> tuple[Array, Array, Array]:
        """Greatest extinction coefficients of air, haze and ozone, (N,) each."""
        air, haze = self.scattering
        ozone = np.interp(self.wavelengths, 400 + 20 * np.arange(len(_OZONE)), _OZONE) * _OZONE_DENSITY
        return air, haze / _HAZE_ALBEDO, ozone

    def sun_transmittance(self, radius: Array, cosine: Array) -> Array:
        """(..., N): fraction of sunlight that arrives at a radius, at an angle to the vertical; 0 in Earth's shadow."""
        distance = _to_top(radius, cosine)
        columns = [np.zeros(np.shape(distance)) for _ in range(3)]
        # Steps grow with the distance, since the air is densest near the ground.
        edges = np.linspace(0, 1, _SUN_STEPS + 1) ** 2
        for before, after in pairwise(edges):
            t = distance * (before + after) / 2
            height = np.sqrt(radius**2 + t**2 + 2 * radius * t * cosine) - GROUND
            for column, density in zip(columns, _densities(np.maximum(height, 0)), strict=True):
                column += density * distance * (after - before)
        depth = sum(c[..., None] * e for c, e in zip(columns, self.extinction, strict=True))
        return np.exp(-depth) * np.isinf(_to_ground(radius, cosine))[..., None]

    def along(
        self, radius: float, cosine: Array, sun_sine: Array, sun_along: Array, steps: int = _VIEW_STEPS
    ) -> Scattered:
        """What comes along rays.

        Args:
            radius: where they begin, km from the middle of Earth.
            cosine: of their angle to the vertical there.
            sun_sine: of the sun's elevation there.
            sun_along: cosine of the angle between ray and sun.
            steps: of the integration.
        """
        multiple = self._multiple_scattering() if steps == _VIEW_STEPS else None
        distance = np.minimum(_to_top(radius, cosine), _to_ground(radius, cosine))
        air_s, haze_s = self.scattering
        sums = [np.zeros((*np.shape(distance), len(self.wavelengths))) for _ in range(3)]
        through = np.ones_like(sums[0])
        edges = np.linspace(0, 1, steps + 1) ** 2
        for before, after in pairwise(edges):
            t = distance * (before + after) / 2
            here = np.sqrt(radius**2 + t**2 + 2 * radius * t * cosine)
            sine = np.clip((radius * sun_sine + t * sun_along) / here, -1, 1)
            air, haze, ozone = (d[..., None] for d in _densities(np.maximum(here - GROUND, 0)))
            extinction = sum(d * e for d, e in zip((air, haze, ozone), self.extinction, strict=True))
            step = np.exp(-extinction * (distance * (after - before))[..., None])
            # The transmittance within the step is integrated exactly.
            weight = through * (1 - step) / extinction
            lit = weight * self.sun_transmittance(here, sine)
            sums[0] += lit * air * air_s
            sums[1] += lit * haze * haze_s
            if multiple is None:
                # What a unit of light from all sides would bring, for the orders above the first.
                sums[2] += weight * (air * air_s + haze * haze_s)
            else:
                sums[2] += weight * (air * air_s + haze * haze_s) * _looked_up(multiple, here - GROUND, sine)
            through *= step
        return Scattered(sums[0], sums[1], sums[2], through)

    def _multiple_scattering(self) -> Array:
        """(heights, sun sines, N): isotropic radiance of all orders above the first, for a sun of irradiance 1."""
        if self._multiple:
            return self._multiple[0]
        # Directions over half of the sphere, to one side of the plane through the sun.
        cosine, turn = np.meshgrid((np.arange(8) + 0.5) / 4 - 1, (np.arange(4) + 0.5) / 4 * np.pi, indexing="ij")
        cosine, turn = cosine.reshape(-1, 1), turn.reshape(-1, 1)
        sine = _SUN_SINES[None, :]
        along = cosine * sine + np.sqrt((1 - cosine**2) * (1 - sine**2)) * np.cos(turn)
        table = []
        for height in _HEIGHTS:
            radius = GROUND + max(float(height), _EYE)
            found = self.along(radius, cosine + 0 * sine, sine + 0 * cosine, along, steps=20)
            end = _to_ground(radius, cosine + 0 * sine)
            meets = np.isfinite(end)
            t = np.where(meets, end, 0)
            sun = np.clip((radius * sine + t * along) / GROUND, -1, 1)
            lit = self.sun_transmittance(np.full_like(sun, GROUND), sun) * np.maximum(sun, 0)[..., None]
            ground = np.where(meets[..., None], found.transmittance * lit * self.albedo / np.pi, 0)
            second = ((found.air + found.haze) / (4 * np.pi) + ground).mean(axis=0)
            table.append(second / (1 - found.multiple.mean(axis=0)))
        self._multiple.append(np.array(table))
        return self._multiple[0]

    def seen_from_the_ground(self, elevation: Array, turn: Array, sun_elevation: float) -> Scattered:
        """What comes from directions, without the ground's own light; radians.

        Args:
            elevation: of the directions.
            turn: their angle about the vertical, from the sun.
            sun_elevation: of the sun.
        """
        cosine, sine = np.sin(elevation), np.sin(sun_elevation)
        along = cosine * sine + np.cos(elevation) * np.cos(sun_elevation) * np.cos(turn)
        return self.along(GROUND + _EYE, cosine, np.full_like(along, sine), along)

    def sunlight(self, sun_elevation: float) -> Array:
        """(N,): fraction of sunlight that reaches the ground."""
        return self.sun_transmittance(np.array(GROUND + _EYE), np.array(np.sin(sun_elevation)))


def _looked_up(table: Array, height: Array, sine: Array) -> Array:
    """Linear between the heights and sun sines of a table."""
    i, a = _place(_HEIGHTS, height)
    j, b = _place(_SUN_SINES, sine)
    upper = table[i, j] * (1 - b) + table[i, j + 1] * b
    return upper * (1 - a) + (table[i + 1, j] * (1 - b) + table[i + 1, j + 1] * b) * a


def _place(nodes: Array, x: Array) -> tuple[NDArray[np.intp], Array]:
    """The interval of each x among nodes, and how far along it is, from 0 to 1."""
    k = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
    share = np.clip((x - nodes[k]) / (nodes[k + 1] - nodes[k]), 0, 1)
    return k, share[..., None]
