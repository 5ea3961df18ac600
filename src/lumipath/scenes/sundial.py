"""A sundial under a computed sky."""

from __future__ import annotations

import numpy as np

from ..scene import Box, Camera, Cylinder, Material, Mesh, Scene, Shape, Sky, Sphere
from ._build import UPRIGHT, floor, rotate, scale, translate

_TOP = 0.8
_LATITUDE = 48.0


def _gnomon(material: Material) -> Mesh:
    """The triangle whose shadow tells the time; its upper edge is parallel to the axis of Earth, north is -z."""
    length, half = 0.42, 0.012
    height = length * float(np.tan(np.radians(_LATITUDE)))
    outline = [(0.0, length / 2), (0.0, -length / 2), (height, -length / 2)]
    vertices = [(x, _TOP + y, z) for x in (-half, half) for y, z in outline]
    faces = [(0, 1, 2), (3, 5, 4), (0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2), (2, 5, 3), (2, 3, 0)]
    return Mesh(
        vertices=np.array(vertices, np.float32), faces=np.array(faces, np.int32), material=material, name="gnomon"
    )


def _hours(material: Material) -> list[Shape]:
    """Marks around the dial, a quarter of an hour of the sky apart, longer ones at the hours."""
    marks: list[Shape] = []
    for k in range(-24, 25):
        # Where the shadow of the polar edge falls at so many quarters of an hour from noon.
        turn = np.degrees(
            np.arctan2(np.sin(np.radians(_LATITUDE)) * np.sin(np.radians(3.75 * k)), np.cos(np.radians(3.75 * k)))
        )
        size = scale(0.008, 0.006, 0.1 if k % 4 == 0 else 0.04)
        place = rotate("y", -float(turn)) @ translate(0.0, _TOP, -0.46 - (0.0 if k % 4 == 0 else 0.03)) @ size
        marks.append(Box(transform=translate(0, 0, 0.21) @ place, material=material, name="mark"))
    return marks


def sundial() -> Scene:
    """A sundial, a metal ball and a heap of stones on a summer evening.

    Look at the edges of the shadows, which grow softer with the distance, at their blue, which is that of the sky, and
    at the sun in the ball. `--environment sky:elevation=60` is noon, `sky:elevation=2` the last light.
    """
    stone = Material(diffuse=(0.55, 0.52, 0.47), name="stone")
    brass = Material(diffuse=(0.25, 0.17, 0.06), specular=(0.45, 0.33, 0.14), name="brass")
    shapes: list[Shape] = [
        floor(9.0, material=Material(diffuse=(0.3, 0.33, 0.2), name="grass")),
        Cylinder(transform=UPRIGHT @ scale(0.24, 0.24, _TOP - 0.06), material=stone, name="column"),
        Cylinder(
            transform=translate(0, _TOP - 0.06, 0) @ UPRIGHT @ scale(0.72, 0.72, 0.06), material=stone, name="dial"
        ),
        _gnomon(brass),
        *_hours(Material(diffuse=(0.06, 0.05, 0.05), name="ink")),
        Sphere(
            transform=translate(0.95, 0.3, -0.95) @ scale(0.3), material=Material(specular=(0.9, 0.9, 0.9)), name="ball"
        ),
    ]
    rng = np.random.default_rng(3)
    for _ in range(14):
        x, z = rng.normal((-1.5, -0.9), 0.4)
        x_size, y_size, z_size = rng.uniform(0.08, 0.22, 3)
        place = translate(float(x), 0.6 * float(y_size), float(z)) @ rotate("y", float(rng.uniform(0, 360)))
        shapes.append(Sphere(transform=place @ scale(x_size, y_size, z_size), material=stone, name="pebble"))
    camera = Camera.look_at((1.5, 1.9, 2.6), (-0.05, 0.55, -0.15), fov=34.0, aspect=1.6)
    sky = Sky(elevation=24.0, azimuth=-105.0, turbidity=3.0, albedo=(0.25, 0.28, 0.18), scale=2.0)
    return Scene(shapes=shapes, cameras=[camera], environment=sky, name="sundial")
