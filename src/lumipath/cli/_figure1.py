"""What `lumipath bench figure1` shows and writes."""

from __future__ import annotations

import io
import json
import shutil
import sys
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from attrs import frozen

from ..bench.figure1 import Point, Running, Timing
from ..bench.plot import INSTALL_HINT, SUFFIXES, can_plot, plot_figure1, require_matplotlib
from ..errors import ImageError, LumipathError, LumipathWarning, UsageError
from ._progress import Reporter, make_reporter
from ._terminal import show, show_json, show_message

_NAME = "figure1"
_SMALLEST_WIDTH = 100


@frozen
class Files:
    """Where the numbers and the plots go."""

    numbers: Path
    plots: tuple[Path, ...]


def files_for(output: Path) -> Files:
    """The files that `--output` means, after a check that all of them can be written.

    Args:
        output: a folder, for `figure1.json`, `figure1.png` and `figure1.svg`; a PNG or SVG file, with the JSON file
            beside it; or a JSON file only.

    Raises:
        UsageError: a plot is asked for by name and cannot be drawn.
        ImageError: a file cannot be written.
    """
    from ..rendering.image import check_writable

    if output.is_dir() or not output.suffix:
        files = Files(output / f"{_NAME}.json", tuple(output / f"{_NAME}{suffix}" for suffix in SUFFIXES))
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


def samples_from(text: str) -> list[int]:
    """`64,256` as numbers in ascending order.

    Raises:
        UsageError: it is not written so.
    """
    parts = text.split(",")
    if not all(part.strip().isdecimal() and int(part) for part in parts):
        raise UsageError(f"--samples is {text!r}: it must be whole numbers above 0 with commas between, such as 64,256")
    return sorted({int(part) for part in parts})


def collect(measuring: Iterator[Point | Running]) -> tuple[list[Point], KeyboardInterrupt | LumipathError | None]:
    """Measure, and show what is going on.

    Returns:
        The points that are done, and what kept the others from being measured, if anything did.

    Raises:
        KeyboardInterrupt, LumipathError: it came before the first point.
    """
    points: list[Point] = []
    try:
        with make_reporter("auto") as reporter:
            _follow(measuring, points, reporter)
    except (KeyboardInterrupt, LumipathError) as stopped:
        if not points:
            raise
        return points, stopped
    return points, None


def _follow(measuring: Iterator[Point | Running], points: list[Point], reporter: Reporter) -> None:
    label = ""
    for item in measuring:
        if isinstance(item, Running):
            if item.label != label:
                label = item.label
                # A bar and a line of text cannot share a row of the terminal.
                reporter.close()
                reporter.message(label)
            reporter.update(item.progress)
        else:
            points.append(item)
            reporter.close()
            seconds = f"{_seconds(item.device)} s against {_seconds(item.against)} s"
            reporter.message(f"{item.scene}, {item.spp} spp: {seconds}, speed-up {item.speed_up:.3g}")


def finish(files: Files, facts: dict[str, Any], points: Sequence[Point], as_json: bool) -> None:
    """Write the files, show the numbers, and say so.

    Raises:
        ImageError: a file cannot be written; the numbers were shown.
    """
    if as_json:
        show_json(facts)
    else:
        _show_table(points)
    _write(files, facts)
    names = ", ".join(str(path) for path in (files.numbers, *files.plots))
    show_message(f"{'' if facts['complete'] else 'not complete: '}wrote {names}")


def _write(files: Files, facts: dict[str, Any]) -> None:
    """The JSON file, then the plots; each whole or not at all."""
    from ..rendering.files import replacing, temporary_for

    temporary = temporary_for(files.numbers)
    with replacing(files.numbers, temporary, ImageError):
        temporary.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    for path in files.plots:
        temporary = temporary_for(path)
        with replacing(path, temporary, ImageError):
            plot_figure1(facts, temporary)


def _show_table(points: Sequence[Point]) -> None:
    """The points as a table on stdout."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    kinds = (points[0].against.kind, points[0].device.kind)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("scene")
    titles = ("spp", *(f"{kind}\nseconds" for kind in kinds), *(f"{kind}\nMpaths/s" for kind in kinds))
    for title in (*titles, "speed-up", "difference\nof means"):
        table.add_column(title, justify="right")
    for point in points:
        seconds = [_seconds(timing) for timing in (point.against, point.device)]
        speeds = [f"{timing.mpaths_per_s:.4g}" for timing in (point.against, point.device)]
        last = (f"{point.speed_up:.3g}", f"{100 * point.relative_difference:.2g} %")
        table.add_row(point.scene, str(point.spp), *seconds, *speeds, *last)
    text = io.StringIO()
    width = max(shutil.get_terminal_size().columns, _SMALLEST_WIDTH)
    Console(file=text, width=width, force_terminal=sys.stdout.isatty()).print(table)
    show("\n".join(line.rstrip() for line in text.getvalue().strip("\n").splitlines()))
    if any(timing.extrapolated for point in points for timing in (point.against, point.device)):
        show("* extrapolated from as many samples as were rendered within --cpu-limit")


def _seconds(timing: Timing) -> str:
    return f"{timing.seconds:.4g}" + ("*" if timing.extrapolated else "")
