"""The SCENE argument."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..scenes import DEFAULT, builtin, names

if TYPE_CHECKING:
    from ..scene import Scene

SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="A scene file, or the name of a built-in scene.")]
DEFAULT_SCENE = DEFAULT


def open_scene(text: str) -> Scene:
    """The built-in scene of that name, or the scene in that file; `./name` always means a file.

    Raises:
        SceneError: neither is there, or the file is wrong.
    """
    if text in names() or not _means_file(text):
        return builtin(text)
    from ..formats import load

    return load(text)


def scene_stem(text: str) -> str:
    """The name that files made from this scene get."""
    return text if text in names() else Path(text).stem or "image"


def _means_file(text: str) -> bool:
    path = Path(text)
    return bool(path.suffix) or len(path.parts) > 1 or path.exists()
