"""The sky of a clear day, against published figures of daylight."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from lumipath.pack import layout
from lumipath.pack.atmosphere import Atmosphere, air_phase, air_thickness, haze_phase
from lumipath.pack.environment import pack_environment
from lumipath.pack.scene import pack_scene
from lumipath.pack.sky import colour_matching, far_light, sky_image, sun_colour
from lumipath.scene import Box, Environment, Scene, Sky

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# Illuminance of the sun above the air, lx, which stands for a radiance of 1 on a white surface (IES Lighting Handbook).
ABOVE_THE_AIR = 127_500

HEIGHTS = np.pi / 2 - np.pi * (np.arange(256) + 0.5) / 256


@functools.cache
def image(**options):
    return sky_image(Sky(**options)).astype(np.float64)


def illuminance(of_sky):
    """Of level ground by a sky alone, lx."""
    cells = np.maximum(np.sin(HEIGHTS), 0) * np.cos(HEIGHTS) * (np.pi / 256) ** 2
    return ABOVE_THE_AIR / np.pi * (of_sky @ LUMINANCE * cells[:, None]).sum()


def chromaticity(colour):
    return colour / colour.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize("elevation", [10, 20, 30, 45, 60, 75])
def test_daylight_is_as_bright_as_the_handbook_says(elevation):
    # IES Lighting Handbook, clear sky: 127.5 exp(-0.21 / sin h) klx of direct light and 0.8 + 15.5 sqrt(sin h) of sky,
    # a fit to measurements that scatter by a third and more.
    sine = np.sin(np.radians(elevation))
    direct = ABOVE_THE_AIR * np.exp(-0.21 / sine)
    diffuse = 800 + 15500 * np.sqrt(sine)
    sun = sun_colour(Sky(elevation=elevation)) @ LUMINANCE * ABOVE_THE_AIR
    assert 0.7 < sun / direct < 1.3
    assert 0.7 < illuminance(image(elevation=elevation)) / diffuse < 1.7


@pytest.mark.parametrize(("elevation", "least", "most"), [(-0.83, 410, 585), (-6, 2, 3.5)])
def test_twilight_is_as_bright_as_measured(elevation, least, most):
    # American Meteorological Society, Glossary of Meteorology, civil twilight: its beginning and its end.
    assert least / 1.8 < illuminance(image(elevation=elevation)) < most * 1.8
    assert sun_colour(Sky(elevation=elevation)).max() < 1e-3


def test_night_is_dark():
    assert illuminance(image(elevation=-18)) < 1e-2
    assert illuminance(image(elevation=-10)) < illuminance(image(elevation=-4)) / 50


def test_the_zenith_is_blue_the_horizon_pale_and_the_low_sun_red():
    day = image(elevation=40)
    zenith, horizon = chromaticity(day[0].mean(axis=0)), chromaticity(day[126, 0])
    assert zenith[2] > 0.45 > 0.38 > horizon[2]
    assert zenith[2] > zenith[1] > zenith[0]
    noon, evening = (chromaticity(sun_colour(Sky(elevation=e))) for e in (60, 5))
    assert evening[0] > 0.6 > 0.45 > noon[0] > evening[1]
    assert evening[2] < 0.1 < 0.2 < noon[2]


def test_the_sky_is_brightest_around_the_sun_and_at_the_horizon_and_darkest_across_the_zenith():
    day = image(elevation=35, azimuth=90) @ LUMINANCE
    row, column = np.unravel_index(day[:128].argmax(), (128, 512))
    # A little below it, where the way through the haze is longer.
    assert HEIGHTS[row] == pytest.approx(np.radians(35), abs=0.06)
    # +x is in the right quarter.
    assert column in (383, 384)
    row, column = np.unravel_index(day[:128].argmin(), (128, 512))
    across = np.arccos(
        np.sin(HEIGHTS[row]) * np.sin(np.radians(35))
        + np.cos(HEIGHTS[row]) * np.cos(np.radians(35)) * np.cos(2 * np.pi * ((column + 0.5) / 512 - 0.75))
    )
    assert 70 < np.degrees(across) < 110


def test_an_azimuth_turns_the_sky():
    np.testing.assert_allclose(np.roll(image(elevation=20), 128, axis=1), image(elevation=20, azimuth=90), rtol=1e-5)
    day = image(elevation=20)
    np.testing.assert_allclose(day, day[:, ::-1], rtol=1e-5)


def test_haze_whitens_the_sky_and_dims_the_sun():
    clear, hazy = ({"elevation": 45, "turbidity": t} for t in (1.5, 6))
    assert chromaticity(image(**clear)[20].mean(axis=0))[2] > chromaticity(image(**hazy)[20].mean(axis=0))[2] + 0.05
    assert sun_colour(Sky(**clear))[1] > 1.3 * sun_colour(Sky(**hazy))[1]


def test_the_ground_shines_back_what_falls_onto_it():
    dark, bright = image(elevation=45, albedo=0.0), image(elevation=45, albedo=(0.8, 0.4, 0.1))
    assert dark[200].max() < 1e-3
    falling = illuminance(bright) / ABOVE_THE_AIR + sun_colour(Sky()) @ LUMINANCE * np.sin(np.radians(45))
    assert 0.35 * falling < bright[200].mean(axis=0) @ LUMINANCE < 0.55 * falling
    assert (np.diff(bright[200].mean(axis=0)) < 0).all()
    # What the ground gives back, the air scatters once more.
    assert illuminance(bright) > 1.01 * illuminance(dark)


def test_phase_functions_are_normalised():
    cosine = (np.arange(200_000) + 0.5) / 100_000 - 1
    for phase in (air_phase, haze_phase):
        assert 4 * np.pi * phase(cosine).mean() == pytest.approx(1, rel=1e-4)


def test_air_is_as_thick_as_published():
    # Bodhaine et al. 1999, On Rayleigh Optical Depth Calculations, table 3: at sea level.
    np.testing.assert_allclose(air_thickness([400, 550, 700]), [0.3602, 0.0971, 0.0365], rtol=0.02)


def test_transmittance_straight_up_is_that_of_the_optical_thickness():
    wavelengths = np.array([450.0, 550.0, 650.0])
    air = Atmosphere(wavelengths, 3.0, np.zeros(3))
    haze = 2 * air_thickness(550) * (wavelengths / 550) ** -1.3
    ozone = np.array([0.263, 3.68, 2.26]) * 1e-25 * 300 * 2.687e20
    expected = np.exp(-(air_thickness(wavelengths) + haze + ozone))
    np.testing.assert_allclose(air.sunlight(np.pi / 2), expected, rtol=0.01)
    # Kasten and Young 1989: air masses at 20 and 5 degrees; in the blue, since ozone lies higher than air.
    clean = Atmosphere(wavelengths, 1.0, np.zeros(3))
    for elevation, mass in ((20, 2.904), (5, 10.31)):
        thickness = -np.log(clean.sunlight(np.radians(elevation)))
        assert thickness[0] / -np.log(clean.sunlight(np.pi / 2))[0] == pytest.approx(mass, rel=0.03)


def test_energy_is_not_gained():
    # What arrives from everywhere is at most what the sun sends onto level ground and its surroundings.
    for elevation in (15, 45, 90):
        total = illuminance(image(elevation=elevation, albedo=0.0))
        total += sun_colour(Sky(elevation=elevation)) @ LUMINANCE * np.sin(np.radians(elevation)) * ABOVE_THE_AIR
        assert total < ABOVE_THE_AIR * np.sin(np.radians(elevation))


def test_colour_matching_functions_are_those_of_the_standard():
    # CIE 1931 at 450, 550 and 600 nm; the fits are good to some hundredths.
    expected = [(0.3362, 0.0380, 1.7721), (0.4334, 0.9950, 0.0087), (1.0622, 0.6310, 0.0008)]
    np.testing.assert_allclose(colour_matching(np.array([450.0, 550, 600])), expected, atol=0.03)


def test_a_sky_is_an_image_and_a_sun():
    sky = Sky.facing((1, 1, 0), scale=2.0, sun_angle=3)
    assert (sky.elevation, sky.azimuth) == (pytest.approx(45), pytest.approx(90))
    np.testing.assert_allclose(sky.direction, np.sqrt([0.5, 0.5, 0]), atol=1e-12)
    environment, (sun,) = far_light(sky)
    assert (environment.scale, sun.angle) == (2, 3)
    np.testing.assert_allclose(sun.direction, -np.array(sky.direction))
    np.testing.assert_allclose(sun.colour, 2 * sun_colour(sky), rtol=1e-6)
    assert pack_environment(environment).mean > 0
    assert far_light(Sky(sun=False))[1] == []
    plain = Environment(image=np.ones((2, 4, 3)))
    assert far_light(plain) == (plain, [])
    assert far_light(None) == (None, [])


def test_a_scene_under_a_sky_has_an_environment_and_a_sun():
    def mask(sky):
        return pack_scene(Scene(shapes=[Box()], environment=sky)).scene.features.mask

    assert mask(Sky()) == layout.ENVIRONMENT | layout.SUNS
    assert mask(Sky(sun=False)) == layout.ENVIRONMENT
    assert mask(Sky(sun_angle=0)) == layout.ENVIRONMENT | layout.DIRECTIONAL_LIGHTS
    assert mask(Sky(scale=0)) == 0
