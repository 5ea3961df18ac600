"""Feature masks: what a scene uses, as part of its type.

`Features(mask)` is a field of the packed scene. Its mask belongs to the Numba type, so code for textures, quadrics or
an environment is compiled only into kernels for scenes that have them, and scenes with equal masks share kernels.
"""

from __future__ import annotations

import inspect
from types import FunctionType
from typing import Any

from numba import types
from numba.core.datamodel import models
from numba.extending import NativeValue, register_model, typeof_impl, unbox

from .scalars import DEBUG_PYTHON
from .targets import Target, on_each_target


class Features:
    """A set of feature bits with value semantics."""

    __slots__ = ("mask",)

    def __init__(self, mask: int) -> None:
        self.mask = int(mask)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Features) and other.mask == self.mask

    def __hash__(self) -> int:
        return hash(self.mask)

    def __repr__(self) -> str:
        return f"Features({self.mask:#x})"

    def __reduce__(self) -> tuple[type[Features], tuple[int]]:
        return Features, (self.mask,)


class FeaturesType(types.Type):
    """The Numba type of `Features`; holds nothing at run time."""

    def __init__(self, mask: int) -> None:
        self.mask = mask
        super().__init__(name=f"Features({mask:#x})")


@register_model(FeaturesType)
class _FeaturesModel(models.OpaqueModel):
    pass


@typeof_impl.register(Features)
def _typeof_features(value: Features, context: Any) -> FeaturesType:
    return FeaturesType(value.mask)


@unbox(FeaturesType)
def _unbox_features(kind: FeaturesType, value: Any, context: Any) -> NativeValue:
    return NativeValue(context.context.get_dummy_value())


def features_of(kind: Any) -> int:
    """The feature mask of a packed scene, or of its Numba type."""
    if isinstance(kind, types.NamedTuple):
        return kind.types[kind.fields.index("features")].mask
    return kind.features.mask


def select_by_features(
    function: FunctionType, needs: int, otherwise: Any, options: dict[str, Any], cpu_options: dict[str, Any]
) -> Any:
    """A function that is `function` for scenes with a bit of `needs`, else `otherwise`; see `kernel`.

    Numba compiles it with `options`, for the CPU with `cpu_options` as well.
    """
    parameters = list(inspect.signature(function).parameters)

    def resolve(mask: int) -> FunctionType:
        if mask & needs:
            return function
        # `otherwise` may be selected by features in its turn.
        chosen = otherwise.resolve(mask) if hasattr(otherwise, "resolve") else otherwise
        return getattr(chosen, "py_func", chosen)

    if list(inspect.signature(resolve(0)).parameters) != parameters:
        raise TypeError(f"{resolve(0).__qualname__} must have the parameters of {function.__qualname__}")

    def stub(scene: Any, *rest: Any) -> Any:
        return resolve(features_of(scene))(scene, *rest)

    stub.__name__ = function.__name__
    stub.__qualname__ = function.__qualname__
    stub.__module__ = function.__module__
    stub.__doc__ = function.__doc__
    stub.resolve = resolve  # type: ignore[attr-defined]
    # Numba matches the parameters of the chooser with those of the implementation by name.
    namespace = {"features_of": features_of, "resolve": resolve}
    exec(
        f"def choose({', '.join(parameters)}):\n    return resolve(features_of({parameters[0]}))",
        namespace,
    )

    def install(target: Target) -> None:
        chosen = options | cpu_options if target.name == "cpu" else options
        target.extending.overload(stub, jit_options=chosen, strict=False)(namespace["choose"])

    if not DEBUG_PYTHON:
        on_each_target(install)
    return stub
