"""What `lumipath bench figure1` shows and writes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..bench.figure1 import Point, Running, Timing
from ..bench.plot import plot_figure1
from ..errors import UsageError
from ._figures import Files, show_table, write_files
from ._progress import Reporter
from ._terminal import show, show_json


def samples_from(text: str) -> list[int]:
    """`64,256` as numbers in ascending order.

    Raises:
        UsageError: it is not written so.
    """
    parts = text.split(",")
    if not all(part.strip().isdecimal() and int(part) for part in parts):
        raise UsageError(f"--samples is {text!r}: it must be whole numbers above 0 with commas between, such as 64,256")
    return sorted({int(part) for part in parts})


def follow(measuring: Iterator[Point | Running], points: list[Point], reporter: Reporter) -> None:
    """Show what is being measured, and gather the points that are done."""
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
    write_files(files, facts, plot_figure1)


def _show_table(points: Sequence[Point]) -> None:
    """The points as a table on stdout."""
    kinds = (points[0].against.kind, points[0].device.kind)
    titles = ("scene", "spp", *(f"{kind}\nseconds" for kind in kinds), *(f"{kind}\nMpaths/s" for kind in kinds))
    rows = []
    for point in points:
        seconds = [_seconds(timing) for timing in (point.against, point.device)]
        speeds = [f"{timing.mpaths_per_s:.4g}" for timing in (point.against, point.device)]
        last = (f"{point.speed_up:.3g}", f"{100 * point.relative_difference:.2g} %")
        rows.append((point.scene, str(point.spp), *seconds, *speeds, *last))
    show_table((*titles, "speed-up", "difference\nof means"), rows)
    if any(timing.extrapolated for point in points for timing in (point.against, point.device)):
        show("* extrapolated from as many samples as were rendered within --cpu-limit")


def _seconds(timing: Timing) -> str:
    return f"{timing.seconds:.4g}" + ("*" if timing.extrapolated else "")
