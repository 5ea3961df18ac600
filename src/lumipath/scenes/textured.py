"""One texture on every primitive, and in every lobe."""

from __future__ import annotations

import colorsys

import numpy as np

from ..scene import Box, Camera, Cone, Cylinder, DirectionalLight, Material, Mesh, Scene, Sphere, Square, Texture
from ..scene.shapes import Shape
from ._build import UPRIGHT, floor, rotate, scale, sky, translate

_FIELDS, _TEXELS = 8, 16
_BRIGHT, _DARK = 0.9, 0.3


def _chart(scale: float = 1.0, low: float = 0.0) -> Texture:
    """Fields whose hue grows with u, deeper downwards: red at u = 0, violet at u = 1.

    Args:
        scale: factor on all colours.
        low: what every colour begins at, from 0 to 1.
    """
    image = np.empty((_FIELDS, _FIELDS, 3))
    for row in range(_FIELDS):
        for column in range(_FIELDS):
            value = _BRIGHT if (row + column) % 2 else _DARK
            image[row, column] = colorsys.hsv_to_rgb(0.8 * column / (_FIELDS - 1), 0.5 + 0.45 * row / _FIELDS, value)
    image = scale * (low + (1 - low) * image)
    return Texture(image.repeat(_TEXELS, axis=0).repeat(_TEXELS, axis=1).astype(np.float32), name="chart")


def _back_row(material: Material) -> list[Shape]:
    """Closed quadrics and a box."""
    return [
        Sphere(
            transform=translate(-2.5, 0.6, -0.8) @ rotate("y", -70) @ UPRIGHT @ scale(0.6),
            material=material,
            name="sphere",
        ),
        Cylinder(
            transform=translate(-0.85, 0, -0.8) @ rotate("y", -30) @ UPRIGHT @ scale(0.5, 0.5, 1.2),
            material=material,
            name="cylinder",
        ),
        Cone(
            transform=translate(0.75, 0, -0.8) @ rotate("y", -110) @ UPRIGHT @ scale(0.6, 0.6, 1.4),
            material=material,
            name="cone",
        ),
        Box(
            transform=translate(2.4, 0.52, -0.8) @ rotate("y", 30) @ rotate("x", 5) @ scale(0.9, 0.9, 0.9),
            material=material,
            name="box",
        ),
    ]


def _front_row(chart: Texture) -> list[Shape]:
    """Open and flat shapes, and the other lobes: mirror, glass, emission."""
    matt = Material(diffuse=chart, name="chart")
    roof = Mesh(
        vertices=((-2.9, 0.0, 1.1), (-2.1, 0.0, 0.7), (-2.1, 0.7, 0.5), (-2.9, 0.7, 0.9)),
        faces=((0, 1, 2), (0, 2, 3)),
        uvs=((0, 0), (2, 0), (2, 2), (0, 2)),
        material=matt,
        name="mesh, its texture repeated",
    )
    cup = Cone(
        bottom_radius=0.25,
        top_radius=0.5,
        height=0.55,
        capped=False,
        transform=translate(-1.2, 0.0, 1.0) @ UPRIGHT,
        material=matt,
        name="cup",
    )
    mirror = Square(
        transform=translate(0.05, 0.4, 0.9) @ rotate("y", -20) @ scale(0.8),
        material=Material(specular=_chart(low=0.3), name="tinted mirror"),
        name="mirror",
    )
    painted = Sphere(
        transform=translate(1.2, 0.4, 1.0) @ rotate("y", -60) @ UPRIGHT @ scale(0.4),
        material=Material(diffuse=_chart(scale=0.5), transmissive=(0.5, 0.5, 0.5), index=1.3, name="painted glass"),
        name="glass",
    )
    lamp = Sphere(
        transform=translate(2.2, 0.32, 1.0) @ rotate("y", -60) @ UPRIGHT @ scale(0.32),
        material=Material(emission=_chart(scale=1.3), name="lamp"),
        name="lamp",
    )
    return [roof, cup, mirror, painted, lamp]


def textured_primitives() -> Scene:
    """One chart of colours on sphere, cylinder, cone, box, mesh, cup, square, glass and lamp.

    Look at where the chart begins (red) and ends (violet) on each shape, at the cap of the cylinder, and at the
    lobes that it colours: matt, mirror, paint on glass, glow.
    """
    chart = _chart()
    ground = floor(10.0, material=Material(diffuse=(0.5, 0.5, 0.5), name="floor"))
    return Scene(
        shapes=[ground, *_back_row(Material(diffuse=chart, name="chart")), *_front_row(chart)],
        lights=[DirectionalLight(direction=(-0.6, -1.0, -0.5), colour=(0.8, 0.75, 0.65))],
        cameras=[Camera.look_at((0.0, 5.0, 7.2), (0.0, 0.4, 0.05), fov=27.0, aspect=1.6)],
        environment=sky(0.5),
        name="textured-primitives",
    )
