"""A forest: three trees, each stored once, at a thousand places.

A tree grows in four levels, all branches of a level at once: a trunk, its boughs, their branches, and twigs with
leaves. About a hundred thousand triangles make one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import Camera, DirectionalLight, Group, Instance, Material, Mesh, Scene, smooth_normals
from ._build import rotate, scale, sky, translate

Array = NDArray[np.float64]

_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
_UP = np.array((0.0, 1.0, 0.0))

_BARK = Material(diffuse=(0.13, 0.09, 0.065), name="bark")
_SOIL = Material(diffuse=(0.11, 0.13, 0.05), name="forest floor")

# Metres: how far trees stand apart across and along the view, and the nearest row.
_ROW, _COLUMN, _NEAREST = 4.2, 4.6, -6.0
_COLUMNS = 40


@frozen
class _Species:
    """How a kind of tree grows: metres, and degrees between a branch and what bears it."""

    name: str
    leaf: tuple[float, float, float]
    height: float
    reach: float  # of the longest boughs
    widest: float  # fraction of the crown's height at which they are
    fullness: float  # 1: boughs get shorter evenly towards the ends of the crown; less: later
    angle: float
    lift: float  # how much branches bend upwards
    leaf_length: float


_SPECIES = (
    _Species("beech", (0.13, 0.27, 0.05), 8.0, 2.7, 0.35, 0.5, 62.0, 0.25, 0.17),
    _Species("spruce", (0.045, 0.13, 0.055), 10.0, 2.2, 0.02, 1.0, 84.0, -0.12, 0.13),
    _Species("maple", (0.48, 0.19, 0.035), 7.0, 2.9, 0.45, 0.5, 52.0, 0.3, 0.19),
)


@frozen(eq=False)
class _Branches:
    """B branches: where they begin (B, 3), unit directions (B, 3), lengths (B,), radii there (B,), and their lift."""

    start: Array
    direction: Array
    length: Array
    radius: Array
    lift: float

    def at(self, branch: Any, part: Array) -> tuple[Array, Array]:
        """Points (..., 3) of branches at a part of their length, and unit directions there."""
        along, length = self.direction[branch], self.length[branch][..., None]
        s = part[..., None]
        point = self.start[branch] + length * (along * s + self.lift * s * s * _UP)
        return point, _unit(along + 2 * self.lift * s * _UP)


def _unit(v: Array) -> Array:
    unit: Array = v / np.linalg.norm(v, axis=-1, keepdims=True)
    return unit


def _across(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors that stand upright on each direction and on each other."""
    # Any axis will do that is not along the direction.
    axis = np.where(np.abs(direction[..., :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    first = _unit(np.cross(direction, axis))
    return first, np.cross(direction, first)


def _tubes(branches: _Branches, segments: int, sides: int) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (N, 3) and faces (M, 3) of tubes that end in a point."""
    count = len(branches.length)
    part = np.linspace(0, 1, segments + 1)
    points, _ = branches.at(np.arange(count)[:, None], np.broadcast_to(part, (count, segments + 1)))
    first, second = (axis[:, None, None] for axis in _across(branches.direction))
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    radius = branches.radius[:, None] * (1 - 0.92 * part)
    vertices = points[:, :, None] + radius[..., None, None] * ring
    index = np.arange(count * (segments + 1) * sides).reshape(count, segments + 1, sides)
    a, b = index[:, :-1], np.roll(index, -1, axis=2)[:, :-1]
    d, c = index[:, 1:], np.roll(index, -1, axis=2)[:, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return vertices.reshape(-1, 3), faces.astype(np.int32)


def _grown(
    parents: _Branches, each: int, begin: float, length: Any, angle: float, lift: float, rng: np.random.Generator
) -> _Branches:
    """The branches that grow on others: `each` on one, from the part `begin` on, turned by the golden angle.

    Args:
        parents: which bear them.
        each: how many each bears.
        begin: part of the parent's length at which the first one grows.
        length: of a branch, as a function of how far up it grows, from 0 (the first) to 1.
        angle: degrees between a branch and its parent.
        lift: how much they bend upwards.
        rng: for what nature leaves to chance.
    """
    count = len(parents.length)
    bearer = np.repeat(np.arange(count), each)
    place = np.tile((np.arange(each) + 0.5) / each, count) + rng.uniform(-0.4, 0.4, count * each) / each
    part = begin + (0.98 - begin) * place
    start, along = parents.at(bearer, part)
    turn = np.tile(np.arange(each), count) * _GOLDEN_ANGLE + np.repeat(rng.uniform(0, 2 * np.pi, count), each)
    tilt = np.radians(angle + rng.normal(0, 7, count * each)) * (1 - 0.35 * place)
    first, second = _across(along)
    outward = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    direction = _unit(np.cos(tilt)[:, None] * along + np.sin(tilt)[:, None] * outward)
    lengths = length(place, parents.length[bearer]) * rng.uniform(0.8, 1.2, count * each)
    radius = np.minimum(0.03 * lengths, parents.radius[bearer] * (1 - 0.92 * part))
    return _Branches(start, direction, lengths, radius, lift)


def _leaves(twigs: _Branches, each: int, length: float, rng: np.random.Generator) -> tuple[Array, NDArray[np.int32]]:
    """Vertices and faces of leaves: two triangles each, folded a little along the middle."""
    count = len(twigs.length) * each
    bearer = np.repeat(np.arange(len(twigs.length)), each)
    stem, along = twigs.at(bearer, rng.uniform(0.1, 1.05, count))
    first, second = _across(along)
    turn = rng.uniform(0, 2 * np.pi, count)[:, None]
    outward = np.cos(turn) * first + np.sin(turn) * second
    direction = _unit(0.6 * along + outward + rng.normal(0, 0.25, (count, 3)))
    side = _unit(np.cross(direction, _UP + rng.normal(0, 0.45, (count, 3))))
    face = np.cross(side, direction)
    size = length * rng.uniform(0.7, 1.2, (count, 1))
    middle = stem + 0.45 * size * direction + 0.08 * size * face
    corners = [stem, middle + 0.3 * size * side, stem + size * direction, middle - 0.3 * size * side]
    vertices = np.stack(corners, axis=1).reshape(-1, 3)
    starts = 4 * np.arange(count)[:, None]
    faces = np.stack([starts + (0, 1, 2), starts + (0, 2, 3)], axis=1).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


def _tree(species: _Species, twigs: int, seed: int) -> Group:
    """A tree whose root is the origin, with `twigs` on each branch; wood and leaves."""
    rng = np.random.default_rng(seed)

    def bough_length(up: Array, _: Array) -> Array:
        """Longest where the crown is widest, short at its top."""
        towards = np.where(up < species.widest, up / max(species.widest, 1e-6), (1 - up) / (1 - species.widest))
        crown: Array = species.reach * (0.12 + 0.88 * np.clip(towards, 0, 1) ** species.fullness)
        return crown

    def share(part: float) -> Any:
        return lambda up, parent: part * parent * (1.1 - 0.6 * up)

    trunk = _Branches(
        np.zeros((1, 3)), _UP[None], np.array([species.height]), np.array([0.022 * species.height]), lift=0.0
    )
    boughs = _grown(trunk, 40, 0.2, bough_length, species.angle, species.lift, rng)
    branches = _grown(boughs, 12, 0.2, share(0.45), 55.0, 0.5 * species.lift, rng)
    ends = _grown(branches, twigs, 0.15, share(0.5), 50.0, 0.0, rng)
    parts = [_tubes(trunk, 12, 10), _tubes(boughs, 6, 6), _tubes(branches, 4, 5), _tubes(ends, 1, 3)]
    firsts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([faces + np.int32(first) for (_, faces), first in zip(parts, firsts)])
    wood = Mesh(vertices=vertices, faces=faces, normals=smooth_normals(vertices, faces), material=_BARK, name="wood")
    vertices, faces = _leaves(ends, 7, species.leaf_length, rng)
    green = Material(diffuse=species.leaf, name=f"{species.name} leaf")
    return Group([wood, Mesh(vertices=vertices, faces=faces, material=green, name="leaves")], name=species.name)


def _height(x: Any, z: Any) -> Any:
    """Height of the ground: gentle hills, higher far away."""
    return 1.6 * np.sin(x / 17.0 + 0.4) * np.cos(z / 23.0) + 0.9 * np.sin(z / 9.0 + x / 31.0) - 0.06 * np.minimum(z, 0)


def _ground(steps: int = 96) -> Mesh:
    x, z = np.meshgrid(np.linspace(-130, 130, steps), np.linspace(30, -150, steps))
    vertices = np.stack([x, _height(x, z), z], axis=-1).reshape(-1, 3)
    index = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
    return Mesh(
        vertices=vertices, faces=faces, normals=smooth_normals(vertices, faces), material=_SOIL, name="forest floor"
    )


def _places(count: int, rng: np.random.Generator) -> Array:
    """(count, 2) x and z of trees: rows of them, shaken."""
    row, column = np.divmod(np.arange(count), _COLUMNS)
    x = (column - (_COLUMNS - 1) / 2 + 0.5 * (row % 2)) * _COLUMN + rng.uniform(-1.6, 1.6, count)
    z = _NEAREST - row * _ROW + rng.uniform(-1.4, 1.4, count)
    return np.stack([x, z], axis=1)


def forest(trees: int = 1000, twigs: int = 8) -> Scene:
    """A thousand trees of three kinds, each kind stored once, in the sun of a late afternoon.

    Args:
        trees: how many.
        twigs: on each branch of a tree; 8 make about 100,000 triangles.
    """
    rng = np.random.default_rng(2)
    kinds = [_tree(species, twigs, seed) for seed, species in enumerate(_SPECIES)]
    # Spruces stand together more often than not.
    x, z = _places(trees, rng).T
    wood = np.sin(x / 13.0) + np.sin(z / 11.0 + 1.0) + rng.normal(0, 0.9, trees)
    chosen = np.where(wood > 0.5, 1, np.where(wood < -1.3, 2, 0))
    turns, sizes, leans = rng.uniform(0, 360, trees), rng.uniform(0.75, 1.25, trees), rng.normal(0, 2.0, trees)
    placed = [
        Instance(
            kinds[chosen[k]],
            transform=translate(x[k], _height(x[k], z[k]) - 0.1, z[k])
            @ rotate("y", turns[k])
            @ rotate("x", leans[k])
            @ scale(sizes[k]),
            name=f"{kinds[chosen[k]].name} {k}",
        )
        for k in range(trees)
    ]
    sun = DirectionalLight(direction=(-0.85, -0.55, -0.12), colour=(3.0, 2.4, 1.7))
    camera = Camera.look_at((5.0, 12.5, 11.0), (0.0, 5.0, -16.0), fov=44.0, aspect=1.6)
    return Scene(shapes=[_ground(), *placed], lights=[sun], cameras=[camera], environment=sky(0.7), name="forest")
