"""`lumipath render`: a scene to an image file."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer
from attrs import frozen

from ..errors import ImageError, RenderError, UsageError
from ..settings import PROGRESS_MODES, RenderSettings
from ._config import read_config
from ._device import DeviceOption, GpuFlag, device_from
from ._progress import Reporter, Summary, make_reporter
from ._scene import DEFAULT_SCENE, SceneArgument, open_scene, scene_stem
from ._settings import from_definitions, from_flags, from_size, settings_from, with_setting_flags
from ._signals import exit_code
from ._sky import is_sky, parse_sky
from ._terminal import show_error, show_warning

if TYPE_CHECKING:
    from ..rendering.image import Image
    from ..rendering.session import Progress, Session
    from ..scene import Scene

_SLOW = 2.0


@with_setting_flags()
def render(
    scene: SceneArgument = DEFAULT_SCENE,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="PNG, JPEG, EXR, HDR, NPY or NPZ by suffix; NAME.png by default, NAME.exr with layers.",
        ),
    ] = None,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image width and height. [pixels]")] = None,
    device: DeviceOption = "auto",
    gpu: GpuFlag = False,
    cubemap: Annotated[
        Path | None,
        typer.Option("--cubemap", "-c", metavar="FILE", help="Environment: one of six cube faces in a folder."),
    ] = None,
    environment: Annotated[
        str | None,
        typer.Option(metavar="FILE|sky:...", help="Environment: an equirectangular image, or sky:elevation=30,..."),
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", "-j", metavar="FILE", help="Settings from a JSON file; flags beat it.")
    ] = None,
    define: Annotated[
        list[str] | None, typer.Option("--define", "-D", metavar="KEY=VALUE", help="Any setting by its name.")
    ] = None,
    checkpoint: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Keep the samples in FILE, so that nothing can be lost.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint, if it is there.")] = False,
    denoise: Annotated[bool, typer.Option("--denoise", help="Remove the noise before the image is written.")] = False,
    progress: Annotated[
        str, typer.Option(metavar="|".join(PROGRESS_MODES), help="How progress is shown, on stderr.")
    ] = "auto",
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but warnings and errors.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Say more; show the traceback of an unexpected error.")
    ] = False,
    **flags: Any,
) -> None:
    """Render SCENE to an image file.

    Ctrl-C stops: what was rendered until then is written.
    With --checkpoint FILE --resume the same command goes on.
    """
    from ..rendering.image import check_writable

    base = read_config(config) if config is not None else RenderSettings()
    settings = settings_from([*from_flags(flags), *from_size(size), *from_definitions(define or [])], base)
    target = output or Path(scene_stem(scene) + (".exr" if settings.aov else ".png"))
    check_writable(target)
    _require_room_for_layers(target, settings)
    if denoise:
        from ..imaging.denoising import require_denoiser

        require_denoiser()
    kept = Kept(checkpoint, resume)
    kept.require_sense()
    with make_reporter(progress, quiet) as reporter:
        loaded = _with_environment(open_scene(scene), cubemap, environment)
        rendered = _with_guides(settings) if denoise else settings
        session = _prepare(loaded, rendered, device_from(device, gpu), kept, reporter, verbose)
        last, interrupt = _run(session, reporter)
        reporter.close()
        _finish(session, last, interrupt, target, reporter, denoise, settings.aov)


def _require_room_for_layers(target: Path, settings: RenderSettings) -> None:
    """Make sure before a long render that the file can hold its layers.

    Raises:
        UsageError: it cannot.
    """
    from ..rendering.image import LAYER_SUFFIXES

    if settings.aov and target.suffix.lower() not in LAYER_SUFFIXES:
        raise UsageError(f"{target}: layers fit only into {' and '.join(LAYER_SUFFIXES)} files; use one of these")


def _with_guides(settings: RenderSettings) -> RenderSettings:
    """The settings with the layers that the denoiser looks at."""
    from ..imaging.denoising import GUIDES

    return attrs.evolve(settings, aov=(*settings.aov, *(name for name in GUIDES if name not in settings.aov)))


def _with_environment(scene: Scene, cubemap: Path | None, environment: str | None) -> Scene:
    """The scene under the environment asked for on the command line, if any."""
    if cubemap is None and environment is None:
        return scene
    if cubemap is not None and environment is not None:
        raise UsageError("--cubemap and --environment are two environments; give one of them")
    if environment is not None and is_sky(environment):
        return attrs.evolve(scene, environment=parse_sky(environment))
    from ..formats.images import read_cubemap, read_environment

    light = read_cubemap(cubemap) if cubemap is not None else read_environment(str(environment))
    return attrs.evolve(scene, environment=light)


@contextmanager
def _told_what_takes_long(reporter: Reporter) -> Iterator[None]:
    """Say at once that kernels have to be compiled in the block, or that it takes longer than two seconds."""
    from ..lang import when_compiling

    timer = threading.Timer(_SLOW, reporter.message, ["preparing the scene ..."])
    timer.daemon = True

    def compiling() -> None:
        timer.cancel()
        reporter.message("compiling kernels for what this scene uses (once: they are kept on disk) ...")

    timer.start()
    try:
        with when_compiling(compiling):
            yield
    finally:
        timer.cancel()


@frozen
class Kept:
    """The checkpoint that the user wants."""

    path: Path | None
    resume: bool

    def require_sense(self) -> None:
        """Tell in the words of the command line what `Session` would refuse.

        Raises:
            UsageError: the two options do not go together with each other or with the files.
        """
        if self.path is None and self.resume:
            raise UsageError("--resume needs --checkpoint FILE: the file to go on from")
        if self.path is not None and self.path.exists() and not self.resume:
            raise UsageError(
                f"{self.path} is there already: add --resume to go on from it, delete it, or name another checkpoint"
            )


def _prepare(
    scene: Scene, settings: RenderSettings, device: str, kept: Kept, reporter: Reporter, verbose: bool
) -> Session:
    """Everything before the first sample, with a word about what took long."""
    from ..rendering.session import Session

    with _told_what_takes_long(reporter):
        session = Session(scene, settings, device=device, checkpoint=kept.path, resume=kept.resume)
    if kept.resume:
        found = f"going on from {kept.path} at {session.resumed:.4g} spp"
        reporter.message(found if session.resumed else f"there is no {kept.path} yet: beginning anew")
    for seconds, what in ((session.build_seconds, "preparing the scene"), (session.compile_seconds, "compiling")):
        if seconds > _SLOW or verbose:
            reporter.message(f"{what} took {seconds:.1f} s")
    if settings.focus_on is not None:
        reporter.message(f"in focus: {session.focus:.6g} m, at pixel {settings.focus_on[0]},{settings.focus_on[1]}")
    if verbose:
        reporter.message(f"{session.width} x {session.height} pixels on {session.device.kind} ({session.device.name})")
        reporter.message(f"{settings}")
    return session


def _run(session: Session, reporter: Reporter) -> tuple[Progress | None, KeyboardInterrupt | None]:
    """All passes, or those until the user stops them."""
    last = None
    try:
        for last in session:
            reporter.update(last)
    except KeyboardInterrupt as interrupt:
        return last, interrupt
    return last, None


def _finish(
    session: Session,
    last: Progress | None,
    interrupt: KeyboardInterrupt | None,
    target: Path,
    reporter: Reporter,
    denoise: bool,
    layers: tuple[str, ...],
) -> None:
    """Write the image with these layers and say so; after an interruption end with its exit code."""
    from ..rendering.layers import layer_names

    image = session.image()
    samples = _samples_in(image, last)
    if interrupt is not None and not samples:
        show_error("interrupted before the first sample; nothing was written")
        raise typer.Exit(exit_code(interrupt))
    if denoise:
        image = _denoised(image)
    _save(image.select_layers(*layer_names(layers, image.layer_names)), target, session.settings)
    seconds = float(image.metadata.get("seconds", last.seconds if last else 0.0))
    paths = samples * session.width * session.height
    reporter.summary(
        Summary(
            event="done" if interrupt is None else "interrupted",
            samples=samples,
            total=session.settings.total_samples,
            seconds=seconds,
            mpaths_per_s=paths / seconds / 1e6 if seconds > 0 else 0.0,
            kind=session.device.kind,
            device=session.device.name,
            output=str(target),
            fewest_samples=image.metadata.get("fewest_samples"),
            most_samples=image.metadata.get("most_samples"),
            noise=image.metadata.get("noise"),
        )
    )
    if interrupt is not None:
        raise typer.Exit(exit_code(interrupt))


def _save(image: Image, target: Path, settings: RenderSettings) -> None:
    """Write the image; where that has become impossible, write it to the folder of temporary files and say so.

    Raises:
        ImageError: it could not be written to where it should; the message says where it is.
    """
    try:
        image.save(target, exposure=settings.exposure, tonemap=settings.tonemap)
    except ImageError as error:
        try:
            rescued = Path(tempfile.mkdtemp(prefix="lumipath-")) / f"{target.stem}.exr"
            image.save(rescued)
        except (OSError, ImageError):
            raise error from None
        raise ImageError(f"{error}; the image is in {rescued}") from None


def _denoised(image: Image) -> Image:
    """The image without noise, or as it is with a warning: a failure must not lose the render."""
    from ..imaging.denoising import denoise

    try:
        return denoise(image)
    except RenderError as error:
        show_warning(f"{error}; the image is written with its noise")
        return image


def _samples_in(image: Image, last: Progress | None) -> float:
    """Mean samples per pixel; the image knows of a pass that an interruption cut short, the last progress does not."""
    return float(image.metadata.get("samples", last.samples if last else 0.0))
