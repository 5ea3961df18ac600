"""Caustics: light that glass and mirrors gather."""

from __future__ import annotations

from ..scene import Camera, Cone, Cylinder, Material, Scene, Sphere
from ._build import UPRIGHT, floor, scale, translate


def caustics() -> Scene:
    """A glass ball, a ring of polished metal and a wine-red glass cone under a lamp.

    Look at the bright spot behind the ball, at the heart-shaped curve that light thrown back by the ring draws on the
    floor, and at the colour in the shadow of the cone. These paths find the lamp by chance, so it is a large one, and
    the picture takes more samples than others.
    """
    ground = floor(10.0, material=Material(diffuse=(0.7, 0.7, 0.68), name="floor"))
    lamp = Sphere(
        transform=translate(-3.2, 3.4, 0.6) @ scale(0.6),
        material=Material(emission=(34.0, 31.0, 26.0), name="lamp"),
        name="lamp",
    )
    ball = Sphere(
        transform=translate(-0.55, 0.5, 0.75) @ scale(0.5),
        material=Material(transmissive=(0.98, 0.99, 0.98), index=1.5, name="glass"),
        name="ball",
    )
    ring = Cylinder(
        transform=translate(0.35, 0.0, -0.75) @ UPRIGHT @ scale(0.8, 0.8, 0.32),
        material=Material(specular=(0.95, 0.8, 0.5), name="gold"),
        capped=False,
        name="ring",
    )
    cone = Cone(
        bottom_radius=0.4,
        height=0.9,
        transform=translate(1.45, 0.001, 0.75) @ UPRIGHT,
        material=Material(transmissive=(0.75, 0.06, 0.1), index=1.45, name="red glass"),
        name="cone",
    )
    camera = Camera.look_at((1.0, 4.0, 4.6), (0.45, 0.2, 0.05), fov=30.0, aspect=1.6)
    return Scene(shapes=[ground, lamp, ball, ring, cone], cameras=[camera], name="caustics")
