"""Writing to the terminal: one line a message, and a reader that goes away is no error."""

from __future__ import annotations

import os
import sys
from typing import Any, TextIO


def one_line(text: object) -> str:
    """The text with every run of white space, line ends included, made one space."""
    return " ".join(str(text).split())


def write(stream: TextIO, text: str) -> None:
    """Write and flush; if nobody reads the pipe any more (`| head`), this and all later output is dropped."""
    try:
        stream.write(text)
        stream.flush()
    except BrokenPipeError:
        # What is still in the buffer would fail again when Python shuts down.
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def show(text: str) -> None:
    """One or more lines of result on stdout."""
    write(sys.stdout, text + "\n")


def show_json(value: Any) -> None:
    """A result on stdout as one JSON value, indented."""
    import json

    show(json.dumps(value, indent=2))


def show_message(text: str) -> None:
    """A line for people on stderr."""
    write(sys.stderr, f"lumipath: {one_line(text)}\n")


def show_error(text: object) -> None:
    """One line on stderr that begins `lumipath: error:`."""
    show_message(f"error: {text}")


def show_warning(text: object) -> None:
    """One line on stderr that begins `lumipath: warning:`."""
    show_message(f"warning: {text}")


def table(rows: list[tuple[str, str]]) -> str:
    """Two columns as text, the first as wide as its longest entry."""
    width = max((len(first) for first, _ in rows), default=0)
    return "\n".join(f"{first:<{width}}  {second}".rstrip() for first, second in rows)
