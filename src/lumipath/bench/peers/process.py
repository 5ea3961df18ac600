"""Renderers to compare: lumipath in this process, others in processes of their own."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ...errors import RenderError, UsageError
from ...settings import RenderSettings
from .exchange import write_exchange

if TYPE_CHECKING:
    from ...rendering.session import Session
    from ...scene import Scene


class Renderer(Protocol):
    """Something that renders one scene as often as it is asked to."""

    name: str

    def render(self, spp: int, seed: int) -> tuple[NDArray[np.float32], float]:
        """The picture, (H, W, 3) linear, and the seconds that it took."""
        ...

    def close(self) -> None:
        """End it."""
        ...


@frozen
class Peer:
    """Another renderer: the package that it is, the script that runs it, and the script's options."""

    package: str
    script: str
    options: tuple[str, ...] = ()


PEERS = {
    "mitsuba-llvm": Peer("mitsuba", "mitsuba_peer.py", ("llvm_ad_rgb",)),
    "mitsuba-scalar": Peer("mitsuba", "mitsuba_peer.py", ("scalar_rgb",)),
    "cycles": Peer("bpy", "cycles_peer.py"),
}


def is_installed(name: str, python: str | None = None) -> bool:
    """Whether a Python (None: this one) has the package of a renderer."""
    package = PEERS[name].package
    if python is None:
        return importlib.util.find_spec(package) is not None
    code = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({package!r}) is None)"
    try:
        return subprocess.run([python, "-c", code], capture_output=True).returncode == 0
    except OSError as error:
        raise UsageError(f"{python} is not a Python that can be run: {error.strerror}; name another one") from None


class OtherProcess:
    """A renderer in a process of its own.

    Args:
        name: one of `PEERS`.
        scene: of matt meshes and lamps.
        settings: size, depth, threads.
        python: the Python that has its package; None: this one.

    Raises:
        UsageError: the scene has what cannot be compared.
        RenderError: the renderer cannot be started; the message is its own.
    """

    def __init__(self, name: str, scene: Scene, settings: RenderSettings, python: str | None = None) -> None:
        self._label = name
        self._folder = tempfile.TemporaryDirectory(prefix="lumipath-")
        self._picture = Path(self._folder.name) / "picture.npy"
        file = Path(self._folder.name) / "scene.npz"
        write_exchange(file, scene, settings)
        script = Path(__file__).with_name(PEERS[name].script)
        command = [python or sys.executable, str(script), str(file), *PEERS[name].options]
        self._said = file.with_name("stderr")
        with self._said.open("w") as said:
            pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": said}
            self._process = subprocess.Popen(command, text=True, **pipes)
        self.name: str = self._answer()["name"]

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        facts: dict[str, Any] = json.loads(line) if line else {"error": self._last_words()}
        if "error" in facts:
            self.close()
            raise RenderError(f"{self._label}: {facts['error']}")
        return facts

    def _last_words(self) -> str:
        self._process.wait()
        lines = self._said.read_text(errors="replace").splitlines()
        said = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
        return f"it ended with {self._process.returncode}: {said}"

    def render(self, spp: int, seed: int) -> tuple[NDArray[np.float32], float]:
        """The picture, (H, W, 3) linear, and the seconds that it took.

        Raises:
            RenderError: the renderer failed; the message is its own.
        """
        assert self._process.stdin is not None
        try:
            request = {"spp": spp, "seed": seed, "file": str(self._picture)}
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise RenderError(f"{self._label}: {self._last_words()}") from None
        seconds = float(self._answer()["seconds"])
        return np.load(self._picture), seconds

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._folder.cleanup()


class ThisProcess:
    """lumipath.

    Args:
        scene: what to render.
        settings: size, depth, threads; seed and samples are those of each render.
        device: as for `Session`.
    """

    def __init__(self, scene: Scene, settings: RenderSettings, device: str) -> None:
        from ... import __version__

        self._scene, self._settings, self._device = scene, settings, device
        self._sessions: dict[int, Session] = {}
        self.name = f"lumipath {__version__}, {self._session(1).device.name}"

    def _session(self, spp: int) -> Session:
        """One for each number of samples, since scene, tree and kernels are no part of a render's time."""
        from ...rendering.session import Session

        if spp not in self._sessions:
            self._sessions[spp] = Session(self._scene, self._settings, device=self._device, spp=spp)
        return self._sessions[spp]

    def render(self, spp: int, seed: int) -> tuple[NDArray[np.float32], float]:
        """The picture, (H, W, 3) linear, and the seconds that it took."""
        session = self._session(spp)
        session.restart(seed)
        return session.run().pixels, session.render_seconds

    def close(self) -> None:
        """Let go of the scene."""
        self._sessions.clear()
