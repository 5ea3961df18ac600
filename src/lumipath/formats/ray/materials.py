"""Materials of .ray files: blocks, names, textures."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from attrs import define, field
from lark import Token

from ...errors import LumipathWarning
from ...scene import Material, Texture
from ..images import read_texture
from .nodes import Block, Call, Node, expected, is_token, offset_of
from .source import Source, shown
from .values import read_colour, read_fields, read_number, read_text, read_vector

_LISTED_NAMES = 20


@define(eq=False)
class Materials:
    """The materials and textures of one file, in the order of their definition."""

    named: dict[str, Material] = field(factory=dict)
    _lines: dict[str, int] = field(factory=dict)
    _textures: dict[Path, Texture] = field(factory=dict)

    def read(self, source: Source, value: Node | None, key: Token) -> Material:
        """A material: a block that describes one, or the name of an earlier one.

        Raises:
            SceneError: neither, or the name is not known (the message lists those that are).
        """
        if isinstance(value, Block):
            return self._define(source, value)
        if not is_token(value, "NAME", "STRING"):
            raise expected(source, value, key, "a material { ... } or the name of one")
        name = read_text(source, value, key)
        if name not in self.named:
            known = ", ".join(list(self.named)[:_LISTED_NAMES]) or "none"
            message = f"no material {shown(name)} is defined before this place (known: {known}): define it first"
            raise source.error(message, offset_of(value or key))
        return self.named[name]

    def read_list(self, source: Source, value: Node | None, key: Token) -> tuple[tuple[Material, ...], int]:
        """One material a vertex, (red, { diffuse = 1 }, "blue"), and where the list begins."""
        arguments = getattr(value, "arguments", None)
        if value is None or arguments is None:
            raise expected(source, value, key, 'a list of materials such as (red, { diffuse = 1 }, "blue")')
        return tuple(self.read(source, part, key) for part in arguments), offset_of(value)

    def _define(self, source: Source, block: Block) -> Material:
        readers = {
            "emissive": self._colour,
            "ambient": self._colour,
            "specular": self._colour,
            "reflective": self._colour,
            "diffuse": self._colour,
            "transmissive": self._colour,
            "shininess": self._number,
            "index": self._number,
            "name": read_text,
            "group": read_text,
        }
        fields = read_fields(source, block, readers, "a material")
        fields["emission"] = fields.pop("emissive", (0.0, 0.0, 0.0))
        with source.placing(offset_of(block)):
            material = Material(**fields)
        if material.name:
            self._remember(source, material, block)
        return material

    def _remember(self, source: Source, material: Material, block: Block) -> None:
        if material.name in self.named:
            line = self._lines[material.name]
            message = f"the material {shown(material.name)} is defined already, in line {line}: rename one of them"
            raise source.error(message, offset_of(block))
        self.named[material.name] = material
        self._lines[material.name] = source.line(offset_of(block))

    def _colour(self, source: Source, value: Node | None, key: Token) -> Any:
        return self._texture(source, value) if isinstance(value, Call) else read_colour(source, value, key)

    def _number(self, source: Source, value: Node | None, key: Token) -> float:
        """A number; three equal ones, or a map, which counts with its mean, since the renderer needs one number."""
        if isinstance(value, Call):
            mean = float(np.mean(self._texture(source, value).mean()))
            place = source.error(
                f"{key} cannot vary over a surface: the mean of the map is used, {mean:.4g}", offset_of(value)
            )
            warnings.warn(str(place), LumipathWarning, stacklevel=2)
            return mean
        if not is_token(value, "TUPLE"):
            return read_number(source, value, key)
        numbers = read_vector(3, "all equal, or one number")(source, value, key)
        if min(numbers) != max(numbers):
            raise source.error(f"{key} is {numbers}: give one number", offset_of(value or key))
        return numbers[0]

    def _texture(self, source: Source, call: Call) -> Texture:
        if call.name != "map" or len(call.arguments) != 1 or not is_token(call.arguments[0], "STRING"):
            message = f'found {shown(call.name)[1:-1]}(...), expected map("image file")'
            raise source.error(message, offset_of(call))
        path = source.base / str(call.arguments[0]).strip('"').replace("\\", "/")
        if path not in self._textures:
            with source.placing(offset_of(call.arguments[0])):
                self._textures[path] = read_texture(path)
        return self._textures[path]
