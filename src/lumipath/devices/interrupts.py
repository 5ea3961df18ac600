"""Ctrl-C and SIGTERM that wait for a good moment."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Ctrl-C and SIGTERM that come within the block take effect at its end, so that it is done as a whole."""
    # Only the main thread receives signals and may set handlers.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []

    def remember(number: int, _frame: FrameType | None) -> None:
        came.append(number)

    before = {number: signal.getsignal(number) for number in _SIGNALS}
    # A handler that is no Python function is None here, and could not be put back.
    ours = [number for number, handler in before.items() if handler not in (None, signal.SIG_IGN)]
    try:
        for number in ours:
            signal.signal(number, remember)
        yield
    finally:
        for number in ours:
            try:
                signal.signal(number, before[number])
            except KeyboardInterrupt:
                # One that came as soon as the first handler was back: the others are still to be put back.
                came.append(number)
                signal.signal(number, before[number])
        for number in came:
            signal.raise_signal(number)
