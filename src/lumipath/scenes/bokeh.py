"""A wide lens with blades: lamps out of focus show the shape of the aperture."""

from __future__ import annotations

import colorsys

import numpy as np

from ..scene import Camera, Material, Scene, Sphere
from ..scene.shapes import Shape
from ._build import floor, scale, translate

_BLADES = 6
_LAMPS = 66
_LAMP_RADIUS = 0.045
_HUES = (0.03, 0.08, 0.12, 0.55, 0.9)
_RADIANCE = 13.0


def _lamps() -> list[Shape]:
    """Small coloured lamps, scattered far behind."""
    rng = np.random.default_rng(7)
    lamps: list[Shape] = []
    for index in range(_LAMPS):
        # Steps of the golden section across, so that few overlap.
        x = (index * 0.618034 % 1 - 0.5) * 11.0 + rng.uniform(-0.3, 0.3)
        y = 0.4 + 3.4 * (index + 0.5) / _LAMPS
        z = -5.8 + rng.uniform(-1.6, 1.6)
        red, green, blue = colorsys.hsv_to_rgb(rng.choice(_HUES), 0.75, _RADIANCE)
        lamps.append(
            Sphere(
                transform=translate(x, y, z) @ scale(_LAMP_RADIUS),
                material=Material(emission=(red, green, blue), name=f"lamp {index}"),
                name=f"lamp {index}",
            )
        )
    return lamps


def bokeh() -> Scene:
    """A red and a silver ball in the evening before many small lamps, through an aperture of six blades.

    Look at the hexagons that the lamps become, and at their small sharp pictures in the silver ball. `--blades 0` makes
    them round, `--focus-on 436,74` turns to a lamp.
    """
    ground = floor(9.0, material=Material(diffuse=(0.25, 0.22, 0.2), specular=(0.04, 0.04, 0.04), name="table"))
    balls = [
        Sphere(
            transform=translate(-0.35, 0.4, 0.0) @ scale(0.4),
            material=Material(diffuse=(0.6, 0.06, 0.05), specular=(0.05, 0.05, 0.05), name="red"),
            name="red ball",
        ),
        Sphere(
            transform=translate(0.5, 0.3, 0.2) @ scale(0.3),
            material=Material(specular=(0.85, 0.85, 0.85), name="silver"),
            name="silver ball",
        ),
    ]
    key = Sphere(
        transform=translate(-2.0, 3.5, 3.5) @ scale(0.5),
        material=Material(emission=(22.0, 20.0, 17.0), name="key light"),
        name="key light",
    )
    camera = Camera.look_at(
        (0.0, 0.75, 3.2), (0.0, 0.5, 0.0), fov=34.0, aspect=1.6, aperture=0.11, blades=_BLADES, blade_rotation=10.0
    )
    return Scene(shapes=[ground, *balls, key, *_lamps()], cameras=[camera], name="bokeh")
