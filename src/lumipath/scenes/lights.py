"""Lights without a surface: a point, a direction, and ambient light."""

from __future__ import annotations

from ..scene import AmbientLight, Camera, Cylinder, DirectionalLight, Material, PointLight, Scene, Sphere
from ..scene.shapes import Shape
from ._build import UPRIGHT, floor, quads, scale, translate

_COLUMNS = (-1.5, 0.0, 1.5)
_WALL_Z = -1.6


def _matt(name: str, red: float, green: float, blue: float) -> Material:
    """A surface that ambient light reaches as well."""
    return Material(diffuse=(red, green, blue), ambient=(red, green, blue), name=name)


def _column(x: float, ball: Material, stone: Material) -> list[Shape]:
    """A round column with a ball on top."""
    return [
        Cylinder(transform=translate(x, 0, -0.6) @ UPRIGHT @ scale(0.22, 0.22, 1.1), material=stone, name="column"),
        Sphere(transform=translate(x, 1.4, -0.6) @ scale(0.3), material=ball, name="ball"),
    ]


def lights() -> Scene:
    """Three columns before a wall.

    Look at the glow that a warm point light makes on the wall and how it falls off, and at the long, sharp, bluish
    shadows of the light from the right. Ambient light fills them in Whitted mode only; a path tracer ignores it.
    """
    stone = _matt("stone", 0.6, 0.58, 0.55)
    balls = (_matt("red", 0.7, 0.12, 0.1), _matt("green", 0.15, 0.5, 0.15), _matt("blue", 0.12, 0.2, 0.65))
    wall = quads(((-6, 0, _WALL_Z), (6, 0, _WALL_Z), (6, 5, _WALL_Z), (-6, 5, _WALL_Z)), material=stone, name="wall")
    columns = [shape for x, ball in zip(_COLUMNS, balls, strict=True) for shape in _column(x, ball, stone)]
    return Scene(
        shapes=[floor(6.0, material=stone), wall, *columns],
        lights=[
            PointLight(position=(-0.75, 0.9, -1.2), colour=(1.3, 0.7, 0.25), attenuation=(0.0, 0.0, 2.0)),
            DirectionalLight(direction=(-1.0, -0.9, -0.75), colour=(0.6, 0.72, 0.95)),
            AmbientLight(colour=(0.08, 0.08, 0.1)),
        ],
        cameras=[Camera.look_at((0.4, 1.7, 5.2), (0.0, 0.85, -0.8), fov=34.0, aspect=1.6)],
        name="lights",
    )
