"""From a .ray file to a `Scene`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from attrs import define, field
from lark import Token
from numpy.typing import NDArray

from ...errors import SceneError
from ...scene import Material, Scene
from ..files import read_bytes
from .materials import Materials
from .nodes import Block, Call, Item, offset_of
from .number_lists import parse_number
from .objects import LIGHTS, SHAPES, read_camera, read_light, read_shape
from .source import Source, shown
from .syntax import NEWEST_VERSION, parse_nodes
from .transforms import TRANSFORMS, read_transform
from .values import as_pair

_TOP_LEVEL_ONLY = ("camera", *LIGHTS)


def read_ray(path: str | Path) -> Scene:
    """The scene in a .ray file; images that it names are looked for beside it.

    Raises:
        SceneError: the file is missing or unreadable, is no UTF-8, or does not follow the language; the error knows
            line and column.
    """
    path = Path(path)
    return parse_ray(_decoded(read_bytes(path), path), path, path.parent)


def parse_ray(text: str, path: Path | None = None, base: Path = Path()) -> Scene:
    """The scene that a .ray text describes.

    Args:
        text: all of it.
        path: for messages and the scene's name; None where the text comes from no file.
        base: the folder that `map("file")` is relative to.

    Raises:
        SceneError: the text does not follow the language; the error knows line and column.
    """
    source = Source(text, path, base)
    version, items = parse_nodes(source)
    if not 0 <= parse_number(source, str(version), offset_of(version)) <= NEWEST_VERSION:
        message = f"this is version {shown(version)[1:-1]} of the .ray language, known are those up to {NEWEST_VERSION}"
        raise source.error(message, offset_of(version))
    return _Builder(source, Scene(name="scene" if path is None else path.stem)).build(items)


def _decoded(data: bytes, path: Path) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = len(data[data.rfind(b"\n", 0, error.start) + 1 : error.start].decode("utf-8")) + 1
        message = f"the byte 0x{data[error.start]:02x} is no UTF-8 text: is this a .ray file? Save it as UTF-8"
        raise SceneError(message, path, line, column) from None


@define(eq=False)
class _Level:
    """A group or transform being read: what is left of it, and what holds for the shapes in it."""

    items: Iterator[Item]
    transform: NDArray[np.float64]
    material: Material


@define(eq=False)
class _Builder:
    """Walks through the items of a file and collects the scene."""

    source: Source
    scene: Scene
    materials: Materials = field(factory=Materials)

    def build(self, items: list[Item]) -> Scene:
        """The scene; nested groups are kept on a list, so that no depth of nesting is too much for Python's stack."""
        levels = [_Level(iter(items), np.eye(4), Material())]
        while levels:
            item = next(levels[-1].items, None)
            if item is None:
                levels.pop()
            elif isinstance(item, Call) and item.name in TRANSFORMS:
                levels.append(self._transformed(item, levels[-1]))
            elif isinstance(item, Block) and item.name is None:
                levels.append(_Level(iter(item.items), levels[-1].transform, levels[-1].material))
            else:
                self._add(item, levels[-1], is_top=len(levels) == 1)
        return self.scene

    def _transformed(self, call: Call, level: _Level) -> _Level:
        matrix, geometry = read_transform(self.source, call)
        # A product too large for double precision is reported by the shape that it is for.
        with np.errstate(over="ignore", invalid="ignore"):
            return _Level(iter([geometry]), level.transform @ matrix, level.material)

    def _add(self, item: Item, level: _Level, is_top: bool) -> None:
        """Add a shape, a light or a camera, or change the material of what follows."""
        if isinstance(item, Call):
            raise self._misplaced(item, item.name)
        key, value = as_pair(self.source, item, "the file")
        if key == "material":
            level.material = self.materials.read(self.source, value, key)
        elif isinstance(item, Block) and key in SHAPES:
            self.scene.shapes.append(read_shape(self.source, item, self.materials, level.transform, level.material))
        elif isinstance(item, Block) and key in _TOP_LEVEL_ONLY and is_top:
            self._add_view(item)
        else:
            raise self._misplaced(item, key)

    def _add_view(self, block: Block) -> None:
        if block.name == "camera":
            self.scene.cameras.append(read_camera(self.source, block))
        else:
            self.scene.lights.append(read_light(self.source, block))

    def _misplaced(self, item: Item, key: Token) -> SceneError:
        """The error for a keyword that is unknown, stands at the wrong place, or lacks its brackets."""
        if key in TRANSFORMS:
            message = f"{key} needs geometry: {TRANSFORMS[key][-1]}"
        elif key in _TOP_LEVEL_ONLY and isinstance(item, Block):
            message = f"{key} cannot stand in a group or transform: move it to the top level"
        elif key in SHAPES or key in _TOP_LEVEL_ONLY:
            message = f"{key} needs a block: {key} {{ ... }}"
        else:
            known = ", ".join((*SHAPES, *TRANSFORMS, *_TOP_LEVEL_ONLY, "material"))
            message = f"{shown(key)} is not known here; known are {known}"
        return self.source.error(message, offset_of(item))
