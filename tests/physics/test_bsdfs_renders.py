"""Pictures of rough and thin glass and of metals: however lamps are found, and as Mitsuba 3 shows them."""

from __future__ import annotations

import numpy as np
from judging import ALPHA, assert_same, p_value
from parts import floor, moved, quad, scaled, sky, with_all_surfaces
from renders import renders, without_light_sampling

from lumipath.scene import Camera, Conductor, Dielectric, Diffuse, Environment, Material, Scene, Sphere, ThinDielectric

SETTINGS = {"width": 24, "spp": 128, "seeds": 12, "max_depth": 8}


def broad_sun(rows=16):
    """A sky with a sun that single directions find now and then."""
    row, column = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(2 * rows) + 0.5) / (2 * rows), indexing="ij")
    glow = 6 * np.exp(-40 * ((row - 0.25) ** 2 + (column - 0.6) ** 2))
    return Environment(image=(0.2 + glow[..., None] * (1.0, 0.9, 0.7)).astype(np.float32))


def show():
    """Rough glass on a floor before a lamp, a rough pane, an anisotropic metal, and water in glass."""
    lamp = quad((-1.5, 0.2, -2), (-0.5, 0.2, -2), (-0.5, 1.2, -2), (-1.5, 1.2, -2), material=Material(emission=4.0))
    pane = quad((0.4, 0, 0.9), (1.4, 0, 0.6), (1.4, 0.8, 0.6), (0.4, 0.8, 0.9), material=ThinDielectric(roughness=0.5))
    frosted = Dielectric(roughness=0.45, transmission_tint=(0.9, 1.0, 0.8), priority=2)
    brushed = Conductor(metal="copper", roughness=0.5, anisotropy=0.7)
    inside = Dielectric(ior=1.3, roughness=0.6, priority=1, attenuation_color=(0.9, 0.5, 0.5), attenuation_distance=0.5)
    shapes = [
        floor(3, material=Diffuse(reflectance=0.6)),
        lamp,
        pane,
        Sphere(transform=moved(-0.6, 0.6, 0) @ scaled(0.6), material=frosted),
        Sphere(transform=moved(-0.4, 0.5, 0.3) @ scaled(0.45), material=inside),
        Sphere(transform=moved(0.8, 0.5, -0.3) @ scaled(0.5), material=brushed),
    ]
    camera = Camera.look_at((0.2, 1.5, 4.5), (0, 0.5, 0), fov=36)
    return Scene(shapes=shapes, environment=broad_sun(), cameras=[camera])


def test_lamps_that_are_found_by_chance_show_the_same(device):
    scene = with_all_surfaces(show())
    usual = renders(scene, device=device, first_seed=1000, **SETTINGS)
    assert_same(usual, renders(scene, device=device, change=without_light_sampling, **SETTINGS))


def test_clamping_only_darkens_what_is_lit_indirectly(device):
    # Below the open sky only the inner side of the fold is lit by the other one.
    half = quad((0, 0, -1), (0, 0, 1), (-1, 1, 1), (-1, 1, -1), material=Diffuse(reflectance=0.7))
    fold = [half, quad((0, 0, 1), (0, 0, -1), (1, 1, -1), (1, 1, 1), material=Diffuse(reflectance=0.7))]
    camera = Camera.look_at((0, 6, 0.01), (0, 0, 0), fov=18)
    scene = Scene(shapes=fold, environment=sky(), cameras=[camera])
    settings = SETTINGS | {"max_depth": 3, "device": device}
    direct, usual = (renders(scene, **(settings | {"max_depth": depth})) for depth in (1, 3))
    clamped = renders(scene, clamp_indirect=0.05, **settings)
    assert p_value(clamped, usual) < ALPHA
    assert p_value(clamped, direct) < ALPHA
    assert direct.mean() < clamped.mean() < usual.mean()
    # Nothing is as bright: the limit is without effect.
    assert_same(renders(scene, clamp_indirect=10.0, **settings), usual)
