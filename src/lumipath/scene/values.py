"""Validated small values of a scene: colours, points, matrices, float arrays."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

COORDINATE_LIMIT = 1e12
"""Beyond it products of coordinates overflow float32."""


def float_array(value: ArrayLike, shape: tuple[int | None, ...], name: str, limit: float = COORDINATE_LIMIT) -> Floats:
    """`value` as contiguous float32 of the given shape (None: any length), every number finite and below `limit`.

    Raises:
        SceneError: another shape, a NaN, an infinity or an absurd number; the message gives the first bad index.
    """
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{name} must be numbers: {error}") from None
    if array.ndim != len(shape) or any(want is not None and have != want for have, want in zip(array.shape, shape)):
        wanted = " x ".join("N" if side is None else str(side) for side in shape)
        have = " x ".join(map(str, array.shape)) or "a single number"
        raise SceneError(f"{name} must have the shape {wanted}, not {have}")
    bad = ~(np.abs(array) <= limit)
    if bad.any():
        index = [int(i) for i in np.argwhere(bad)[0]]
        raise SceneError(f"{name}{index} is {array[tuple(index)]}: it must be finite and at most {limit:g}")
    return np.ascontiguousarray(array, dtype=np.float32)


def index_array(value: ArrayLike, columns: int, count: int, name: str) -> Ints:
    """`value` as contiguous int32 of shape (N, columns), each in 0 .. count - 1.

    Raises:
        SceneError: another shape, no integers, or an index out of range.
    """
    array = np.asarray(value)
    if array.size == 0:
        return np.zeros((0, columns), np.int32)
    if array.ndim != 2 or array.shape[1] != columns or array.dtype.kind not in "iu":
        raise SceneError(f"{name} must be whole numbers of the shape N x {columns}")
    bad = (array < 0) | (array >= count)
    if bad.any():
        row, column = (int(i) for i in np.argwhere(bad)[0])
        raise SceneError(
            f"{name}[{row}] names vertex {array[row, column]}, but there are {count} vertices (0 to {count - 1})"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def colour(value: Any, name: str, high: float = 1e12) -> tuple[float, float, float]:
    """Three numbers from 0 to `high`; one number stands for three equal ones.

    Raises:
        SceneError: anything else.
    """
    values = (value,) * 3 if isinstance(value, (int, float)) and not isinstance(value, bool) else value
    array = float_array(values, (3,), name)
    if (array < 0).any() or (array > high).any():
        raise SceneError(f"{name} is {tuple(array.tolist())}: each part must be from 0 to {high:g}")
    return (float(array[0]), float(array[1]), float(array[2]))


def group_name(value: Any, name: str) -> str:
    """The name of a light group: letters, digits, - and _; empty for none.

    Raises:
        SceneError: anything else.
    """
    if not isinstance(value, str) or not re.fullmatch("[A-Za-z0-9_-]*", value):
        raise SceneError(f"{name} is {value!r}: it must be a name of letters, digits, - and _")
    return value


def affine(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """`value` as an invertible 4 x 4 matrix whose last row is (0, 0, 0, 1), float64.

    Raises:
        SceneError: another shape, a projective or a singular matrix.
    """
    float_array(value, (4, 4), name)
    matrix = np.array(value, dtype=np.float64)
    if not np.array_equal(matrix[3], (0.0, 0.0, 0.0, 1.0)):
        raise SceneError(f"{name}: the last row must be (0, 0, 0, 1): projective transforms are not possible")
    scale = np.abs(matrix[:3, :3]).max()
    if scale == 0 or abs(np.linalg.det(matrix[:3, :3] / scale)) < 1e-12:
        raise SceneError(f"{name} is singular: it flattens space; use a scale other than 0")
    return matrix
