"""A Session without kernels: the same face, passes that take no time, and what tests ask for through FAKE_*."""

import os
import signal
import sys
import time
import types
from types import SimpleNamespace

import attrs
import numpy as np

from lumipath.errors import DeviceError, LumipathWarning
from lumipath.lang.cache import announce_compiling
from lumipath.rendering.image import Image
from lumipath.rendering.layers import REGISTRY
from lumipath.settings import RenderSettings


@attrs.frozen
class Progress:
    samples: float
    total: int | None
    seconds: float
    paths: int
    time: float | None = None
    noise: float | None = None

    @property
    def fraction(self):
        return self.samples / self.total if self.total else self.seconds / self.time

    @property
    def remaining_seconds(self):
        return self.seconds * (1 - self.fraction) / self.fraction if self.fraction else float("inf")

    @property
    def mpaths_per_s(self):
        return self.paths / self.seconds / 1e6


MADE = []


class Session:
    def __init__(self, scene, settings=None, *, device="auto", checkpoint=None, resume=False, **overrides):
        if device not in ("auto", "cpu"):
            raise DeviceError(f"unknown device {device!r}: use auto or cpu")
        self.settings = attrs.evolve(settings or RenderSettings(), **overrides)
        self.scene = scene
        self.device = SimpleNamespace(kind="cpu", name="Fake, 1 thread")
        if "FAKE_COMPILE" in os.environ:
            announce_compiling()
        self.build_seconds, self.compile_seconds = 0.1, float(os.environ.get("FAKE_COMPILE", 0.2))
        self.width, self.height = self.settings.size(scene.camera(self.settings.camera).aspect)
        self.focus = 4.5 if self.settings.focus_on else 1.0
        self.samples = 0
        self.checkpoint, self.resume = checkpoint, resume
        self.resumed = 2.0 if resume and checkpoint.exists() else 0.0
        self.restarts = []
        MADE.append(self)

    def restart(self, seed):
        self.settings = attrs.evolve(self.settings, seed=seed)
        self.restarts.append(self.settings)
        self.samples = 0

    def __iter__(self):
        fault = os.environ.get("FAKE_FAULT")
        time_limit = self.settings.time or float("inf")
        while self.samples < self.settings.sample_limit and self.samples * 0.25 < time_limit:
            self.samples += 1
            if fault == "error" and self.samples > 1:
                raise ZeroDivisionError("a bug\nof two lines")
            if fault == "warning":
                import warnings

                warnings.warn("something was\nreplaced", LumipathWarning, stacklevel=2)
            if fault == "hang":
                print("FAKE: rendering", file=sys.stderr, flush=True)
                time.sleep(60)
            if fault == "interrupt-first":
                self.samples = 0
                signal.raise_signal(signal.SIGINT)
            total = self.settings.total_samples
            yield Progress(self.samples, total, self.samples * 0.25, self.samples * 1_000_000, self.settings.time)

    def image(self):
        pixels = np.full((self.height, self.width, 3), 0.5, np.float32)
        facts = {"samples": float(self.samples), "seconds": self.samples * 0.25}
        if self.settings.noise is not None:
            facts |= {"fewest_samples": 32, "most_samples": 96, "noise": 0.9 * self.settings.noise}
        layers = {
            name: np.full((self.height, self.width, len(REGISTRY[name].channels)), 0.5) for name in self.settings.aov
        }
        return Image(pixels, facts, layers)


def as_module():
    module = types.ModuleType("lumipath.rendering.session")
    module.Session, module.Progress = Session, Progress
    return module


if __name__ == "__main__":
    sys.modules["lumipath.rendering.session"] = as_module()
    # A shell that starts tests in the background has them ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    from lumipath.cli import main

    sys.exit(main())
