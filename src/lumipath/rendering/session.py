"""Progressive rendering: passes over the whole image, until there are enough samples or somebody stops."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import attrs
from attrs import frozen

from .. import __version__
from ..devices import open_device, warn_of_fallback
from ..devices.device import Device
from ..errors import DeviceError, LumipathWarning, UsageError
from ..lang import Features, u32
from ..pack import layout
from ..pack.scene import Packed, pack_scene, pack_view, settings_features
from ..scene import Camera, Scene
from ..settings import RenderSettings
from .film import Film
from .image import Image


@frozen
class Progress:
    """How far a render is: mean samples per pixel, samples wanted, seconds of rendering, paths traced."""

    samples: float
    total: int
    seconds: float
    paths: int

    @property
    def fraction(self) -> float:
        """From 0 to 1."""
        return min(1.0, self.samples / self.total)

    @property
    def remaining_seconds(self) -> float:
        """Estimate of the time that is left; infinite before the first sample."""
        return self.seconds * (1 - self.fraction) / self.fraction if self.fraction > 0 else float("inf")

    @property
    def mpaths_per_s(self) -> float:
        """Million paths per second so far."""
        return self.paths / self.seconds / 1e6 if self.seconds > 0 else 0.0


class Session:
    """A render in progress: iterate over its passes, look at the image at any time, stop when you like.

    Args:
        scene: what to render.
        settings: how; the defaults of `RenderSettings` where None.
        device: `auto` (a GPU where one can be used, else the CPU), `cpu`, `cuda`, `cuda:1`, `cuda:all`.
        overrides: fields of `RenderSettings` that replace those of `settings`.

    Attributes:
        settings: the settings in force.
        device: what renders; its `name` is for people.
        film: the sums so far.
        focus: distance of the plane in focus along the viewing direction, metres.
        build_seconds: time that packing and tree building took.
        compile_seconds: time that compiling the kernels, or loading them from the disk, took.

    Raises:
        LumipathError: a setting, the scene or the device is wrong.
    """

    def __init__(
        self, scene: Scene, settings: RenderSettings | None = None, *, device: str = "auto", **overrides: Any
    ) -> None:
        self.settings = attrs.evolve(settings or RenderSettings(), **overrides)
        self.scene = scene
        if self.settings.integrator == "whitted" and not scene.lights:
            warnings.warn(
                f"{scene.name} has no point, directional or ambient light: the integrator whitted shows only what "
                "emits, directly, in mirrors and through glass",
                LumipathWarning,
                stacklevel=2,
            )
        camera = scene.camera(self.settings.camera)
        self._view = pack_view(camera, self.settings)
        self.film = Film(int(self._view.film_width), int(self._view.film_height))
        self.device: Device = open_device(device, self.settings.threads, self.settings.kernel)
        try:
            self._prepare(camera)
        except DeviceError as error:
            if device != "auto" or self.device.kind == "cpu":
                raise
            warn_of_fallback(error)
            self.device = open_device("cpu", self.settings.threads)
            self._prepare(camera)
        self.render_seconds = 0.0
        self._warned = False

    def _prepare(self, camera: Camera) -> None:
        """Bring the scene to the device, and compile the kernels for what it uses."""
        start = time.perf_counter()
        host = pack_scene(self.scene)
        packed = self.device.upload(host)
        features = packed.features.mask | settings_features(self.settings, camera)
        if self.settings.focus_on is not None:
            focus = self._distance_of(self.settings.focus_on, host, packed)
            self._view = pack_view(camera, attrs.evolve(self.settings, focus=focus, focus_on=None))
        self._packed = packed._replace(features=Features(features))
        self.build_seconds = time.perf_counter() - start
        start = time.perf_counter()
        self.device.compile(self._packed, self._view, self.film.arrays)
        self.compile_seconds = time.perf_counter() - start

    def _distance_of(self, pixel: tuple[int, int], host: Packed, packed: layout.PackedScene) -> float:
        """How far away what a pixel shows is, along the viewing direction."""
        from ..devices.focus import distance_at

        distance = distance_at(host, packed, self._view, pixel, self.settings.threads)
        if distance == float("inf"):
            raise UsageError(f"focus_on {pixel} shows only the background; name a pixel that shows a surface")
        return distance

    @property
    def focus(self) -> float:
        """Distance of the plane in focus along the viewing direction, metres."""
        return float(self._view.lens[layout.FOCUS])

    @property
    def width(self) -> int:
        """Pixels across, of what is rendered."""
        return self.film.width

    @property
    def height(self) -> int:
        """Pixels down, of what is rendered."""
        return self.film.height

    def __iter__(self) -> Iterator[Progress]:
        """Render, and report several times a second; leaving the loop at any time leaves the film valid."""
        done = int(self.film.counts.min())
        while done < self.settings.spp:
            last = min(self.settings.spp, self.device.next_stop(done, self.width * self.height))
            yield from self._render_pass(last)
            done = last

    def _render_pass(self, last: int) -> Iterator[Progress]:
        """Bring every pixel up to `last` samples; only the time spent here counts as rendering."""
        work = self.device.render(self._packed, self._view, self.film.arrays, last)
        start = time.perf_counter()
        try:
            for rejected in work:
                self.film.rejected += rejected
                self.render_seconds += time.perf_counter() - start
                self._warn_of_rejected()
                yield self.progress()
                start = time.perf_counter()
        finally:
            work.close()

    def restart(self, seed: int) -> None:
        """Begin anew with another seed; scene, tree and kernels stay as they are."""
        self.settings = attrs.evolve(self.settings, seed=seed)
        self._view = self._view._replace(seed=u32(seed))
        self.film.clear()
        self.device.clear()
        self.render_seconds = 0.0

    def _warn_of_rejected(self) -> None:
        if self.film.rejected and not self._warned:
            self._warned = True
            warnings.warn(
                f"{self.scene.name}: some samples were not finite; they count as black", LumipathWarning, stacklevel=3
            )

    def progress(self) -> Progress:
        """How far the render is."""
        paths = int(self.film.counts.sum(dtype="int64"))
        return Progress(self.film.samples, self.settings.spp, self.render_seconds, paths)

    def run(self, progress: Callable[[Progress], None] | None = None) -> Image:
        """Render everything that is left, calling `progress` after each pass."""
        for step in self:
            if progress:
                progress(step)
        return self.image()

    def image(self) -> Image:
        """The image of the samples so far."""
        self.device.download(self.film.arrays)
        metadata = {
            "samples": self.film.samples,
            "seed": self.settings.seed,
            "integrator": self.settings.integrator,
            "seconds": self.render_seconds,
            "scene": self.scene.name,
            "version": __version__,
            "device": self.device.name,
        }
        return Image(self.film.mean(), metadata)


def render(
    scene: Scene, *, device: str = "auto", progress: Callable[[Progress], None] | None = None, **settings: Any
) -> Image:
    """Render a scene.

    Args:
        scene: from `lumipath.load` or made in Python.
        device: as for `Session`.
        progress: called with a `Progress` after each pass.
        settings: fields of `RenderSettings`, as `spp=256`.

    Raises:
        LumipathError: a setting, the scene or the device is wrong.
    """
    return Session(scene, device=device, **settings).run(progress)
