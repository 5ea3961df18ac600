"""Depth of field against the circle of confusion that a thin lens must give."""

from __future__ import annotations

import numpy as np
import pytest
from parts import quad
from renders import renders

from lumipath.scene import Camera, Material, Scene

WIDTH = 64
SIZE = 1e-2


def point_at(x, y, distance, size=SIZE):
    """A nearly point-like square lamp that faces the camera at the origin."""
    s = size * distance / 2
    corners = [
        (x - s, y - s, -distance),
        (x + s, y - s, -distance),
        (x + s, y + s, -distance),
        (x - s, y + s, -distance),
    ]
    return quad(*corners, material=Material(emission=1e3), two_sided=False)


def spot(images, half):
    """Energy, centre (2,) and mean square distance from it, on the image plane at distance 1."""
    image = images.mean(axis=(0, 3))
    s = (np.arange(WIDTH) + 0.5) / WIDTH * 2 - 1
    x, y = np.meshgrid(s * half, -s * half)
    energy = image.sum()
    cx, cy = (image * x).sum() / energy, (image * y).sum() / energy
    return energy, (cx, cy), (image * ((x - cx) ** 2 + (y - cy) ** 2)).sum() / energy


@pytest.mark.parametrize(("distance", "focus", "aperture"), [(2.0, 4.0, 0.2), (6.0, 3.0, 0.25), (3.0, 1e6, 0.15)])
def test_a_point_out_of_focus_is_a_disc_of_the_size_of_its_circle_of_confusion(device, distance, focus, aperture):
    fov = 24
    half = np.tan(np.radians(fov / 2))
    scene = Scene(
        shapes=[point_at(0.03 * distance, -0.02 * distance, distance)],
        cameras=[Camera(fov=fov, aperture=aperture, focus=focus)],
    )
    settings = {"width": WIDTH, "max_depth": 1, "device": device, "seeds": 4}
    energy, centre, spread = spot(renders(scene, spp=1024, **settings), half)
    radius = aperture * abs(1 / focus - 1 / distance)
    # A disc of even brightness, a pixel's width and the lamp's own size.
    expected = radius**2 / 2 + 2 * (2 * half / WIDTH) ** 2 / 12 + 2 * SIZE**2 / 12
    assert radius > 5 * 2 * half / WIDTH
    np.testing.assert_allclose(spread, expected, rtol=0.04)
    np.testing.assert_allclose(centre, (0.03, -0.02), atol=2e-3)
    # As much light as through a pinhole.
    solid_angle = SIZE**2
    np.testing.assert_allclose(energy * (2 * half / WIDTH) ** 2, 1e3 * solid_angle, rtol=0.04)


def test_a_point_in_focus_is_a_point(device):
    half = np.tan(np.radians(12))
    scene = Scene(shapes=[point_at(0.1, 0.05, 4.0)], cameras=[Camera(fov=24, aperture=0.3, focus=4.0)])
    images = renders(scene, width=WIDTH, max_depth=1, device=device, seeds=4, spp=1024)
    _, centre, spread = spot(images, half)
    assert spread < 2 * (2 * half / WIDTH) ** 2
    np.testing.assert_allclose(centre, (0.025, 0.0125), atol=2 * half / WIDTH)
