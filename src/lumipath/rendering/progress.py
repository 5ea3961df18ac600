"""How far a render is."""

from __future__ import annotations

from attrs import frozen


@frozen
class Progress:
    """How far a render is.

    Attributes:
        samples: mean samples per pixel.
        total: samples wanted; None: no limit.
        seconds: of rendering.
        paths: traced so far.
        time: seconds of rendering after which it stops; None: no limit.
        noise: the largest estimated error of a tile when that was last looked at; None: not yet, or nobody asks.
        needed: about how many samples per pixel it will take until the noise is low enough; None as for `noise`.
    """

    samples: float
    total: int | None
    seconds: float
    paths: int
    time: float | None = None
    noise: float | None = None
    needed: float | None = None

    @property
    def fraction(self) -> float:
        """From 0 to 1: by samples, time or noise, whichever will stop the render first."""
        limits = ((self.samples, self.total), (self.seconds, self.time), (self.samples, self.needed))
        shares = [done / wanted for done, wanted in limits if wanted]
        return min(1.0, max(shares, default=0.0))

    @property
    def remaining_seconds(self) -> float:
        """Estimate of the time that is left; infinite before the first sample."""
        return self.seconds * (1 - self.fraction) / self.fraction if self.fraction > 0 else float("inf")

    @property
    def mpaths_per_s(self) -> float:
        """Million paths per second so far."""
        return self.paths / self.seconds / 1e6 if self.seconds > 0 else 0.0
