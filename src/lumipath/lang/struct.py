"""Value types: `@struct` turns an annotated class into one that kernels pass in registers."""

from __future__ import annotations

from typing import Any, get_type_hints

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models

from .scalars import f32, i32, u32
from .targets import Target, on_each_target, register_callable

SCALAR_TYPES: dict[Any, types.Type] = {
    f32: types.float32,
    i32: types.int32,
    u32: types.uint32,
    bool: types.boolean,
}


class StructType(types.Type):
    """The Numba type of a `@struct` class."""

    def __init__(self, python_class: type, fields: tuple[tuple[str, types.Type], ...]) -> None:
        self.python_class = python_class
        self.fields = fields
        super().__init__(name=f"{python_class.__module__}.{python_class.__qualname__}")

    def index(self, field: str) -> int:
        """Position of the field of that name, -1 if there is none."""
        return next((k for k, (name, _) in enumerate(self.fields) if name == field), -1)


class StructModel(models.StructModel):
    """Data model of a `@struct`: its fields, in order, and what lies between them.

    LLVM moves a struct as one piece where it would leave gaps otherwise, and neither takes it apart afterwards nor
    compiles a loop with it for many rounds at once. So the bytes after a bool are fields, too.
    """

    def __init__(self, manager: Any, kind: StructType) -> None:
        members: list[tuple[str, types.Type]] = []
        for name, field in kind.fields:
            members.append((name, field))
            if field == types.boolean:
                members += [(f"_after_{name}_{k}", types.uint8) for k in range(3)]
        super().__init__(manager, kind, members)


def numba_type(annotation: Any) -> types.Type:
    """The Numba type of a field's annotation: f32, i32, u32, bool or another struct."""
    if annotation in SCALAR_TYPES:
        return SCALAR_TYPES[annotation]
    try:
        return annotation.numba_type
    except AttributeError:
        raise TypeError(f"a struct field is f32, i32, u32, bool or another struct, not {annotation!r}") from None


def struct(python_class: type) -> Any:
    """Class decorator: an immutable value type with the annotated fields, constructed by position.

    The same class works in plain Python, where its fields are attributes.
    """
    hints = get_type_hints(python_class)
    fields = tuple((name, numba_type(hint)) for name, hint in hints.items())
    names = tuple(hints)
    scalars = tuple(hint if hint in (f32, i32, u32) else None for hint in hints.values())

    def construct(self: Any, *values: Any) -> None:
        if len(values) != len(names):
            raise TypeError(f"{python_class.__name__} takes {len(names)} values: {', '.join(names)}")
        for name, scalar, value in zip(names, scalars, values):
            object.__setattr__(self, name, scalar(value) if scalar else value)

    def show(self: Any) -> str:
        return f"{python_class.__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    def equal(self: Any, other: Any) -> bool:
        return type(self) is type(other) and all(getattr(self, name) == getattr(other, name) for name in names)

    body = {key: value for key, value in vars(python_class).items() if key not in ("__dict__", "__weakref__")}
    body |= {"__slots__": names, "__init__": construct, "__repr__": show, "__eq__": equal, "__hash__": None}
    made: Any = type(python_class.__name__, (), body)
    made.numba_type = StructType(made, fields)
    on_each_target(lambda target: _install(target, made, made.numba_type))
    return made


def _install(target: Target, python_class: Any, kind: StructType) -> None:
    """Teach a target the constructor of one struct."""

    class Constructor(target.templates.AbstractTemplate):
        def generic(self, arguments: tuple[types.Type, ...], keywords: dict[str, types.Type]) -> Any:
            if len(arguments) == len(kind.fields) and not keywords:
                return target.templates.signature(kind, *arguments)
            return None

    Constructor.__name__ = f"{python_class.__name__}Constructor"
    register_callable(target, python_class, Constructor)

    def build(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
        value = cgutils.create_struct_proxy(kind)(context, builder)
        for (name, field_type), argument, given in zip(kind.fields, arguments, signature.args):
            setattr(value, name, context.cast(builder, argument, given, field_type))
        return value._getvalue()

    target.extending.lower_builtin(python_class, *([types.Any] * len(kind.fields)))(build)

    @target.extending.typeof_impl.register(python_class)
    def typeof_struct(value: Any, context: Any) -> StructType:
        return kind


@on_each_target
def _install_attributes(target: Target) -> None:
    """Teach a target to read the fields of any struct."""
    target.extending.register_model(StructType)(StructModel)

    class StructAttributes(target.templates.AttributeTemplate):
        key = StructType

        def generic_resolve(self, kind: StructType, attribute: str) -> types.Type | None:
            position = kind.index(attribute)
            return kind.fields[position][1] if position >= 0 else None

    target.templates.infer_getattr(StructAttributes)

    @target.imputils.lower_getattr_generic(StructType)
    def read_field(context: Any, builder: ir.IRBuilder, kind: StructType, value: ir.Value, attribute: str) -> ir.Value:
        return builder.extract_value(value, context.data_model_manager[kind].get_field_position(attribute))
