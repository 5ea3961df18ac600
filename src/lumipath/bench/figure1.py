"""Figure 1: how many times faster one device renders than another, over samples per pixel, for several scenes.

The figure by which the student path tracer that lumipath grew from was judged: the CPU's time over the GPU's, for three
Cornell boxes at three bounces.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Generator, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import attrs
from attrs import frozen

from .. import __version__
from ..settings import RenderSettings

if TYPE_CHECKING:
    from ..rendering.session import Progress, Session
    from ..scene import Scene

SCENES = ("cornell-box", "cornell-box-specular", "cornell-box-transmissive", "knot40k")
SAMPLES = (64, 256, 1024, 4096, 16384)
CPU_LIMIT = 30.0

# Three bounces and no roulette, as in the figure's first version.
FIGURE1_SETTINGS = RenderSettings(max_depth=3, rr_depth=None, width=512, height=512)

# Long enough for caches to fill, and for a device to learn how many samples it can render at once.
_WARM_UP_SECONDS = 0.5
# A render that is shorter than this is timed again, and the median counts.
_SHORT_SECONDS = 0.3
_REPEATS = 3


@frozen
class Running:
    """A render that is under way: what, and how far."""

    label: str
    progress: Progress


@frozen
class Timing:
    """One scene on one device."""

    kind: str
    """Of the device, as for --device."""
    name: str
    """Of the device, for people."""
    seconds: float
    """Of rendering, all passes; `build_s` and `compile_s` are not in it."""
    samples: float
    """Samples per pixel that were measured."""
    extrapolated: bool
    """Whether `seconds` is longer than what was measured, in proportion to the samples that are missing."""
    mpaths_per_s: float
    mean_rgb: list[float]
    """Mean radiance over all pixels."""
    build_s: float
    """Packing the scene, building its tree, and bringing both to the device."""
    compile_s: float
    """Compiling the kernels, or loading them from the disk."""


@frozen
class Point:
    """One scene with one number of samples, on both devices."""

    scene: str
    triangles: int
    spp: int
    device: Timing
    against: Timing

    @property
    def speed_up(self) -> float:
        """How many times longer `against` takes than `device`."""
        return self.against.seconds / self.device.seconds

    @property
    def relative_difference(self) -> float:
        """Of the mean radiances: a check that both have rendered the same picture."""
        here, there = statistics.fmean(self.device.mean_rgb), statistics.fmean(self.against.mean_rgb)
        return abs(here - there) / there if there else float(here != there)

    def as_dict(self) -> dict[str, Any]:
        """Every number, ready for JSON."""
        return {
            **attrs.asdict(self),
            "speed_up": self.speed_up,
            "relative_difference": self.relative_difference,
            "cpu_extrapolated": self.device.extrapolated or self.against.extrapolated,
        }


def measure_points(
    scenes: Iterable[Scene],
    samples: Sequence[int] = SAMPLES,
    settings: RenderSettings = FIGURE1_SETTINGS,
    device: str = "cuda",
    against: str = "cpu",
    cpu_limit: float = CPU_LIMIT,
) -> Iterator[Point | Running]:
    """Render each scene with each number of samples on both devices, one after the other.

    Args:
        scenes: what to render.
        samples: numbers of samples per pixel.
        settings: the rest, the same for both devices.
        device: the one that is judged, as for `Session`.
        against: the one that it is compared with.
        cpu_limit: seconds after which a CPU is stopped at the end of a pass; its time for all samples is then
            extrapolated, which is fair because time is proportional to samples.

    Yields:
        What is being measured, several times a second, and each point as soon as it is known.

    Raises:
        LumipathError: whatever `Session` raises; for `device` before anything is measured.
    """
    for scene in scenes:
        for spp in samples:
            wanted = attrs.evolve(settings, spp=spp)
            ours = yield from _time_render(scene, wanted, device, cpu_limit)
            theirs = yield from _time_render(scene, wanted, against, cpu_limit)
            yield Point(scene.name, scene.triangle_count, spp, ours, theirs)


def _time_render(
    scene: Scene, settings: RenderSettings, device: str, cpu_limit: float
) -> Generator[Running, None, Timing]:
    """Time one render on one device, after a warm-up."""
    from ..rendering.session import Session

    session = Session(scene, settings, device=device)
    kind = session.device.kind
    limit = cpu_limit if kind == "cpu" else math.inf
    label = f"{scene.name}, {settings.sample_limit} spp, {kind}"
    yield from (Running(label, progress) for progress in _passes(session, _WARM_UP_SECONDS))
    seconds: list[float] = []
    while True:
        session.restart(settings.seed)
        for last in _passes(session, limit):
            yield Running(label, last)
        seconds.append(last.seconds)
        if last.seconds >= _SHORT_SECONDS or len(seconds) == _REPEATS:
            break
    return _timing(session, last.samples, statistics.median(seconds))


def _passes(session: Session, limit: float) -> Iterator[Progress]:
    """The progress of every pass, or of those that begin before `limit` seconds of rendering are over."""
    for progress in session:
        yield progress
        # Only where a pass is complete: one that is cut has rendered some tiles, and tiles differ in what they cost.
        if progress.seconds >= limit and progress.samples >= 1 and float(progress.samples).is_integer():
            return


def _timing(session: Session, samples: float, seconds: float) -> Timing:
    """The facts of a session that took so long for so many samples per pixel."""
    share = samples / session.settings.sample_limit
    return Timing(
        kind=session.device.kind,
        name=session.device.name,
        seconds=seconds / share,
        samples=samples,
        extrapolated=share < 1,
        mpaths_per_s=session.width * session.height * samples / seconds / 1e6,
        mean_rgb=session.image().pixels.mean(axis=(0, 1), dtype="float64").tolist(),
        build_s=session.build_seconds,
        compile_s=session.compile_seconds,
    )


def report(points: Sequence[Point], settings: RenderSettings, cpu_limit: float, complete: bool) -> dict[str, Any]:
    """Machine, settings and points, ready for JSON.

    Args:
        points: what was measured.
        settings: those that `measure_points` got.
        cpu_limit: likewise, seconds.
        complete: whether these are all points that were asked for.
    """
    shared = ("width", "height", "max_depth", "rr_depth", "sampler", "seed")
    return {
        "figure": "figure1",
        "lumipath": __version__,
        "machine": describe_machine(settings.threads),
        "settings": {**{name: getattr(settings, name) for name in shared}, "cpu_limit_s": cpu_limit},
        "complete": complete,
        "points": [point.as_dict() for point in points],
    }


def describe_machine(threads: int | None) -> dict[str, Any]:
    """The CPU, the threads that rendered, and the GPUs."""
    from ..devices import list_devices

    cpu, *gpus = list_devices()
    return {"cpu": cpu.name, "threads": threads or cpu.threads, "gpus": [gpu.name for gpu in gpus]}
