"""A thousand lamps of very different brightness: lanterns over a lake between hills, at night."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scene import Camera, Cone, Cylinder, Material, Mesh, Scene, Sphere, smooth_normals
from ..scene.shapes import Shape
from ._build import UPRIGHT, quads, scale, translate

_ON_LAND = 560
_ON_WATER = 140
_IN_THE_AIR = 300
_HUTS = (
    (-3.4, -1.2, 0.42),
    (-2.5, -2.6, 0.36),
    (3.6, -2.0, 0.45),
    (4.6, -0.6, 0.38),
    (1.9, -4.4, 0.34),
    (-5.2, 0.6, 0.4),
)
_COLOURS = ((1.0, 0.42, 0.1), (1.0, 0.6, 0.25), (1.0, 0.75, 0.45), (1.0, 0.18, 0.06), (0.35, 0.8, 1.0))
_SHARES = (0.4, 0.3, 0.17, 0.08, 0.05)


def _height(x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the land, metres; below 0 lies the lake."""
    shore = (x / 3.2) ** 2 + ((z - 1.2) / 3.4) ** 2 - 1
    hills = 0.35 * np.tanh(shore) + 0.13 * np.maximum(shore, 0) ** 0.8
    waves = 0.12 * np.sin(1.3 * x + 0.6) * np.cos(1.1 * z) + 0.05 * np.sin(2.9 * x - 1.7 * z)
    return hills + waves * np.clip(shore, 0, 1)


def _land(count: int = 97) -> Mesh:
    """A smooth grid of `count` x `count` vertices."""
    x, z = np.meshgrid(np.linspace(-9.5, 9.5, count), np.linspace(-9.5, 9.5, count), indexing="ij")
    vertices = np.stack([x, _height(x, z), z], -1).reshape(-1, 3).astype(np.float32)
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3).astype(np.int32)
    material = Material(diffuse=(0.34, 0.37, 0.3), name="grass")
    return Mesh(vertices=vertices, faces=faces, normals=smooth_normals(vertices, faces), material=material, name="land")


def _hut(x: float, z: float, size: float) -> list[Shape]:
    """A round hut with a pointed roof."""
    y = float(_height(np.array(x), np.array(z))) - 0.05
    wall = Material(diffuse=(0.55, 0.48, 0.4), name="wall")
    roof = Material(diffuse=(0.4, 0.17, 0.1), name="roof")
    return [
        Cylinder(transform=translate(x, y, z) @ UPRIGHT @ scale(size, size, 1.1 * size), material=wall, name="hut"),
        Cone(
            bottom_radius=1.35 * size,
            height=1.1 * size,
            transform=translate(x, y + 1.05 * size, z) @ UPRIGHT,
            material=roof,
            name="roof",
        ),
    ]


def _places(rng: np.random.Generator) -> NDArray[np.float64]:
    """(1000, 3): the lowest points of the lanterns; those on land come first."""
    x, z = rng.uniform(-8, 8, 20_000), rng.uniform(-8, 5.5, 20_000)
    y = _height(x, z)
    # Lanterns stand closer together near the shore.
    land = np.nonzero((y > 0.02) & (rng.random(len(x)) < np.exp(-1.2 * y)))[0][:_ON_LAND]
    water = np.nonzero(y < -0.06)[0][:_ON_WATER]
    shore = np.stack([x, y + rng.uniform(0.12, 0.4, len(x)), z], -1)
    afloat = np.stack([x, np.full(len(x), 0.01), z], -1)
    # Those in the air rise from the left shore and drift to the right.
    age = rng.random(_IN_THE_AIR) ** 0.7
    air = np.stack(
        [
            -4.5 + 9 * age + rng.normal(0, 1.1, _IN_THE_AIR),
            0.8 + 3.6 * age**1.3 + rng.normal(0, 0.35, _IN_THE_AIR),
            -2.5 - 3 * age + rng.normal(0, 1.3, _IN_THE_AIR),
        ],
        -1,
    )
    return np.concatenate([shore[land], afloat[water], np.maximum(air, (-8, 0.6, -8))])


def _times(factor: float, colour: tuple[float, float, float]) -> tuple[float, float, float]:
    red, green, blue = colour
    return (factor * red, factor * green, factor * blue)


def _lanterns() -> list[Shape]:
    rng = np.random.default_rng(5)
    places = _places(rng)
    radii = rng.uniform(0.018, 0.06, len(places))
    # The brightest are a thousand times as bright as the dimmest.
    radiances = 10 ** np.clip(rng.normal(0.6, 0.6, len(places)), -1.0, 2.0)
    colours = rng.choice(len(_COLOURS), len(places), p=_SHARES)
    lanterns: list[Shape] = [
        Sphere(
            transform=translate(x, y + radius, z) @ scale(radius),
            material=Material(emission=_times(radiance, _COLOURS[colour]), name="lantern"),
            name="lantern",
        )
        for (x, y, z), radius, radiance, colour in zip(places.tolist(), radii, radiances, colours, strict=True)
    ]
    return lanterns + [_post(*place) for place in places[:_ON_LAND].tolist()]


_WOOD = Material(diffuse=(0.2, 0.15, 0.1), name="wood")


def _post(x: float, y: float, z: float) -> Shape:
    """What a lantern on land stands on."""
    foot = float(_height(np.array(x), np.array(z)))
    size = scale(0.006, 0.006, y - foot)
    return Cylinder(transform=translate(x, foot, z) @ UPRIGHT @ size, material=_WOOD, name="post")


def many_lamps() -> Scene:
    """Lanterns on the shore, on the water, and in the air.

    Each point of the land is lit by a few of the thousand lamps only, by others than its neighbour. Compare
    `--light-sampling uniform`, `power` and `tree`, the default here, with few samples.
    """
    lake = quads(
        ((-6, 0, 6), (6, 0, 6), (6, 0, -4), (-6, 0, -4)),
        material=Material(diffuse=(0.0, 0.0, 0.0), specular=(0.5, 0.56, 0.6), name="water"),
        name="lake",
    )
    huts = [shape for place in _HUTS for shape in _hut(*place)]
    camera = Camera.look_at((0.6, 1.7, 8.6), (0.1, 0.75, -1.0), fov=36.0, aspect=1.6)
    return Scene(shapes=[_land(), lake, *huts, *_lanterns()], cameras=[camera], name="many-lamps")
