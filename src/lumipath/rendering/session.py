"""Progressive rendering: passes over the whole image, until there are enough samples or somebody stops."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs
from numpy.typing import ArrayLike

from ..devices import open_device, warn_of_fallback
from ..devices.device import Device
from ..errors import CheckpointError, DeviceError, LumipathError, LumipathWarning, UsageError
from ..lang import Features, u32
from ..lang.beside import compiled_beside
from ..pack import layout
from ..pack.camera import camera_features, camera_of
from ..pack.scene import Packed, film_layers, image_features, layer_features, pack_scene, pack_view, repack_scene
from ..scene import Camera, Mesh, Scene, deformed_meshes, with_meshes
from ..settings import RenderSettings
from .checkpoint import Checkpoint, CheckpointFile, Identity, range_of
from .film import Film, level
from .image import Image
from .layer_film import LayerFilm
from .layers import layer_names
from .progress import Progress
from .stopping import StopRules


class Session:
    """A render in progress: iterate over its passes, look at the image at any time, stop when you like.

    Args:
        scene: what to render.
        settings: how; the defaults of `RenderSettings` where None.
        device: `auto` (a GPU where one can be used, else the CPU), `cpu`, `cuda`, `cuda:1`, `cuda:all`.
        checkpoint: file that the film is written to every `checkpoint_interval` seconds, at the end, and whenever the
            iteration is left; None: no file. One that is there already is only accepted with `resume`.
        resume: go on from the checkpoint, if it is there.
        overrides: fields of `RenderSettings` that replace those of `settings`.

    Attributes:
        settings: the settings in force.
        scene: what is rendered, after `deform` with the meshes as they are then.
        device: what renders; its `name` is for people.
        film: the sums so far.
        focus: distance of the plane in focus along the viewing direction, metres.
        resumed: mean samples per pixel that came from the checkpoint; 0 where none was there.
        build_seconds: time that packing and tree building took, or the last `deform`.
        compile_seconds: time that compiling the kernels, or loading them from the disk, took.

    Raises:
        LumipathError: a setting, the scene or the device is wrong.
    """

    def __init__(
        self,
        scene: Scene,
        settings: RenderSettings | None = None,
        *,
        device: str = "auto",
        checkpoint: str | Path | None = None,
        resume: bool = False,
        **overrides: Any,
    ) -> None:
        self.settings = attrs.evolve(settings or RenderSettings(), **overrides)
        self.scene = scene
        # Whoever made the scene may change its lists, and meshes are named as they are here.
        self._at_rest = attrs.evolve(scene)
        self._meshes: dict[Mesh, Mesh] = {}
        if self.settings.integrator == "whitted" and not scene.lights and not scene.has_sun:
            warnings.warn(
                f"{scene.name} has no point, directional or ambient light: the integrator whitted shows only what "
                "emits, directly, in mirrors and through glass",
                LumipathWarning,
                stacklevel=2,
            )
        camera = camera_of(scene, self.settings)
        self._view = pack_view(camera, self.settings)
        self._identity = Identity.of(scene, self.settings)
        adaptive = self.settings.noise is not None
        width, height = int(self._view.film_width), int(self._view.film_height)
        self.film = Film(width, height, adaptive, film_layers(self.settings, scene))
        self._layers: LayerFilm | None = None
        apart = [name for name in self.settings.aov if name not in (*self.film.layer_names, "light_groups")]
        if apart:
            self._layers = LayerFilm(apart, width, height, self.settings.sample_limit)
        self._file, found = self._open_checkpoint(checkpoint, resume)
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
        self.resumed = 0.0
        self._warned = False
        self._rules = StopRules(self.settings, self.film)
        self._work: Generator[int, None, None] | None = None
        if found is not None:
            self._take(found)

    def _prepare(self, camera: Camera) -> None:
        """Compile the kernels for what the scene uses, and bring it to the device."""
        settings = self.settings
        start = time.perf_counter()
        host = pack_scene(self.scene, light_sampling=settings.light_sampling, regularize=settings.regularize)
        self._unmoved, self._material_names = host.unmoved, host.material_names
        draft = self.device.draft(host)
        features = Features(image_features(draft.features.mask, settings, camera))
        packing = time.perf_counter() - start
        start = time.perf_counter()
        # Before the tree is there: what builds it may be compiled at the same time.
        with compiled_beside(self.device.stand_in(host), settings.threads):
            self.device.compile(draft._replace(features=features), self._view, self.film.arrays)
        compiling = time.perf_counter() - start
        start = time.perf_counter()
        self._use(host, self.device.upload(host), camera, start - packing)
        self.compile_seconds += compiling

    def _use(self, host: Packed, packed: layout.PackedScene, camera: Camera, start: float) -> None:
        """Render from now on what the device has made of a scene, which was begun to be packed at `start`."""
        features = image_features(packed.features.mask, self.settings, camera)
        if self.settings.focus_on is not None:
            focus = self._distance_of(self.settings.focus_on, host, packed, camera)
            self._view = pack_view(camera, attrs.evolve(self.settings, focus=focus, focus_on=None))
        self._packed = packed._replace(features=Features(features))
        self.build_seconds = time.perf_counter() - start
        start = time.perf_counter()
        self.device.compile(self._packed, self._view, self.film.arrays)
        if self._layers is not None:
            features = layer_features(packed.features.mask, self.settings, camera)
            self._packed_for_layers = packed._replace(features=Features(features))
            self.device.compile_layers(self._packed_for_layers, self._view, self._layers.arrays)
        self.compile_seconds = time.perf_counter() - start

    def _distance_of(self, pixel: tuple[int, int], host: Packed, packed: layout.PackedScene, camera: Camera) -> float:
        """How far away what a pixel shows is, measured as the focus is."""
        from ..devices.focus import distance_at

        bits = camera_features(self.settings, camera, signed=False)
        distance = distance_at(host, packed, self._view, pixel, self.settings.threads, bits)
        if distance == float("inf"):
            raise UsageError(f"focus_on {pixel} shows only the background; name a pixel that shows a surface")
        return distance

    @property
    def focus(self) -> float:
        """Distance of the plane in focus along the viewing direction, metres."""
        return float(self._view.lens[layout.FOCUS])

    def _open_checkpoint(
        self, path: str | Path | None, resume: bool
    ) -> tuple[CheckpointFile | None, Checkpoint | None]:
        """The file to write to, and what is in it; before anything slow, so that a wrong one is told at once."""
        if path is None:
            if resume:
                raise UsageError("resume needs a checkpoint: name its file")
            return None, None
        file = CheckpointFile(path, self.settings.checkpoint_interval)
        if not file.path.exists():
            return file, None
        if not resume:
            raise UsageError(f"{path} is there already: resume it, delete it, or name another checkpoint")
        return file, self._checked(path)

    def _checked(self, path: str | Path) -> Checkpoint:
        """The checkpoint in a file, if this render may go on from it."""
        found = Checkpoint.load(path)
        found.require_same(self._identity, path, "this render")
        found.require_start(self.settings.seed, self.settings.first_sample, path)
        if self.settings.noise is not None and not found.film.is_adaptive:
            raise CheckpointError(
                f"{path} was rendered without noise, and cannot be gone on with it; leave it away, or begin anew"
            )
        missing = [name for name in self.film.layer_names if name not in found.film.layer_names]
        if missing:
            raise CheckpointError(
                f"{path} was rendered without the layers {', '.join(missing)}; leave them away, or begin anew"
            )
        found.film.keep_layers(self.film.layer_names)
        return found

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
        try:
            yield from self._render_layers()
            while (last := self._next_stop()) is not None:
                yield from self._render_pass(last)
        finally:
            self._keep()

    def _next_stop(self) -> int | None:
        """Up to how many samples per pixel the next pass goes; None where the render is at its end."""
        return self._rules.next_stop(self.render_seconds, self.device)

    def _render_pass(self, last: int) -> Iterator[Progress]:
        """Bring every pixel up to `last` samples, or end when the time is up."""
        with self._rules.in_time(self.render_seconds, self.device):
            yield from self._render_to(last)

    def _render_to(self, last: int) -> Iterator[Progress]:
        """Bring every pixel up to `last` samples.

        The device goes on while a step is looked at, so that this time counts as rendering as well.
        """
        self._work = work = self.device.render(self._packed, self._view, self.film.arrays, last)
        self._started = time.perf_counter() - self.render_seconds
        try:
            for rejected in work:
                self.film.rejected += rejected
                self.render_seconds = time.perf_counter() - self._started
                self._warn_of_rejected()
                yield self.progress()
                if self._file is not None and self._file.is_due:
                    self._keep()
        finally:
            work.close()
            self.render_seconds = time.perf_counter() - self._started
            self._work = None

    def _render_layers(self) -> Iterator[Progress]:
        """Finish the layers; no paths are traced, so that the time spent here would spoil what is said of those."""
        while self._layers is not None and not self._layers.is_complete:
            arrays, last = self._layers.arrays, self._layers.samples
            self._work = work = self.device.render_layers(self._packed_for_layers, self._view, arrays, last)
            try:
                for _ in work:
                    yield self.progress()
            finally:
                work.close()
                self._work = None

    def _settle(self) -> None:
        """End the pass that is under way, so that sums and counts agree and are the host's; the next one goes on."""
        if self._work is not None:
            self.device.cancel()
            self.film.rejected += sum(self._work)
        self.device.download(self.film.arrays)

    def _keep(self) -> None:
        """Write the checkpoint; a failure does not end the render, since the earlier file is still there."""
        if self._file is None:
            return
        try:
            self._file.write(self.checkpoint())
        except LumipathError as error:
            warnings.warn(f"no checkpoint: {error}; what was rendered is not lost", LumipathWarning, stacklevel=2)

    def checkpoint(self) -> Checkpoint:
        """The film as it is, with all that is needed to go on from it; it shares the film's arrays."""
        self._settle()
        held = range_of(self.film, self.settings.seed, self.settings.first_sample)
        seconds, device = self.render_seconds, self.device.name
        return Checkpoint(self.film, self._identity, (held,), seconds, self.scene.name, device)

    def save_checkpoint(self, path: str | Path) -> None:
        """Write the film to a file, from which a session of the same scene and settings may go on.

        Raises:
            CheckpointError: the file cannot be written; an earlier one of this name is still there.
        """
        self.checkpoint().save(path)

    def load_checkpoint(self, path: str | Path) -> None:
        """Replace the film by the one in a file.

        Raises:
            CheckpointError: it cannot be read, or belongs to another render; the message names the differences.
        """
        found = self._checked(path)
        self._settle()
        self._take(found)

    def _take(self, found: Checkpoint) -> None:
        if self.device.even_counts:
            level(found.film, self._render_apart)
        self.device.clear()
        self.film.take(found.film)
        self._rules.estimate = None
        self.render_seconds = found.seconds
        self.resumed = self.film.samples

    def _render_apart(self, film: Film, last: int) -> None:
        """Bring another film up to `last` samples."""
        self.device.clear()
        try:
            for rejected in self.device.render(self._packed, self._view, film.arrays, last):
                film.rejected += rejected
            self.device.download(film.arrays)
        finally:
            self.device.clear()

    def restart(self, seed: int) -> None:
        """Begin anew with another seed; scene, tree and kernels stay as they are."""
        self._settle()
        self.settings = attrs.evolve(self.settings, seed=seed)
        self._view = self._view._replace(seed=u32(seed))
        self._begin_anew()

    def deform(self, vertices: Mapping[Mesh, ArrayLike], normals: Mapping[Mesh, ArrayLike] | None = None) -> None:
        """Move the vertices of meshes, and begin anew: the next frame of an animation.

        The picture is that of a new session of a scene with such meshes, but trees are only fitted to where their
        triangles are now, unless one would become much worse by that.

        Args:
            vertices: for each mesh of the scene that the session was made with, alone or in instances, new positions
                (N, 3), metres. What is not named stays as it was.
            normals: for some of them, new shading normals (N, 3). A mesh that has normals and is given none gets the
                mean of those of the faces around each vertex, weighted by their area.

        Raises:
            UsageError: something that is no mesh of the scene, or a session that writes a checkpoint.
            SceneError: vertices or normals of another number or shape, or not finite. Nothing has changed then.
        """
        if self._file is not None:
            raise UsageError(
                f"the session writes the checkpoint {self._file.path}, which is of one picture: for frames of an "
                "animation leave it away, and call save_checkpoint for each"
            )
        meshes = deformed_meshes(self._at_rest, self._meshes, vertices, normals)
        scene = with_meshes(self._at_rest, meshes)
        identity = Identity.of(scene, self.settings)
        self._settle()
        start = time.perf_counter()
        host = repack_scene(scene, self._packed, self._unmoved)
        self._use(host, self.device.refit(host), camera_of(scene, self.settings), start)
        self.scene, self._meshes, self._identity = scene, meshes, identity
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Forget all samples, and their time."""
        self.film.clear()
        if self._layers is not None:
            self._layers.clear()
        self._rules.estimate = None
        self.device.clear()
        self._started = time.perf_counter()
        self.render_seconds = 0.0
        self.resumed = 0.0

    def _warn_of_rejected(self) -> None:
        if self.film.rejected and not self._warned:
            self._warned = True
            warnings.warn(
                f"{self.scene.name}: some samples were not finite; they count as black", LumipathWarning, stacklevel=3
            )

    def progress(self) -> Progress:
        """How far the render is."""
        paths = int(self.film.counts.sum(dtype="int64"))
        total, time_limit = self.settings.total_samples, self.settings.time
        noise, needed = self._rules.estimate or (None, None)
        return Progress(self.film.samples, total, self.render_seconds, paths, time_limit, noise, needed)

    def run(self, progress: Callable[[Progress], None] | None = None) -> Image:
        """Render everything that is left, calling `progress` after each pass."""
        for step in self:
            if progress:
                progress(step)
        return self.image()

    def image(self) -> Image:
        """The image and the layers of the samples so far."""
        image = self.checkpoint().image()
        if self._layers is not None:
            image.metadata |= self._layers.metadata(self.scene, self._material_names)
            image.layers |= self._layers.layers(self.film.counts, self._packed, self.scene)
        return image.select_layers(*layer_names(self.settings.aov, image.layers))


def render(
    scene: Scene,
    *,
    device: str = "auto",
    progress: Callable[[Progress], None] | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    **settings: Any,
) -> Image:
    """Render a scene.

    Args:
        scene: from `lumipath.load` or made in Python.
        device: as for `Session`.
        progress: called with a `Progress` after each pass.
        checkpoint: file to keep the film in, so that nothing is lost; see `Session`.
        resume: go on from the checkpoint, if it is there.
        settings: fields of `RenderSettings`, as `spp=256`.

    Raises:
        LumipathError: a setting, the scene or the device is wrong.
    """
    return Session(scene, device=device, checkpoint=checkpoint, resume=resume, **settings).run(progress)
