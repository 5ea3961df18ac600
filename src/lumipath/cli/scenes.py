"""`lumipath scenes`: the built-in scenes."""

from __future__ import annotations

from typing import Annotated

import typer

from ..scenes import names
from ._terminal import show, show_json, table


def scenes(as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """List the built-in scenes."""
    if as_json:
        show_json(names())
    else:
        show(table(list(names().items())))
