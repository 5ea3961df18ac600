"""What a .ray file looks like once its brackets are matched: pairs, blocks, calls and lists."""

from __future__ import annotations

from typing import TypeAlias

from attrs import frozen
from lark import Token

from ...errors import SceneError
from .source import Source, shown


@frozen(eq=False)
class Pair:
    """`key = value`, or `key` alone: then the value is None."""

    key: Token
    value: Node | None


@frozen(eq=False)
class Block:
    """`name { items }`; a group has no name."""

    name: Token | None
    brace: Token
    items: list[Item]


@frozen(eq=False)
class Call:
    """`name(arguments)`, such as translate(...) and map(...)."""

    name: Token
    arguments: list[Node]


@frozen(eq=False)
class List:
    """`(arguments)` that are not all numbers."""

    bracket: Token
    arguments: list[Node]


Node: TypeAlias = Token | Block | Call | List
Item: TypeAlias = Pair | Block | Call


def offset_of(node: Node | Pair) -> int:
    """Where a node begins: the index of its first character in the text."""
    if isinstance(node, Pair):
        token = node.key
    elif isinstance(node, Block):
        token = node.brace if node.name is None else node.name
    elif isinstance(node, Call):
        token = node.name
    elif isinstance(node, List):
        token = node.bracket
    else:
        token = node
    return token.start_pos or 0


def described(node: Node | None) -> str:
    """A node in words, for messages: what was found."""
    if node is None:
        return "nothing"
    if isinstance(node, Block):
        return "a group { }" if node.name is None else f"{shown(node.name)} {{ }}"
    if isinstance(node, Call):
        return f"{shown(node.name)[1:-1]}(...)"
    if isinstance(node, List):
        return "a list"
    return str(node) if node.type == "STRING" and len(node) < 40 else shown(node)


def expected(source: Source, value: Node | None, key: Token, what: str) -> SceneError:
    """The error for a value of the wrong kind; in what should be numbers in brackets, the first part that is none."""
    strange = value
    if isinstance(value, List):
        strange = next((part for part in value.arguments if not is_token(part, "NUMBER")), value)
    return source.error(
        f"{key}: found {described(strange)}, expected {what}", offset_of(key if strange is None else strange)
    )


def is_token(value: Node | None, *types: str) -> bool:
    """Whether a value is a single token of one of these types."""
    return isinstance(value, Token) and value.type in types
