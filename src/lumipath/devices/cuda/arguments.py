"""What kernels are called with: its Numba types, and the way to the GPU."""

from __future__ import annotations

from typing import Any, get_type_hints

import numba
import numpy as np
from numba import types

from ...lang.struct import SCALAR_TYPES
from ...pack.layout import FilmArrays, LayerArrays, LayerColumns, View
from .driver import DeviceArray


def type_of(value: Any) -> types.Type:
    """The Numba type of a value whose arrays may be on the GPU."""
    if isinstance(value, DeviceArray | np.ndarray):
        return types.Array(numba.from_dtype(value.dtype), len(value.shape), "C")
    if isinstance(value, tuple):
        return types.NamedTuple(tuple(type_of(item) for item in value), type(value))
    return numba.typeof(value)


def to_device(value: Any) -> Any:
    """A NamedTuple with its arrays on the GPU."""
    if isinstance(value, np.ndarray):
        return DeviceArray.of(value)
    if isinstance(value, tuple):
        return type(value)(*(to_device(item) for item in value))  # type: ignore[call-arg]
    return value


# All but the lens are numbers.
VIEW_TYPE = types.NamedTuple(
    [SCALAR_TYPES.get(kind, types.Array(types.float32, 1, "C")) for kind in get_type_hints(View).values()], View
)
FILM_TYPE = types.NamedTuple(
    (
        *([types.Array(types.float32, 3, "C")] * 2),
        *(types.Array(kind, 2, "C") for kind in (types.uint32, types.float32, types.int32)),
        *([types.Array(types.float32, 3, "C")] * 2),
    ),
    FilmArrays,
)
LAYERS_TYPE = types.NamedTuple(
    (
        types.Array(types.float32, 3, "C"),
        *([types.Array(types.uint32, 2, "C")] * 2),
        *([types.Array(types.int32, 2, "C")] * 2),
        types.NamedTuple([types.int32] * len(LayerColumns._fields), LayerColumns),
        types.int32,
    ),
    LayerArrays,
)
