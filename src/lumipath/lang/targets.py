"""Numba's extension points, once per target: the CPU at import, CUDA when it is first used.

Numba and numba-cuda have each their own registries for types and lowering. Whatever the language adds is written as a
function of a `Target` and handed to `on_each_target`, so that it is declared once for both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Target(NamedTuple):
    """Where to register types, typing rules and code generation for one kind of device."""

    name: str
    extending: Any
    templates: Any
    imputils: Any
    types: Any


_installers: list[Callable[[Target], None]] = []
_targets: list[Target] = []


def on_each_target(install: Callable[[Target], None]) -> Callable[[Target], None]:
    """Run `install` for every target that is in use, and later for each that comes into use."""
    _installers.append(install)
    for target in _targets:
        install(target)
    return install


def register_callable(target: Target, value: Any, template: type) -> None:
    """Type calls of `value` by `template`; unlike Numba's decorator this works before `value` is in its module."""
    template.key = value  # type: ignore[attr-defined]
    target.templates.infer_global(value, target.types.Function(template))


def _add(target: Target) -> None:
    _targets.append(target)
    for install in _installers:
        install(target)


def enable_cpu() -> None:
    """Register the language with Numba's CPU target."""
    from numba import extending, types
    from numba.core import imputils
    from numba.core.typing import templates

    _add(Target("cpu", extending, templates, imputils, types))


def enable_cuda() -> None:
    """Register the language with numba-cuda, once; importing it takes a while, so it waits until it is needed."""
    if any(target.name == "cuda" for target in _targets):
        return
    from numba.cuda import extending, types
    from numba.cuda.core import imputils
    from numba.cuda.typing import templates

    _add(Target("cuda", extending, templates, imputils, types))


enable_cpu()
