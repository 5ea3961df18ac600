"""How to add an operation that Python cannot express: its type, its LLVM code, and what it means in plain Python."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from .scalars import DEBUG_PYTHON
from .targets import Target, on_each_target, register_callable

FLOAT = ir.FloatType()
INT = ir.IntType(32)
LONG = ir.IntType(64)


def intrinsic(python: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator for `rule(*numba types) -> (return type, emit)` or None where the types do not fit.

    `emit(context, builder, signature, arguments)` returns the LLVM value, or None for an operation without a value.
    `python` is the meaning in plain Python.
    """

    def decorate(rule: Callable[..., Any]) -> Callable[..., Any]:
        arity = len(inspect.signature(rule).parameters)

        @functools.wraps(rule)
        def stub(*arguments: Any) -> Any:
            return python(*arguments)

        # Without this, Numba would look through to the rule.
        del stub.__wrapped__  # type: ignore[attr-defined]

        def install(target: Target) -> None:
            class Rule(target.templates.AbstractTemplate):
                def generic(self, arguments: tuple[types.Type, ...], keywords: dict[str, types.Type]) -> Any:
                    found = None if keywords or len(arguments) != arity else rule(*arguments)
                    return found and target.templates.signature(found[0], *arguments)

            Rule.__name__ = stub.__name__
            register_callable(target, stub, Rule)

            @target.extending.lower_builtin(stub, *([types.Any] * arity))
            def lower(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Any) -> ir.Value:
                value = rule(*signature.args)[1](context, builder, signature, arguments)
                return context.get_dummy_value() if value is None else value

        if not DEBUG_PYTHON:
            on_each_target(install)
        return stub

    return decorate


def call_llvm(builder: ir.IRBuilder, name: str, result: ir.Type, arguments: list[ir.Value]) -> ir.Value:
    """Call the LLVM intrinsic of that full name."""
    kind = ir.FunctionType(result, [argument.type for argument in arguments])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), arguments)
