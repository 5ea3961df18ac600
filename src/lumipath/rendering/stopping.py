"""When a render stops: by samples, time or noise, whichever comes first."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from ..devices.device import Device
from ..settings import RenderSettings
from .film import Film
from .noise import begin_goals, needed_samples, raise_goals, tile_errors

# Less time than this is none: a pass takes longer to begin.
_LEAST_SECONDS = 1e-3


class StopRules:
    """The limits of a render, and how far a film is from them.

    Args:
        settings: with the limits.
        film: what is rendered; adaptive where a noise is given.

    Attributes:
        estimate: what the last look at the noise found: the worst tile's error, and about how many samples per pixel
            will be needed in all; None: nobody has looked yet.
    """

    def __init__(self, settings: RenderSettings, film: Film) -> None:
        self._limit, self._time, self._noise = settings.sample_limit, settings.time, settings.noise
        self._film = film
        self.estimate: tuple[float, float] | None = None

    def next_stop(self, seconds: float, device: Device) -> int | None:
        """Up to how many samples per pixel the next pass goes, after so many seconds; None at the end of the render."""
        film, limit = self._film, self._limit
        if film.is_adaptive and not film.goals.max():
            begin_goals(film, limit)
        if not film.counts.min() and self._time is not None:
            # However short the time, every pixel gets a sample.
            return 1
        if self._seconds_left(seconds) < _LEAST_SECONDS:
            return None
        done = film.fewest(limit)
        if done is None and self._raise_goals(device):
            done = film.fewest(limit)
        return None if done is None else min(limit, device.next_stop(done, film.width * film.height))

    def _raise_goals(self, device: Device) -> bool:
        """Look at the noise of a film whose goals are reached; whether some tiles have higher goals now."""
        if self._noise is None:
            return False
        device.download(self._film.arrays)
        errors = tile_errors(self._film)
        self.estimate = float(errors.max()), needed_samples(self._film, errors, self._noise, self._limit)
        return raise_goals(self._film, errors, self._noise, self._limit)

    def _seconds_left(self, seconds: float) -> float:
        return math.inf if self._time is None else self._time - seconds

    @contextmanager
    def in_time(self, seconds: float, device: Device) -> Iterator[None]:
        """End the pass of the block, begun after so many seconds, when the time is up.

        But not while some pixels have no sample.
        """
        left = self._seconds_left(seconds)
        if math.isinf(left) or not self._film.counts.min():
            yield
            return
        # On some systems threads cannot wait for longer than 49 days: another pass follows then.
        timer = threading.Timer(min(left, threading.TIMEOUT_MAX), device.cancel)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
