"""A short name for what a scene consists of: equal scenes have equal digests, on any machine."""

from __future__ import annotations

import hashlib
import struct
from typing import Any

import attrs
import numpy as np

from .scene import Scene

# Names are for people, and cameras are chosen by the settings of a render.
_LEFT_OUT = ("name", "cameras")


def scene_digest(scene: Scene) -> str:
    """32 hexadecimal digits that differ between scenes of different shapes, materials, lights or environments.

    Names and cameras do not count.
    """
    return _digest(scene, {}).hex()


def _digest(value: Any, known: dict[int, bytes]) -> bytes:
    """16 bytes; `known` has those of the objects seen before, since materials are shared by many vertices."""
    if id(value) in known:
        return known[id(value)]
    if isinstance(value, np.ndarray):
        made = _hashed(f"array {value.dtype.str} {value.shape}", np.ascontiguousarray(value).reshape(-1))
    elif isinstance(value, (tuple, list)):
        made = _hashed("sequence", b"".join(_digest(item, known) for item in value))
    elif attrs.has(type(value)):
        names = [field.name for field in attrs.fields(type(value)) if field.name not in _LEFT_OUT]
        parts = b"".join(_hashed(name, _digest(getattr(value, name), known)) for name in names)
        made = _hashed(type(value).__name__, parts)
        known[id(value)] = made
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        made = _hashed("number", struct.pack("<d", value))
    else:
        made = _hashed(type(value).__name__, str(value).encode())
    return made


def _hashed(kind: str, content: Any) -> bytes:
    hashed = hashlib.blake2b(kind.encode() + b"\0", digest_size=16)
    hashed.update(content)
    return hashed.digest()
