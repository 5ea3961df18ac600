"""Files to scenes: each format is one reader, chosen by the suffix of the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..errors import SceneError
from ..scene import Scene
from .files import require_file


def _ray(path: Path) -> Scene:
    from .ray import read_ray

    return read_ray(path)


# Each reader imports its libraries when it is called, so that a program starts fast whatever it can read.
_READERS: dict[str, Callable[[Path], Scene]] = {".ray": _ray}


def load(path: str | Path) -> Scene:
    """The scene in a file, read by the format of its suffix.

    Args:
        path: the file; upper and lower case of the suffix are the same.

    Raises:
        SceneError: the file is missing, a folder, unreadable, of an unknown suffix, or wrong.
    """
    path = Path(path)
    require_file(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(_READERS)
        raise SceneError(f"{str(path)!r}: the suffix {path.suffix!r} is not known; known are {known}")
    return reader(path)
