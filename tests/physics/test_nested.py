"""Dielectrics that overlap: the one with the highest priority is there."""

from __future__ import annotations

import numpy as np
import pytest
from judging import ALPHA, assert_same, p_value
from parts import moved, scaled, with_all_surfaces
from renders import renders

from lumipath.scene import Box, Camera, Dielectric, Environment, Scene, Sphere

SETTINGS = {"width": 24, "spp": 128, "seeds": 8, "max_depth": 24}
GREEN = {"attenuation_color": (0.6, 0.9, 0.7), "attenuation_distance": 0.5}
BLUE = {"attenuation_color": (0.4, 0.7, 0.9), "attenuation_distance": 1.0}


def slab(near, far, material):
    """A wide box between two distances before the origin, along -z."""
    return Box(transform=moved(0, 0, -(near + far) / 2) @ scaled(8, 8, far - near), material=material)


def light_from_behind():
    """White from all that lies before the camera, black from behind it."""
    columns = np.zeros(64)
    columns[16:48] = 1.0
    return Environment(image=np.broadcast_to(columns[None, :, None], (32, 64, 3)).astype(np.float32))


def stack_transmittance(indices, absorbed):
    """Fraction of light that goes straight through layers, between which it is reflected any number of times.

    Args:
        indices: of the media, the first and the last one outside.
        absorbed: (layers, 3): fraction of light left after each inner layer.
    """
    reflect, through = np.zeros(3), np.ones(3)
    for k in range(len(indices) - 1):
        r = ((indices[k] - indices[k + 1]) / (indices[k] + indices[k + 1])) ** 2
        # Adding one surface, then one layer; `reflect` is seen from the far side, back into what was added before.
        rounds = 1 / (1 - reflect * r)
        through, reflect = through * (1 - r) * rounds, r + (1 - r) ** 2 * reflect * rounds
        if k < len(indices) - 2:
            through, reflect = through * absorbed[k], reflect * absorbed[k] ** 2
    return through


def test_water_in_a_glass_that_it_overlaps(device):
    glass = Dielectric(ior=1.5, priority=2, **GREEN)
    water = Dielectric(ior=1.33, priority=1, **BLUE)
    shapes = [slab(1.0, 1.1, glass), slab(1.05, 2.03, water), slab(2.0, 2.2, glass)]
    scene = Scene(shapes=shapes, environment=light_from_behind(), cameras=[Camera(fov=0.5)])
    images = renders(with_all_surfaces(scene), device=device, **SETTINGS)
    # Between the walls there are 0.9 metres of water.
    lengths = [np.array(GREEN["attenuation_color"]) ** (d / 0.5) for d in (0.1, 0.2)]
    layers = [lengths[0], np.array(BLUE["attenuation_color"]) ** 0.9, lengths[1]]
    exact = stack_transmittance([1, 1.5, 1.33, 1.5, 1], layers)
    assert_same(images, exact)
    # Without the overlap there would be a little air between, which reflects more.
    airy = stack_transmittance([1, 1.5, 1, 1.33, 1, 1.5, 1], [layers[0], 1, layers[1], 1, layers[2]])
    assert p_value(images, airy) < ALPHA


def gradient():
    """A sky that is different everywhere."""
    row, column = np.meshgrid(np.arange(32) / 32, np.arange(64) / 64, indexing="ij")
    image = np.stack([row, column, 0.5 + 0.5 * np.sin(14 * column)], -1) + 0.1
    return Environment(image=image.astype(np.float32))


def balls(*materials):
    """Spheres within each other."""
    shapes = [Sphere(transform=moved(0, 0, -3) @ scaled(0.9**k), material=m) for k, m in enumerate(materials)]
    return with_all_surfaces(Scene(shapes=shapes, environment=gradient(), cameras=[Camera(fov=45)]))


WATER = Dielectric(ior=1.33, priority=1, **BLUE)


@pytest.mark.parametrize(
    ("nested", "exact"),
    [
        # What is weaker than the water is not there; it may absorb and refract as it likes.
        ((WATER, Dielectric(ior=2.0, priority=0, **GREEN)), (Dielectric(ior=1.33, **BLUE),)),
        # A bubble of air, by its own index and by its index relative to water.
        ((WATER, Dielectric(ior=1.0, priority=2)), (Dielectric(ior=1.33, **BLUE), Dielectric(ior=1 / 1.33))),
        # Outside of a stronger one, the weaker one is left over as a shell.
        ((Dielectric(ior=1.33, priority=1), Dielectric(ior=1.33, priority=2)), (Dielectric(ior=1.33),)),
    ],
    ids=["overruled", "bubble", "same index"],
)
def test_priorities_and_exact_surfaces_show_the_same(device, nested, exact):
    images = renders(balls(*nested), device=device, **SETTINGS)
    assert_same(images, renders(balls(*exact), device=device, first_seed=100, **SETTINGS))
