"""NamedTuples of arrays that kernels hand on as one value.

Numba takes a NamedTuple apart wherever a function is called with it, and puts it together again inside. A packed scene
is 266 values, and each of the 120 to 190 functions that see it has their types in its name, which are 800 letters.
All of it goes when the functions are inlined, but it was a third of the time that a renderer took to compile. So the
functions that Python calls make their arguments whole first, and all others pass them on as they are.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from types import FunctionType
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.datamodel import models

from .intrinsic import intrinsic
from .targets import Target, on_each_target


class WholeTuple(types.NamedTuple):
    """The Numba type of a NamedTuple that is not taken apart when a function is called with it.

    Its name, which is part of the names of all functions that take one, is short: the class and a digest of its fields.
    """

    def __init__(self, kind: types.NamedTuple) -> None:
        super().__init__([whole_type(field) for field in kind.types], kind.instance_class)
        python_class = kind.instance_class
        all_of_it = f"{python_class.__module__}.{python_class.__qualname__}: {kind.name}"
        self.name = f"{python_class.__name__}_{hashlib.sha256(all_of_it.encode()).hexdigest()[:16]}"

    @property
    def key(self) -> str:
        """By which Numba compares types."""
        return self.name


class WholeModel(models.StructModel):
    """Data model of a `WholeTuple`: that of the NamedTuple, but one argument."""

    def __init__(self, manager: Any, kind: WholeTuple) -> None:
        super().__init__(manager, kind, [(f"f{k}", field) for k, field in enumerate(kind.types)])

    def get_argument_type(self) -> ir.Type:
        """What a function takes."""
        return self.get_value_type()

    def as_argument(self, builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
        """What a function is called with."""
        return value

    def from_argument(self, builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
        """What a function makes of it."""
        return value


@on_each_target
def _install(target: Target) -> None:
    target.extending.register_model(WholeTuple)(WholeModel)


def whole_type(kind: types.Type) -> types.Type:
    """The type of `whole` of a value: its own, unless it is a NamedTuple of different types."""
    # Of equal types it is an array for Numba (a NamedUniTuple) and no struct; those here are short.
    return WholeTuple(kind) if type(kind) is types.NamedTuple else kind


@intrinsic(lambda value: value)
def whole(value: types.Type) -> Any:
    """`value`; if it is a NamedTuple, it and those in it will be passed on whole."""

    def emit(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        return arguments[0]

    return whole_type(value), emit


def taking_whole(function: FunctionType, inner: Callable[..., Any]) -> FunctionType:
    """A function that calls `inner` with its arguments made whole, and passes for `function` otherwise."""
    parameters = list(inspect.signature(function).parameters)
    given = ", ".join(f"whole({name})" for name in parameters)
    namespace: dict[str, Any] = {"__name__": function.__module__}
    exec(
        f"def make(inner, whole):\n"
        f"    def outer({', '.join(parameters)}):\n"
        f"        return inner({given})\n"
        f"    return outer",
        namespace,
    )
    outer = namespace["make"](inner, whole)
    for name in ("__name__", "__qualname__", "__doc__"):
        setattr(outer, name, getattr(function, name))
    return outer
