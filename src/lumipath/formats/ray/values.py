"""Readers of single values: each takes what stands after a key, and the key for messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lark import Token

from ...scene.values import colour
from .nodes import Block, Call, Item, List, Node, Pair, expected, is_token, offset_of
from .number_lists import counted, parse_number, read_tuple
from .source import Source, shown

Reader = Callable[[Source, Node | None, Token], Any]

_ALIASES = {"color": "colour", "quaternion": "quaternian"}
_SWITCH = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def read_number(source: Source, value: Node | None, key: Token) -> float:
    """One number."""
    if isinstance(value, Token) and value.type == "NUMBER":
        return parse_number(source, str(value), offset_of(value))
    raise expected(source, value, key, "a number")


def read_vector(count: int, names: str) -> Reader:
    """A reader of `count` numbers in brackets."""

    def read(source: Source, value: Node | None, key: Token) -> tuple[float, ...]:
        if not isinstance(value, Token) or value.type != "TUPLE":
            raise expected(source, value, key, f"{count} numbers {names}")
        numbers = read_tuple(source, value).tolist()
        if len(numbers) != count:
            found = counted(len(numbers), "number")
            raise source.error(f"{key} has {found}: give {count}, {names}", offset_of(value))
        return tuple(numbers)

    return read


read_point = read_vector(3, "(x, y, z)")


def read_colour(source: Source, value: Node | None, key: Token) -> tuple[float, float, float]:
    """Three numbers of 0 or more, or one that stands for three equal ones."""
    if is_token(value, "NUMBER"):
        parts: Any = read_number(source, value, key)
    elif is_token(value, "TUPLE"):
        parts = read_vector(3, "(red, green, blue)")(source, value, key)
    else:
        raise expected(source, value, key, "a colour (red, green, blue) or one number")
    with source.placing(offset_of(value or key)):
        return colour(parts, str(key))


def read_text(source: Source, value: Node | None, key: Token) -> str:
    """A string in quotes, or a bare name."""
    if isinstance(value, Token) and value.type in ("STRING", "NAME"):
        return str(value).strip('"')
    raise expected(source, value, key, "a string in quotes")


def read_switch(source: Source, value: Node | None, key: Token) -> bool:
    """`key` alone, or `key = true` and the like."""
    if value is None:
        return True
    if isinstance(value, Token) and str(value) in _SWITCH:
        return _SWITCH[value]
    raise expected(source, value, key, "true or false")


def read_fields(source: Source, block: Block, readers: Mapping[str, Reader], what: str) -> dict[str, Any]:
    """The values of a block's keys, each read by its reader.

    Raises:
        SceneError: an unknown key (the message lists the known ones), a key given twice, or a wrong value.
    """
    found: dict[str, Any] = {}
    for item in block.items:
        key, value = as_pair(source, item, what)
        name = _ALIASES.get(key, str(key))
        if name not in readers:
            raise source.error(f"{what} has no {shown(key)}: it knows {', '.join(sorted(readers))}", offset_of(key))
        if name in found:
            raise source.error(f"{what} has {shown(key)} twice: remove one of them", offset_of(key))
        found[name] = readers[name](source, value, key)
    return found


def required(source: Source, fields: dict[str, Any], name: str, block: Block, what: str) -> Any:
    """The value of a key that must be there.

    Raises:
        SceneError: it is not there; placed at the block.
    """
    if name not in fields:
        raise source.error(f"{what} has no {name}: give it one", offset_of(block))
    return fields[name]


def as_pair(source: Source, item: Item, what: str) -> tuple[Token, Node | None]:
    """Key and value of an item of a block; `material { }` and `materials (a, b)` need no equals sign."""
    if isinstance(item, Pair):
        return item.key, item.value
    if isinstance(item, Call):
        return item.name, List(item.name, item.arguments)
    if item.name is None:
        raise source.error(f"found a group {{ }} in {what}, expected a key such as material", offset_of(item))
    return item.name, Block(None, item.brace, item.items)
