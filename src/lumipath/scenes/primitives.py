"""Every primitive, under transforms that stretch and turn it."""

from __future__ import annotations

from ..scene import Box, Camera, Cone, Cylinder, DirectionalLight, Material, Scene, Sphere, Square
from ..scene.shapes import Shape
from ._build import UPRIGHT, floor, rotate, scale, sky, translate


def _matt(name: str, red: float, green: float, blue: float) -> Material:
    return Material(diffuse=(red, green, blue), name=name)


def _back_row() -> list[Shape]:
    """Closed shapes."""
    return [
        Cylinder(
            transform=translate(-2.4, 0, -1) @ UPRIGHT @ scale(0.45, 0.45, 1.5),
            material=_matt("teal", 0.1, 0.5, 0.5),
            name="cylinder",
        ),
        Cone(
            transform=translate(-0.8, 0, -1) @ UPRIGHT @ scale(0.6, 0.6, 1.6),
            material=_matt("orange", 0.8, 0.35, 0.08),
            name="cone",
        ),
        Cone(
            bottom_radius=0.65,
            top_radius=0.3,
            height=1.2,
            transform=translate(0.8, 0, -1) @ UPRIGHT,
            material=_matt("rose", 0.7, 0.25, 0.35),
            name="truncated cone",
        ),
        Box(
            transform=translate(2.4, 0.5, -1) @ rotate("y", 30),
            material=_matt("blue", 0.15, 0.25, 0.7),
            name="box",
        ),
    ]


def _front_row() -> list[Shape]:
    """Round shapes, and open ones whose inside can be seen."""
    return [
        Sphere(
            transform=translate(-2.2, 0.45, 0.8) @ scale(0.45),
            material=Material(diffuse=(0.1, 0.1, 0.1), specular=(0.8, 0.8, 0.8), name="polished"),
            name="sphere",
        ),
        Sphere(
            transform=translate(-0.8, 0.5, 0.9) @ rotate("z", 35) @ scale(0.65, 0.3, 0.4),
            material=_matt("olive", 0.45, 0.5, 0.1),
            name="ellipsoid",
        ),
        Cone(
            bottom_radius=0.2,
            top_radius=0.55,
            height=0.7,
            capped=False,
            transform=translate(0.7, 0, 0.9) @ UPRIGHT,
            material=_matt("gold", 0.75, 0.55, 0.15),
            name="open truncated cone",
        ),
        Cylinder(
            transform=translate(1.7, 0.35, 1.0) @ rotate("y", 60) @ scale(0.35, 0.35, 1.0),
            material=_matt("violet", 0.4, 0.2, 0.6),
            capped=False,
            name="pipe",
        ),
        Square(
            transform=translate(0, 1.4, -2.6) @ rotate("x", 10) @ scale(6.0, 2.6, 1.0),
            material=Material(specular=(0.85, 0.85, 0.85), name="mirror"),
            name="mirror",
        ),
    ]


def primitives() -> Scene:
    """All shapes on a grey floor in sunlight."""
    ground = floor(8.0, material=_matt("grey", 0.5, 0.5, 0.5))
    return Scene(
        shapes=[ground, *_back_row(), *_front_row()],
        lights=[DirectionalLight(direction=(-0.5, -1.0, -0.6), colour=(0.75, 0.7, 0.6))],
        cameras=[Camera.look_at((0.0, 2.6, 6.2), (0.0, 0.55, 0.0), fov=36.0, aspect=1.6)],
        environment=sky(0.4),
        name="primitives",
    )
