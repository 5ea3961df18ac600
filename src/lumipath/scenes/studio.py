"""A studio for looking at materials: rows of balls on steps, soft lamps, a bent backdrop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..scene import Box, Camera, Dielectric, Environment, Material, Mesh, Principled, Scene, Sphere, Texture
from ..scene.shapes import Shape
from ._build import UPRIGHT, quads, scale, translate

_RADIUS = 0.44
_COLUMNS = 7
_STEP = 0.42
_DEPTH = 1.15
_BACK = -9.9

_WHITE = (1.0, 1.0, 1.0)
_RED = (0.55, 0.02, 0.02)
_BLUE = (0.02, 0.12, 0.4)
_GOLD = (1.0, 0.71, 0.29)
_COPPER = (0.93, 0.5, 0.32)
_GREY = Material(diffuse=(0.32, 0.32, 0.33), name="steps")
_PAPER = Material(diffuse=(0.4, 0.41, 0.43), name="paper")


def _shares() -> list[float]:
    """From 0 to 1, one a column."""
    return [float(part) for part in np.linspace(0, 1, _COLUMNS)]


def _glass() -> list[Principled]:
    """From clear to frosted, then tinted inside, then a bubble."""
    clear = [
        Principled(base_color=_WHITE, transmission=1.0, roughness=roughness, name=f"glass {roughness:g}")
        for roughness in (0.0, 0.15, 0.3, 0.5)
    ]
    amber, bottle = (
        Principled(
            base_color=_WHITE,
            transmission=1.0,
            roughness=0.0,
            attenuation_color=tint,
            attenuation_distance=0.5,
            name=name,
        )
        for name, tint in (("amber", (0.85, 0.35, 0.04)), ("bottle", (0.1, 0.6, 0.25)))
    )
    bubble = Principled(
        base_color=_WHITE,
        transmission=1.0,
        thin=True,
        roughness=0.0,
        iridescence=1.0,
        iridescence_thickness=420.0,
        name="bubble",
    )
    return [*clear, amber, bottle, bubble]


def _cloth_and_films() -> list[Principled]:
    """Four kinds of cloth, and three films of oil, each thicker than the one before."""
    cloth = [
        Principled(base_color=base, roughness=0.9, sheen_color=sheen, sheen_roughness=rough, name=f"cloth {rough:g}")
        for base, sheen, rough in (
            ((0.02, 0.02, 0.03), (0.8, 0.8, 0.9), 0.15),
            ((0.15, 0.01, 0.04), (0.9, 0.5, 0.6), 0.3),
            ((0.02, 0.05, 0.15), (0.4, 0.6, 0.9), 0.5),
            ((0.25, 0.18, 0.1), (0.8, 0.7, 0.5), 0.8),
        )
    ]
    films = [
        Principled(
            base_color=(0.7, 0.7, 0.7),
            metallic=1.0,
            roughness=0.15,
            iridescence=1.0,
            iridescence_ior=1.5,
            iridescence_thickness=thickness,
            name=f"film {thickness:g} nm",
        )
        for thickness in (250.0, 370.0, 520.0)
    ]
    return [*cloth, *films]


def _rows() -> list[list[Principled]]:
    """From the front to the back."""
    return [
        _glass(),
        _cloth_and_films(),
        [
            Principled(
                base_color=_RED,
                metallic=0.3,
                roughness=0.5,
                clearcoat=1.0,
                clearcoat_roughness=0.7 * share,
                name=f"lacquer {share:.2f}",
            )
            for share in _shares()
        ],
        [Principled(base_color=_BLUE, roughness=share, name=f"plastic {share:.2f}") for share in _shares()],
        [Principled(base_color=_GOLD, metallic=1.0, roughness=share, name=f"gold {share:.2f}") for share in _shares()],
    ]


def _tiles() -> Mesh:
    """A thin chequered plate below the glass, which would be hard to see before plain paper."""
    y, x = np.mgrid[:4, :28]
    image = np.where(((x + y) % 2 == 0)[..., None], (0.55, 0.53, 0.5), (0.06, 0.07, 0.09)).repeat(16, 0).repeat(16, 1)
    corners = ((-3.5, 0.005, 0.55), (3.5, 0.005, 0.55), (3.5, 0.005, -0.45), (-3.5, 0.005, -0.45))
    material = Principled(base_color=Texture(image=image.astype(np.float32), name="tiles"), roughness=0.3, name="tiles")
    return quads(corners, uvs=((0, 0), (1, 0), (1, 1), (0, 1)), material=material, name="tiles")


def _ball(row: int, column: int, material: Any) -> Sphere:
    x = (column - (_COLUMNS - 1) / 2) * 1.0
    place = translate(x, row * _STEP + _RADIUS, -row * _DEPTH)
    return Sphere(transform=place @ UPRIGHT @ scale(_RADIUS), material=material, name=material.name)


def _steps(rows: int) -> list[Shape]:
    """What the rows behind the first one stand on."""
    steps: list[Shape] = []
    for row in range(1, rows):
        front = _DEPTH / 2 - row * _DEPTH
        depth, height = front - _BACK, row * _STEP
        place = translate(0.0, height / 2, front - depth / 2) @ scale(7.9, height, depth)
        steps.append(Box(transform=place, material=_GREY, name=f"step {row}"))
    return steps


def _backdrop() -> Mesh:
    """Paper that runs over the floor and bends upwards behind."""
    radius, front, half = 2.5, 7.0, 9.9
    back = _BACK + radius
    angle = np.linspace(0, np.pi / 2, 24)
    y = np.concatenate([[0.0], radius * (1 - np.cos(angle)), [9.0]])
    z = np.concatenate([[front], back - radius * np.sin(angle), [back - radius]])
    slope = np.concatenate([[0.0], angle, [np.pi / 2]])
    normal = np.stack([np.zeros_like(slope), np.cos(slope), np.sin(slope)], axis=-1)
    ends = [np.stack([np.full_like(y, x), y, z], axis=-1) for x in (-half, half)]
    count = len(y)
    first = np.arange(count - 1)
    left, right = first, first + count
    faces = np.concatenate([np.stack([left, right, right + 1], -1), np.stack([left, right + 1, left + 1], -1)])
    return Mesh(
        vertices=np.concatenate(ends), faces=faces, normals=np.tile(normal, (2, 1)), material=_PAPER, name="backdrop"
    )


def _softbox(centre: Any, target: Any, width: float, height: float, radiance: Any, name: str) -> Mesh:
    """A lamp that shines towards a point."""
    centre = np.asarray(centre, float)
    ahead = np.asarray(target, float) - centre
    ahead /= np.linalg.norm(ahead)
    across = np.cross(ahead, (0.0, 1.0, 0.0))
    across *= width / 2 / np.linalg.norm(across)
    up = np.cross(across, ahead)
    up *= height / 2 / np.linalg.norm(up)
    corners = [centre - across - up, centre - across + up, centre + across + up, centre + across - up]
    return quads(corners, material=Material(emission=radiance, name=name), two_sided=False, name=name)


def materials() -> Scene:
    """Thirty-five balls of the principled material.

    From the back: gold and plastic from polished to rough, lacquer under a coat that grows rough, cloth and films of
    oil, and glass: clear to frosted, tinted inside, and a bubble.
    """
    return _studio(_rows(), "materials")


def material_grid() -> Scene:
    """The principled material over `roughness`, from left to right, and `metallic`, from the front to the back.

    Before it lies a row of clear glass whose index of refraction rises from 1.1 to 2.3.
    """
    glass = [Dielectric(ior=round(1.1 + 0.2 * column, 1), name=f"ior {1.1 + 0.2 * column:.1f}") for column in range(7)]
    grid = [
        [
            Principled(base_color=_COPPER, metallic=metallic, roughness=share, name=f"{metallic:.2f} {share:.2f}")
            for share in _shares()
        ]
        for metallic in (0.0, 1 / 3, 2 / 3, 1.0)
    ]
    return _studio([glass, *grid], "material-grid")


def _studio(rows: Sequence[Sequence[Dielectric | Principled]], name: str) -> Scene:
    """Rows of balls, the first in front."""
    balls = [_ball(row, column, material) for row, line in enumerate(rows) for column, material in enumerate(line)]
    middle = (0.0, 1.0, -2.0)
    lamps = [
        _softbox((-6.5, 6.5, 3.5), middle, 6.0, 6.0, (7.6, 7.2, 6.5), "key"),
        _softbox((7.5, 4.5, 1.5), middle, 3.5, 6.0, (3.6, 4.0, 4.5), "fill"),
        _softbox((0.0, 8.5, -5.5), (0.0, 0.0, -2.0), 9.0, 3.0, (4.2, 4.2, 4.2), "top"),
    ]
    return Scene(
        shapes=[_backdrop(), _tiles(), *_steps(len(rows)), *balls, *lamps],
        cameras=[Camera.look_at((0.0, 6.6, 15.0), (0.0, 1.0, -2.0), fov=17.5, aspect=1.5)],
        environment=Environment(image=np.full((4, 8, 3), 0.4, np.float32), name="dim"),
        name=name,
    )
