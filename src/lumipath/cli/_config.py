"""`--config`: settings from a JSON file, under their own names or under those that the student tracer gave them."""

from __future__ import annotations

import difflib
import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from attrs import evolve

from ..errors import LumipathWarning, UsageError
from ..settings import RenderSettings
from ._settings import SETTINGS

OLD_NAMES = {"size": "width", "recursion_depth": "max_depth", "supersamples": "spp"}
"""Keys of the student tracer's files, and the settings that they mean."""

WITHOUT_EFFECT = (
    *("threshold", "blocksize", "aa_threshold", "tree_depth", "leaf_size", "filter_width", "kdtree", "shadows"),
    *("smoothshade", "backface_culling", "internal_reflection", "backface_specular"),
)
"""Keys that its files may have, but that never changed a picture."""

_ANTI_ALIAS = "anti_alias"
_CHOICES = (*SETTINGS, *OLD_NAMES, _ANTI_ALIAS)


def read_config(path: Path) -> RenderSettings:
    """The settings of a JSON file, defaults for the rest.

    Warns (`LumipathWarning`) of keys that are not known, and of known ones that have no effect.

    Raises:
        UsageError: the file cannot be read, is no JSON object, or a value is wrong; the message names file and key.
    """
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}
    ignored: list[str] = []
    for key, value in _read_object(path).items():
        name = OLD_NAMES.get(key, key.replace("-", "_"))
        if name in SETTINGS:
            checked = _checked(path, key, name, value)
            if name in values and values[name] != checked:
                raise UsageError(f"{path}: {sources[name]} and {key} are the same setting; keep one of them")
            values[name], sources[name] = checked, key
        elif key == _ANTI_ALIAS:
            _look_at_anti_alias(path, value)
        else:
            ignored.append(key)
    _warn_of(path, ignored)
    try:
        return RenderSettings(**values)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None


def _read_object(path: Path) -> Mapping[str, Any]:
    """The keys and values of the one object that a JSON file holds."""
    from ..formats.files import require_file

    require_file(path, UsageError)
    try:
        content = json.loads(
            path.read_text(encoding="utf-8-sig"), object_pairs_hook=_without_doubles, parse_constant=_no_constant
        )
    except json.JSONDecodeError as error:
        reason = error.msg[0].lower() + error.msg[1:]
        raise UsageError(f"{path}:{error.lineno}:{error.colno}: no valid JSON: {reason}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path}: no text in UTF-8; a configuration is a JSON file") from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise UsageError(f"{path}: no valid JSON: {reason}") from None
    except OSError as error:
        raise UsageError(f"cannot read {str(path)!r}: {error.strerror}; check the disk") from None
    if not isinstance(content, dict):
        raise UsageError(f'{path}: a configuration must be one JSON object, such as {{"spp": 64}}')
    return content


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        keys = [key for key, _ in pairs]
        doubled = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {doubled!r} is there twice; keep one")
    return content


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON; write one")


def _checked(path: Path, key: str, name: str, value: Any) -> Any:
    """The value of one setting as RenderSettings wants it."""
    setting = SETTINGS[name]
    if isinstance(value, list):
        value = tuple(value)
    elif isinstance(value, str) and setting.means_off(value):
        value = None
    try:
        evolve(RenderSettings(), **{name: value})
    except UsageError as error:
        # Messages begin with the setting's name; people look for what they wrote.
        raise UsageError(f"{path}: {key}{str(error).removeprefix(name)}") from None
    return value


def _look_at_anti_alias(path: Path, value: Any) -> None:
    if not isinstance(value, bool):
        raise UsageError(f"{path}: {_ANTI_ALIAS} is {value!r}: it must be true or false")
    if value:
        warnings.warn(
            f"{path}: {_ANTI_ALIAS} does not switch to Whitted ray tracing here, and every picture is anti-aliased; "
            'for that mode write "integrator": "whitted"',
            LumipathWarning,
            stacklevel=3,
        )


def _warn_of(path: Path, ignored: list[str]) -> None:
    """One warning of all keys without an effect, and one of all that nobody knows."""
    idle = [key for key in ignored if key in WITHOUT_EFFECT]
    if idle:
        warnings.warn(f"{path}: without effect: {', '.join(idle)}", LumipathWarning, stacklevel=3)
    unknown = [_with_hint(key) for key in ignored if key not in WITHOUT_EFFECT]
    if unknown:
        warnings.warn(f"{path}: unknown and ignored: {', '.join(unknown)}", LumipathWarning, stacklevel=3)


def _with_hint(key: str) -> str:
    near = difflib.get_close_matches(key.replace("-", "_"), _CHOICES, 1, cutoff=0.7)
    return f"{key!r} (did you mean {near[0]}?)" if near else repr(key)
