"""Numbers of .ray files: single ones, and lists of tuples, fast where they are plain and exact where they are wrong."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain

import numpy as np
from attrs import frozen
from lark import Token
from numpy.typing import NDArray

from ...errors import SceneError
from .nodes import List, Node, expected, is_token, offset_of
from .source import Source, shown

FLOAT_LIMIT = float(np.finfo(np.float32).max)
_DECIMAL = re.compile(r"([+-]?(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?)[fFlL]?")
_HEX = re.compile(r"([+-]?0[xX](?:[0-9a-fA-F]++\.?+[0-9a-fA-F]*+|\.[0-9a-fA-F]++)(?:[pP][+-]?[0-9]++)?)[fFlL]?")
# What `float` reads just as C does: no names, underscores, suffixes or comments.
_PLAIN = re.compile(r"[-+.0-9eE,()\s]*+")
_STRAY_COMMA = re.compile(r"(?:[,(]|\A)\s*+,")
_PIECE = re.compile(r"(?P<blank>\s++|//[^\r\n]*+|/\*(?:[^*]++|\*(?!/))*+\*/)|(?P<mark>[(),])|(?P<word>[^\s(),/]++)")


def parse_number(source: Source, word: str, offset: int) -> float:
    """The value of a C float literal: 1 .5 5. 1e-3 1.5f 0x1.8p3.

    Raises:
        SceneError: it is none, or it is too large for single precision.
    """
    decimal = _DECIMAL.fullmatch(word)
    hexadecimal = None if decimal else _HEX.fullmatch(word)
    try:
        value = float(decimal[1]) if decimal else float.fromhex(hexadecimal[1]) if hexadecimal else None
    except OverflowError:
        value = np.inf
    if value is None:
        raise source.error(f"{shown(word)} is not a number: write it like 2, -0.5 or 1e-3", offset)
    if abs(value) > FLOAT_LIMIT:
        raise source.error(f"{shown(word)} is too large: numbers may be at most {FLOAT_LIMIT:.3g}", offset)
    return value


@frozen(eq=False)
class Tuples:
    """The numbers of a list of tuples, and how to find each again in the text.

    Args:
        name: of the list, for messages.
        values: all numbers one after the other, float64.
        counts: how many of them each tuple has, int64.
        source: the file.
        text: the tuples as written.
        start: offset of `text` in the file.
    """

    name: str
    values: NDArray[np.float64]
    counts: NDArray[np.int64]
    source: Source
    text: str
    start: int

    def rows(self, width: int, names: str) -> NDArray[np.float64]:
        """The numbers as (N, width) float64.

        Raises:
            SceneError: a tuple has another length; placed at that tuple.
        """
        wrong = np.flatnonzero(self.counts != width)
        if len(wrong):
            raise self.tuple_error(wrong[0], f"has {counted(self.counts[wrong[0]], 'number')}: give {width}, {names}")
        return self.values.reshape(-1, width)

    def tuple_error(self, index: int, message: str) -> SceneError:
        """An error placed at the tuple `index`."""
        offset, _ = next(pair for i, pair in enumerate(_scan(self.source, self.text, self.start)) if i == index)
        return self.source.error(f"{self.name}[{index}] {message}", offset)

    def number_error(self, index: int, message: str) -> SceneError:
        """An error placed at the number `index`, counted over all tuples."""
        row = int(np.searchsorted(np.cumsum(self.counts), index, side="right"))
        words = chain.from_iterable(words for _, words in _scan(self.source, self.text, self.start))
        _, offset = next(word for i, word in enumerate(words) if i == index)
        return self.source.error(f"{self.name}[{row}] {message}", offset)


def counted(count: int, noun: str) -> str:
    """`1 number`, `2 numbers`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def read_tuples(source: Source, value: Node | None, key: Token) -> Tuples:
    """A list of tuples of numbers, ((1, 2, 3), (4, 5, 6)); commas may be missing or trail.

    Raises:
        SceneError: it is something else, or a word in it is not a finite number; placed at the culprit.
    """
    if isinstance(value, Token) and value.type == "LIST":
        return _parse_tuples(source, str(key), value[1:-1], offset_of(value) + 1)
    if isinstance(value, List):
        # One of its tuples is none, or holds what is none.
        value = next((part for part in value.arguments if not is_token(part, "TUPLE")), value)
    raise expected(source, value, key, "a list of tuples such as ((0,0,0), (1,0,0))")


def read_tuple(source: Source, value: Token) -> NDArray[np.float64]:
    """The numbers of one tuple, (1, 2, 3)."""
    return _parse_tuples(source, "tuple", str(value), offset_of(value)).values


def _parse_tuples(source: Source, name: str, text: str, start: int) -> Tuples:
    """Parse `(..), (..)`: whole chunks at once if all is plain, else word by word, which finds what is wrong."""
    parsed = _parse_plain(text)
    if parsed is None:
        rows = [
            [parse_number(source, word, offset) for word, offset in words] for _, words in _scan(source, text, start)
        ]
        counts = [len(row) for row in rows]
        parsed = np.array(list(chain.from_iterable(rows)), np.float64), np.array(counts, np.int64)
    return Tuples(name, *parsed, source, text, start)


def _parse_plain(text: str) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """Values and counts, or None where there may be something that only the slow way understands."""
    if not _PLAIN.fullmatch(text) or _STRAY_COMMA.search(text):
        return None
    chunks = text.replace(",", " ").replace("(", " ").split(")")[:-1]
    rows = [chunk.split() for chunk in chunks]
    try:
        values = np.array([float(word) for row in rows for word in row], np.float64)
    except ValueError:
        return None
    if not (np.abs(values) <= FLOAT_LIMIT).all():
        return None
    return values, np.array([len(row) for row in rows], np.int64)


def _scan(source: Source, text: str, start: int) -> Iterator[tuple[int, list[tuple[str, int]]]]:
    """Each tuple of `(..), (..)`: its offset, and its words with theirs.

    Raises:
        SceneError: a comma with nothing before it.
    """
    opened, after_value = start, False
    words: list[tuple[str, int]] = []
    for piece in _PIECE.finditer(text):
        if piece.lastgroup == "blank":
            continue
        mark, offset = piece[0], start + piece.start()
        if mark == ",":
            if not after_value:
                raise source.error("found ',' with nothing before it: remove it", offset)
        elif mark == "(":
            opened, words = offset, []
        elif mark == ")":
            yield opened, words
        else:
            words.append((mark, offset))
        after_value = mark not in ",("
