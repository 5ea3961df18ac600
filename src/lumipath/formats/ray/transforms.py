"""Transforms of .ray files: translate, rotate, scale and transform, each around one piece of geometry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SceneError
from ...scene.values import affine
from .nodes import Block, Call, described, offset_of
from .number_lists import counted
from .source import Source
from .values import read_number, read_vector

Matrix = NDArray[np.float64]


def _translation(offset: list[Any]) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def _scaling(factors: list[Any]) -> Matrix:
    return np.diag([*(factors * 3)[:3], 1.0])


def _rotation(numbers: list[Any]) -> Matrix:
    """Rotation about an axis by an angle in radians, counter-clockwise seen against the axis (Rodrigues' formula)."""
    *axis, angle = numbers
    length = np.linalg.norm(axis)
    if length == 0:
        raise SceneError("rotate: the axis is (0, 0, 0): it must point somewhere")
    x, y, z = np.asarray(axis) / length
    cross = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return matrix


_row = read_vector(4, "one row of the matrix")
# Keyword: how many arguments may come before the geometry, how each is read, what they make together, and the usage.
TRANSFORMS: dict[str, tuple[tuple[int, ...], Any, Callable[[list[Any]], Matrix], str]] = {
    "translate": ((3,), read_number, _translation, "translate(x, y, z, geometry)"),
    "rotate": ((4,), read_number, _rotation, "rotate(axis x, axis y, axis z, radians, geometry)"),
    "scale": ((1, 3), read_number, _scaling, "scale(factor, geometry) or scale(x, y, z, geometry)"),
    "transform": ((4,), _row, np.array, "transform((row 1), (row 2), (row 3), (row 4), geometry)"),
}


def read_transform(source: Source, call: Call) -> tuple[Matrix, Call | Block]:
    """The 4 x 4 float64 matrix (for column vectors) of a transform, and the geometry that it moves.

    Raises:
        SceneError: wrong arguments, no geometry, or a matrix that cannot be inverted.
    """
    counts, read, compose, usage = TRANSFORMS[call.name]
    *numbers, geometry = call.arguments
    if not isinstance(geometry, (Call, Block)):
        raise source.error(f"found {described(geometry)}, expected geometry: {usage}", offset_of(geometry))
    values = [read(source, number, call.name) for number in numbers]
    if len(values) not in counts:
        raise source.error(f"found {counted(len(values), 'argument')} and geometry, expected {usage}", offset_of(call))
    with source.placing(offset_of(call)):
        return affine(compose(values), str(call.name)), geometry
