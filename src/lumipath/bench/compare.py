"""lumipath beside other renderers on this machine: paths per second, and time to equal error.

Everything is interleaved, round by round, because the speed of a machine drifts by more than what is to be seen.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from typing import TYPE_CHECKING, Any

import attrs
from attrs import define, field, frozen

from .. import __version__
from ..errors import UsageError
from .figure1 import describe_machine
from .throughput import BENCH_SETTINGS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..scene import Scene
    from ..settings import RenderSettings
    from .peers.process import Renderer

SCENES = ("bench-cornell", "bench-blob100k", "bench-blob1m")
COMPARE_SETTINGS = attrs.evolve(BENCH_SETTINGS, width=512, height=512, spp=16)

# Numbers of samples at which errors are measured.
LADDER = (4, 16, 64, 256)
EQUAL_ERROR_SPP = 64
REFERENCE_SPP = 4096
_REFERENCE_SEED = 1 << 20


@frozen
class Step:
    """What is being done now."""

    label: str


@frozen
class ErrorPoint:
    """Mean squared error of a picture of `spp` samples, over the pixels that see no lamp, and its seconds."""

    spp: int
    mse: float
    seconds: float


@define
class Standing:
    """One renderer on one scene."""

    renderer: str
    name: str
    mpaths_per_s: list[float] = field(factory=list)
    mean_rgb: list[float] = field(factory=list)
    errors: list[ErrorPoint] = field(factory=list)

    def seconds_to(self, mse: float) -> float:
        """Seconds to that error: between two measured points, and beyond them, a straight line of logarithms."""
        points = sorted(self.errors, key=lambda point: point.spp)
        x = [math.log(point.mse) for point in points]
        y = [math.log(point.seconds) for point in points]
        target = math.log(mse)
        # The pair of neighbours around the target, or the nearest pair.
        at = next((k for k in range(1, len(x)) if x[k] <= target), len(x) - 1)
        slope = (y[at] - y[at - 1]) / (x[at] - x[at - 1])
        return math.exp(y[at] + slope * (target - x[at]))


@frozen
class Result:
    """All renderers on one scene; the first is lumipath."""

    scene: str
    triangles: int
    standings: list[Standing]

    def ratios(self, standing: Standing) -> list[float]:
        """Speed of lumipath over another's, round by round."""
        return [ours / theirs for ours, theirs in zip(self.standings[0].mpaths_per_s, standing.mpaths_per_s)]

    def equal_error(self, standing: Standing) -> float | None:
        """How many times longer another takes than lumipath to its own error at `EQUAL_ERROR_SPP` samples."""
        point = next((point for point in standing.errors if point.spp == EQUAL_ERROR_SPP), None)
        if point is None or len(self.standings[0].errors) < 2:
            return None
        return point.seconds / self.standings[0].seconds_to(point.mse)

    def as_dict(self) -> dict[str, Any]:
        """Every number, ready for JSON."""
        rows = []
        for standing in self.standings:
            row = attrs.asdict(standing) | {"median": statistics.median(standing.mpaths_per_s)}
            if standing is not self.standings[0]:
                row |= {"ratio": statistics.median(self.ratios(standing)), "equal_error": self.equal_error(standing)}
            rows.append(row)
        return {"scene": self.scene, "triangles": self.triangles, "renderers": rows}


def chosen_peers(names: Sequence[str], pythons: dict[str, str]) -> list[str]:
    """The peers of those names, or all that are installed where none is named.

    Args:
        names: of `PEERS`.
        pythons: for some of them, the Python that has their package.

    Raises:
        UsageError: no such peer, or it is not installed, or none is.
    """
    from .peers.process import PEERS, is_installed

    for name in [*names, *pythons]:
        if name not in PEERS:
            raise UsageError(f"no renderer {name!r} to compare with; there is {', '.join(PEERS)}")
    found = [name for name in names or PEERS if is_installed(name, pythons.get(name))]
    missing = [name for name in names if name not in found]
    if missing:
        package = PEERS[missing[0]].package
        raise UsageError(
            f"{missing[0]} needs the package {package}; install it, or name a Python that has it with --python"
        )
    if not found:
        raise UsageError("none of the other renderers is installed; install mitsuba or bpy, or name a Python with one")
    return found


def compare_renderers(
    scenes: Sequence[Scene],
    peers: Sequence[str],
    settings: RenderSettings = COMPARE_SETTINGS,
    *,
    device: str = "cpu",
    rounds: int = 4,
    error_size: int = 256,
    reference_spp: int = REFERENCE_SPP,
    pythons: dict[str, str] | None = None,
) -> Iterator[Step | Result]:
    """Measure scene by scene.

    Args:
        scenes: of matt meshes and lamps.
        peers: names of `PEERS`.
        settings: of the rounds; the seed of the first.
        device: of lumipath, as for `Session`.
        rounds: in each of which every renderer renders the picture once.
        error_size: side of the square pictures whose errors are measured, pixels; 0: no errors.
        reference_spp: samples per pixel of the picture that they are compared with, which lumipath renders.
        pythons: for some peers, the Python that has their package.

    Yields:
        What is being done, and each scene's result.

    Raises:
        LumipathError: a scene cannot be compared, or a renderer fails.
    """
    for scene in scenes:
        result = Result(scene.name, scene.triangle_count, [])
        with _opened(scene, peers, settings, device, pythons or {}) as renderers:
            result.standings.extend(Standing(label, renderer.name) for label, renderer in renderers.items())
            yield from _speeds(result, renderers, settings, rounds)
        if error_size:
            small = attrs.evolve(settings, width=error_size, height=error_size)
            with _opened(scene, peers, small, device, pythons or {}) as renderers:
                yield from _errors(result, scene, renderers, small, device, reference_spp)
        yield result


@contextmanager
def _opened(
    scene: Scene, peers: Sequence[str], settings: RenderSettings, device: str, pythons: dict[str, str]
) -> Iterator[dict[str, Renderer]]:
    """Lumipath and the peers, ready to render one scene, and ended with the block."""
    from .peers.process import OtherProcess, ThisProcess

    with ExitStack() as stack:
        # The others first: a scene that they cannot render is told before anything slow.
        others: dict[str, Renderer] = {
            name: stack.enter_context(closing(OtherProcess(name, scene, settings, pythons.get(name)))) for name in peers
        }
        yield {"lumipath": ThisProcess(scene, settings, device), **others}


def _speeds(result: Result, renderers: dict[str, Renderer], settings: RenderSettings, rounds: int) -> Iterator[Step]:
    """Fill in paths per second and means."""
    import numpy as np

    spp = settings.sample_limit
    for standing, renderer in zip(result.standings, renderers.values()):
        yield Step(f"{result.scene}: warming {standing.renderer} up")
        renderer.render(min(spp, 4), settings.seed)
    sums = [np.zeros(3) for _ in result.standings]
    for number in range(rounds):
        yield Step(f"{result.scene}: round {number + 1} of {rounds}")
        for standing, renderer, total in zip(result.standings, renderers.values(), sums):
            pixels, seconds = renderer.render(spp, settings.seed + 1 + number)
            standing.mpaths_per_s.append(pixels.shape[0] * pixels.shape[1] * spp / seconds / 1e6)
            total += pixels.mean(axis=(0, 1), dtype=np.float64) / rounds
    for standing, total in zip(result.standings, sums):
        standing.mean_rgb = total.tolist()


def _errors(
    result: Result,
    scene: Scene,
    renderers: dict[str, Renderer],
    settings: RenderSettings,
    device: str,
    reference_spp: int,
) -> Iterator[Step]:
    """Fill in errors, against a long render with numbers that no other render has."""
    import numpy as np

    yield Step(f"{result.scene}: reference of {reference_spp} samples per pixel")
    reference, _ = renderers["lumipath"].render(reference_spp, _REFERENCE_SEED)
    lit = _sees_no_lamp(scene, settings, device)
    for spp in LADDER:
        yield Step(f"{result.scene}: error of {spp} samples per pixel")
        for standing, renderer in zip(result.standings, renderers.values()):
            pixels, seconds = renderer.render(spp, settings.seed + 1 + spp)
            difference = (pixels - reference)[lit]
            mse = float(np.mean(np.square(difference, dtype=np.float64)))
            standing.errors.append(ErrorPoint(spp, mse, seconds))


def _sees_no_lamp(scene: Scene, settings: RenderSettings, device: str) -> NDArray[np.bool_]:
    """(H, W): pixels without a lamp, whose edges would drown all other errors."""
    from ..rendering.session import render

    pixels = render(scene, device=device, width=settings.width, height=settings.height, spp=64, max_depth=0).pixels
    seen: NDArray[np.bool_] = pixels.max(axis=2) == 0
    return seen


def report(results: Sequence[Result], settings: RenderSettings, complete: bool) -> dict[str, Any]:
    """Machine, settings and results, ready for JSON."""
    shared = ("width", "height", "spp", "max_depth", "sampler", "seed")
    return {
        "figure": "compare",
        "lumipath": __version__,
        "machine": describe_machine(settings.threads),
        "settings": {name: getattr(settings, name) for name in shared},
        "equal_error_spp": EQUAL_ERROR_SPP,
        "complete": complete,
        "scenes": [result.as_dict() for result in results],
    }
