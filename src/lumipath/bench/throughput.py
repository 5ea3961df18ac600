"""Paths per second of a scene on a device."""

from __future__ import annotations

import statistics
from typing import TYPE_CHECKING, Any

import attrs
from attrs import asdict, frozen

from ..errors import RenderError
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..rendering.session import Session
    from ..scene import Scene

# Five bounces and no roulette: what the published figures of other renderers are for.
BENCH_SETTINGS = RenderSettings(max_depth=5, rr_depth=None)
PROFILE_SETTINGS = attrs.evolve(BENCH_SETTINGS, spp=16)


@frozen
class Throughput:
    """What `measure` found."""

    mpaths_per_s: list[float]
    """Width * height * spp / seconds / 1e6 of each repeat; building and compiling are not in it."""
    mean_rgb: list[float]
    """Mean radiance over all pixels and repeats: a check that the right thing was measured."""
    device: str
    build_s: float
    compile_s: float

    @property
    def median(self) -> float:
        """The median of `mpaths_per_s`."""
        return statistics.median(self.mpaths_per_s)

    def as_dict(self) -> dict[str, Any]:
        """Every number, the median included, ready for JSON."""
        facts = asdict(self)
        return {"mpaths_per_s": facts.pop("mpaths_per_s"), "median": self.median, **facts}


def measure(
    scene: Scene,
    settings: RenderSettings = BENCH_SETTINGS,
    *,
    device: str = "auto",
    repeat: int = 3,
) -> Throughput:
    """Render `scene` `repeat` times with different seeds, after a first look at the image that does not count.

    Args:
        scene: what to render.
        settings: how; the seed is that of the first repeat.
        device: as for `Session`.
        repeat: number of measurements, 1 or more.

    Raises:
        LumipathError: whatever `Session` raises.
    """
    from ..rendering.session import Session

    session = Session(scene, settings, device=device)
    # What is slow only once: first touch of memory, loading of code.
    for _ in session:
        break
    speeds, means = [], []
    for seed in range(settings.seed, settings.seed + repeat):
        session.restart(seed)
        seconds = _render_all(session)
        speeds.append(session.width * session.height * settings.sample_limit / seconds / 1e6)
        means.append(session.image().pixels.mean(axis=(0, 1), dtype="float64"))
    return Throughput(
        mpaths_per_s=speeds,
        mean_rgb=(sum(means) / repeat).tolist(),
        device=session.device.name,
        build_s=session.build_seconds,
        compile_s=session.compile_seconds,
    )


def _render_all(session: Session) -> float:
    """Every pass; returns the seconds that the session counted as rendering."""
    seconds = 0.0
    for progress in session:
        seconds = progress.seconds
    if seconds <= 0:
        raise RenderError("the render took no measurable time; use more samples or a larger image")
    return seconds
