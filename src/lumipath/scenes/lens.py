"""A thin lens: only what lies in its plane of focus is sharp."""

from __future__ import annotations

import colorsys

from ..scene import Camera, Material, Scene, Sphere
from ._build import floor, scale, sky, translate

_BALLS = 7
_SPACING = 0.9
_RADIUS = 0.32
_FOCUSED_BALL = 2


def _position(index: int) -> tuple[float, float, float]:
    """Balls stand on a line from front left to back right."""
    step = index - _FOCUSED_BALL
    return (0.55 * step, _RADIUS, -_SPACING * step)


def depth_of_field() -> Scene:
    """Seven coloured balls behind each other; the third from the front is in focus."""
    balls = []
    for index in range(_BALLS):
        colour = colorsys.hsv_to_rgb(index / _BALLS, 0.75, 0.8)
        material = Material(diffuse=colour, specular=(0.04, 0.04, 0.04), name=f"ball {index}")
        transform = translate(*_position(index)) @ scale(_RADIUS)
        balls.append(Sphere(transform=transform, material=material, name=f"ball {index}"))
    ground = floor(10.0, material=Material(diffuse=(0.4, 0.4, 0.4), name="floor"))
    camera = Camera.look_at((-0.6, 1.1, 4.6), _position(_FOCUSED_BALL), fov=36.0, aspect=1.6, aperture=0.15)
    return Scene(shapes=[ground, *balls], cameras=[camera], environment=sky(), name="depth-of-field")
