"""`lumipath info`: what a scene consists of."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ._scene import SceneArgument, open_scene
from ._terminal import show, show_json, table


def info(scene: SceneArgument, as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """Show what SCENE consists of."""
    from ._summary import summarise

    facts = summarise(open_scene(scene))
    if as_json:
        show_json(facts)
    else:
        show(table([(name.replace("memory_bytes", "memory"), _as_text(name, fact)) for name, fact in facts.items()]))


def _as_text(name: str, fact: Any) -> str:
    if name == "memory_bytes":
        return f"about {fact / 1e6:,.1f} MB" if fact >= 1e5 else f"about {fact / 1e3:,.1f} kB"
    if name == "bounds" and fact is not None:
        return f"{_point(fact['min'])} to {_point(fact['max'])} m"
    if isinstance(fact, dict):
        return ", ".join(f"{what} {count:,}" for what, count in fact.items() if count) or "none"
    if isinstance(fact, list):
        return f"{len(fact)} ({', '.join(fact)})" if fact else "the default one"
    if fact is None:
        return "none"
    return f"{fact:,}" if isinstance(fact, int) else str(fact)


def _point(coordinates: list[float]) -> str:
    return "(" + ", ".join(f"{coordinate:.4g}" for coordinate in coordinates) + ")"
