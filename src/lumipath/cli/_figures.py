"""Files of the commands that measure: numbers as JSON, and plots of them."""

from __future__ import annotations

import io
import json
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from attrs import frozen

from ..bench.plot import INSTALL_HINT, SUFFIXES, can_plot, require_matplotlib
from ..errors import ImageError, LumipathError, LumipathWarning
from ._progress import Reporter, make_reporter
from ._terminal import show, show_message

_SMALLEST_WIDTH = 100


@frozen
class Files:
    """Where the numbers and the plots go."""

    numbers: Path
    plots: tuple[Path, ...]


def files_for(output: Path, name: str) -> Files:
    """The files that `--output` means, after a check that all of them can be written.

    Args:
        output: a folder, for a JSON, a PNG and an SVG file; a PNG or SVG file, with the JSON file beside it; or a JSON
            file only.
        name: of the files in a folder, without suffix.

    Raises:
        UsageError: a plot is asked for by name and cannot be drawn.
        ImageError: a file cannot be written.
    """
    from ..rendering.image import check_writable

    if output.is_dir() or not output.suffix:
        files = Files(output / f"{name}.json", tuple(output / f"{name}{suffix}" for suffix in SUFFIXES))
        if not can_plot():
            text = f"matplotlib is not installed, so numbers are written and no plot; {INSTALL_HINT}"
            warnings.warn(text, LumipathWarning, stacklevel=2)
            files = Files(files.numbers, ())
    else:
        plots = () if output.suffix.lower() == ".json" else (output,)
        check_writable(output, (*SUFFIXES, ".json"))
        files = Files(output.with_suffix(".json"), plots)
        if plots:
            require_matplotlib()
    for path in (files.numbers, *files.plots):
        check_writable(path, (path.suffix.lower(),))
    return files


def collect(
    measuring: Iterator[Any], follow: Callable[[Iterator[Any], list[Any], Reporter], None]
) -> tuple[list[Any], KeyboardInterrupt | LumipathError | None]:
    """Measure, and show what is going on.

    Args:
        measuring: yields what is being done, and what was found.
        follow: shows the one and gathers the other.

    Returns:
        What was found, and what kept the rest from being measured, if anything did.

    Raises:
        KeyboardInterrupt, LumipathError: it came before anything was found.
    """
    found: list[Any] = []
    try:
        with make_reporter("auto") as reporter:
            follow(measuring, found, reporter)
    except (KeyboardInterrupt, LumipathError) as stopped:
        if not found:
            raise
        return found, stopped
    return found, None


def show_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout, its first column aligned to the left, the others to the right."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for number, title in enumerate(titles):
        table.add_column(title, justify="right" if number else "left")
    for row in rows:
        table.add_row(*row)
    text = io.StringIO()
    width = max(shutil.get_terminal_size().columns, _SMALLEST_WIDTH)
    Console(file=text, width=width, force_terminal=sys.stdout.isatty()).print(table)
    show("\n".join(line.rstrip() for line in text.getvalue().strip("\n").splitlines()))


def write_files(files: Files, facts: dict[str, Any], plot: Callable[[dict[str, Any], Path], None]) -> None:
    """Write the JSON file, then the plots, each whole or not at all, and say so.

    Args:
        files: where to.
        facts: the numbers; `complete` says whether these are all that were asked for.
        plot: draws them into a file.

    Raises:
        ImageError: a file cannot be written.
    """
    from ..rendering.files import replacing, temporary_for

    temporary = temporary_for(files.numbers)
    with replacing(files.numbers, temporary, ImageError):
        temporary.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    for path in files.plots:
        temporary = temporary_for(path)
        with replacing(path, temporary, ImageError):
            plot(facts, temporary)
    names = ", ".join(str(path) for path in (files.numbers, *files.plots))
    show_message(f"{'' if facts['complete'] else 'not complete: '}wrote {names}")
