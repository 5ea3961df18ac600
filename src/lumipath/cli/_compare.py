"""What `lumipath bench compare` shows and writes."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from typing import Any

from ..bench.compare import EQUAL_ERROR_SPP, Result, Step
from ..bench.plot import plot_compare
from ..errors import UsageError
from ._figures import Files, show_table, write_files
from ._progress import Reporter
from ._terminal import show, show_json


def pythons_from(entries: Sequence[str]) -> dict[str, str]:
    """`cycles=/path/to/python` and the like as a dictionary.

    Raises:
        UsageError: it is not written so.
    """
    pairs = [entry.partition("=") for entry in entries]
    for name, equals, path in pairs:
        if not (name and equals and path):
            raise UsageError(
                f"--python is {name + equals + path!r}: it must be a renderer and a Python, as cycles=/usr/bin/python3"
            )
    return {name: path for name, _, path in pairs}


def follow(measuring: Iterator[Step | Result], results: list[Result], reporter: Reporter) -> None:
    """Show what is being measured, and gather the scenes that are done."""
    for item in measuring:
        if isinstance(item, Step):
            reporter.message(item.label)
        else:
            results.append(item)


def finish(files: Files, facts: dict[str, Any], results: Sequence[Result], as_json: bool) -> None:
    """Write the files, show the numbers, and say so.

    Raises:
        ImageError: a file cannot be written; the numbers were shown.
    """
    if as_json:
        show_json(facts)
    else:
        _show_results(results)
    write_files(files, facts, plot_compare)


def _show_results(results: Sequence[Result]) -> None:
    titles = ("scene", "renderer", "Mpaths/s", "lumipath is faster by", "to equal error", "mean")
    rows = []
    for result in results:
        for standing in result.standings:
            others = ("", "")
            if standing is not result.standings[0]:
                ratios = result.ratios(standing)
                equal = result.equal_error(standing)
                faster = f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
                others = (faster, f"{equal:.2f}" if equal is not None else "")
            speed = f"{statistics.median(standing.mpaths_per_s):.3f}"
            mean = " ".join(f"{part:.5f}" for part in standing.mean_rgb)
            rows.append((result.scene, standing.renderer, speed, *others, mean))
    show_table(titles, rows)
    for name in dict.fromkeys(standing.name for result in results for standing in result.standings):
        show(name)
    if any(standing.errors for result in results for standing in result.standings):
        show(
            f"to equal error: seconds of the other at {EQUAL_ERROR_SPP} samples per pixel over lumipath's to its error"
        )
