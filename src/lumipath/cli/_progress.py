"""How a render is watched: a bar, plain lines, JSON lines, or nothing; always on stderr."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

from attrs import asdict, frozen

from ..errors import UsageError
from ..settings import PROGRESS_MODES
from ._terminal import one_line, write

if TYPE_CHECKING:
    from ..rendering.session import Progress

_LINE_INTERVAL = 2.0


@frozen
class Summary:
    """What was done in the end."""

    event: str
    """`done` or `interrupted`."""
    samples: float
    total: int | None
    """Samples wanted; None: no limit."""
    seconds: float
    mpaths_per_s: float
    kind: str
    device: str
    output: str
    fewest_samples: int | None = None
    """Of a pixel, where pixels differ."""
    most_samples: int | None = None
    noise: float | None = None
    """Largest estimated error of a tile, where anybody asked."""

    def line(self) -> str:
        """The one line that ends a render."""
        of_total = f" of {self.total}" if self.event == "interrupted" and self.total else ""
        start = "interrupted: " if self.event == "interrupted" else ""
        spread = f" ({self.fewest_samples} to {self.most_samples})" if self.most_samples is not None else ""
        noise = f", noise {self.noise:.2g}" if self.noise is not None else ""
        return (
            f"{start}{self.samples:.4g}{of_total} spp{spread}{noise} in {self.seconds:.2f} s, "
            f"{self.mpaths_per_s:.3g} Mpaths/s on {self.kind} ({self.device}): wrote {self.output}"
        )


class Reporter:
    """Says the beginning and the end, nothing between: `--progress none`, and the base of the others."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def __enter__(self) -> Reporter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def message(self, text: str) -> None:
        """A line for people."""
        write(self.stream, f"lumipath: {one_line(text)}\n")

    def update(self, progress: Progress) -> None:
        """A pass is done."""

    def summary(self, summary: Summary) -> None:
        """All is done."""
        self.message(summary.line())

    def close(self) -> None:
        """The passes are over, by success or by an error."""


class QuietReporter(Reporter):
    """Says nothing: `--quiet`."""

    def message(self, text: str) -> None:
        """Nothing."""


class LineReporter(Reporter):
    """A plain line every two seconds: where there is no terminal."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(stream)
        self._clock = clock
        self._next: float | None = None

    def update(self, progress: Progress) -> None:
        """Write a line if the first pass or the last line is two seconds old."""
        now = self._clock()
        if self._next is None:
            self._next = now + _LINE_INTERVAL
        if now < self._next:
            return
        self._next = now + _LINE_INTERVAL
        write(self.stream, f"{100 * progress.fraction:5.1f} %  {describe(progress)}\n")


class JsonReporter(Reporter):
    """One JSON object a line, for programs: `--progress json`."""

    def message(self, text: str) -> None:
        """An object with event `message`."""
        self._object(event="message", text=one_line(text))

    def update(self, progress: Progress) -> None:
        """An object with event `progress`."""
        self._object(
            event="progress",
            samples=progress.samples,
            total=progress.total,
            fraction=progress.fraction,
            seconds=progress.seconds,
            remaining_seconds=progress.remaining_seconds,
            mpaths_per_s=progress.mpaths_per_s,
            time=progress.time,
            noise=progress.noise,
        )

    def summary(self, summary: Summary) -> None:
        """An object with event `done` or `interrupted`."""
        self._object(**asdict(summary))

    def _object(self, **values: Any) -> None:
        # JSON knows no infinity, which the remaining time is at first.
        known = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()}
        write(self.stream, json.dumps(known) + "\n")


class BarReporter(Reporter):
    """A bar that moves: on a terminal."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"))
        self._bar = Progress(*columns, console=Console(file=stream), transient=True)
        self._task = self._bar.add_task("", total=1.0)
        self._started = False

    def update(self, progress: Progress) -> None:
        """Move the bar; the first call shows it."""
        if not self._started:
            self._bar.start()
            self._started = True
        self._bar.update(self._task, completed=progress.fraction, description=describe(progress))

    def close(self) -> None:
        """Take the bar away."""
        if self._started:
            self._bar.stop()
            self._started = False


def make_reporter(mode: str, quiet: bool = False, stream: TextIO | None = None) -> Reporter:
    """The reporter for a `--progress` mode; bars need a terminal, elsewhere plain lines take their place.

    Raises:
        UsageError: no such mode.
    """
    if mode not in PROGRESS_MODES:
        raise UsageError(f"--progress is {mode!r}: it must be one of {', '.join(PROGRESS_MODES)}")
    stream = stream or sys.stderr
    if quiet:
        return QuietReporter(stream)
    if mode == "json":
        return JsonReporter(stream)
    if mode == "none":
        return Reporter(stream)
    return BarReporter(stream) if stream.isatty() else LineReporter(stream)


def describe(progress: Progress) -> str:
    """Samples, time, noise, speed and remaining time of a running render."""
    parts = [f"{progress.samples:.4g}{f'/{progress.total}' if progress.total else ''} spp"]
    if progress.time is not None:
        parts.append(f"{progress.seconds:.0f}/{progress.time:g} s")
    if progress.noise is not None:
        parts.append(f"noise {progress.noise:.2g}")
    parts.append(f"{progress.mpaths_per_s:.3g} Mpaths/s")
    if math.isfinite(progress.remaining_seconds):
        parts.append(f"{duration(progress.remaining_seconds)} left")
    return "  ".join(parts)


def duration(seconds: float) -> str:
    """A time for people: `8 s`, `3 min 20 s`, `2 h 05 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
