"""From text to nodes: the grammar, and what is said where a text does not follow it."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

from lark import Lark, Token, Transformer
from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from ...errors import SceneError
from .nodes import Block, Call, Item, List, Pair
from .source import Source, shown

NEWEST_VERSION = 1.1
MAX_DEPTH = 10_000
_TERMINALS = {
    "HEADER": '"SBT-raytracer 1.0", with which every .ray file begins',
    "NUMBER": "a number",
    "NAME": "a name",
    "STRING": "a string in quotes",
    "EQUAL": "'='",
    "COMMA": "','",
    "LPAR": "'('",
    "RPAR": "')'",
    "LBRACE": "'{'",
    "RBRACE": "'}'",
    "_SEMICOLONS": "';'",
}


class _ToNodes(Transformer):
    """Builds nodes while Lark parses, so that no second tree exists."""

    def start(self, children: list[Any]) -> tuple[Token, list[Item]]:
        _, version, *items = children
        return version, items

    def pair(self, children: list[Any]) -> Pair:
        key, value = children if len(children) == 2 else (children[0], None)
        return Pair(key, value)

    def block(self, children: list[Any]) -> Block:
        return Block(children[0], children[1], children[2:-1])

    def group(self, children: list[Any]) -> Block:
        return Block(None, children[0], children[1:-1])

    def call(self, children: list[Any]) -> Call:
        return Call(children[0], children[2:-1])

    def list(self, children: list[Any]) -> List:
        return List(children[0], children[1:-1])


@cache
def _parser() -> Lark:
    grammar = files(__package__).joinpath("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", lexer="contextual", transformer=_ToNodes())


def parse_nodes(source: Source) -> tuple[Token, list[Item]]:
    """The version number of a .ray text and its top-level items.

    Raises:
        SceneError: the text does not follow the grammar; placed where it first does not.
    """
    brackets: list[Token] = []
    parser = _parser().parse_interactive(source.text)
    try:
        for token in parser.iter_parse():
            if token.type in ("LBRACE", "LPAR"):
                brackets.append(token)
                if len(brackets) > MAX_DEPTH:
                    message = f"brackets are nested more than {MAX_DEPTH} deep: use fewer groups"
                    raise source.error(message, token.start_pos or 0)
            elif token.type in ("RBRACE", "RPAR") and brackets:
                brackets.pop()
        return parser.feed_eof()
    except UnexpectedCharacters as error:
        raise _explained_characters(source, error) from None
    except UnexpectedToken as error:
        raise _explained_token(source, error, brackets) from None


def _explained_token(source: Source, error: UnexpectedToken, brackets: list[Token]) -> SceneError:
    """What to tell the author of a text that is not in the order that the grammar asks for."""
    if error.token.type == "$END":
        return _explained_end(source, error, brackets)
    return source.error(f"found {shown(error.token)}, expected {_expected(error)}", error.token.start_pos or 0)


def _explained_characters(source: Source, error: UnexpectedCharacters) -> SceneError:
    """What to tell the author of a text with characters that begin nothing."""
    offset = error.pos_in_stream or 0
    if source.text.startswith("/*", offset):
        return source.error("this comment is never closed: add */ where it ends", offset)
    if source.text[offset] == '"':
        return source.error('this string is never closed: add " at its end, on the same line', offset)
    return source.error(f"found {shown(source.text[offset])}, which means nothing in a .ray file: remove it", offset)


def _explained_end(source: Source, error: UnexpectedToken, brackets: list[Token]) -> SceneError:
    """What to tell the author of a text that ends too early, perhaps with brackets open."""
    if brackets:
        opened = f"the {str(brackets[-1])!r} of line {source.line(brackets[-1].start_pos or 0)} is never closed"
        return source.error(f"the file ends too early: {opened}; is the file cut off?", len(source.text))
    found = "the file ends here" if source.text.strip() else "the file is empty"
    return source.error(f"{found}, expected {_expected(error)}", len(source.text))


def _expected(error: UnexpectedToken) -> str:
    """The terminals that could stand here, in words: `a, b or c`."""
    words = [text for name, text in _TERMINALS.items() if name in error.expected]
    return " or ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words) or "the end"
