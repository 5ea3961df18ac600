"""`lumipath bench`: how fast this machine renders."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..bench import compare as comparing
from ..bench.figure1 import CPU_LIMIT, FIGURE1_SETTINGS, SAMPLES, SCENES, measure_points, report
from ..bench.throughput import BENCH_SETTINGS, PROFILE_SETTINGS, measure
from ._device import DeviceOption, GpuFlag, device_from
from ._scene import SceneArgument, open_scene
from ._settings import from_flags, from_size, settings_from, with_setting_flags
from ._signals import exit_code
from ._terminal import show, show_json

app = typer.Typer(help="Measure how fast this machine renders.", rich_markup_mode=None, no_args_is_help=True)


@app.callback()
def bench() -> None:
    """Measure how fast this machine renders."""


@app.command()
@with_setting_flags("spp", "max_depth", "width", "threads", "sampler", "kernel", base=BENCH_SETTINGS)
def throughput(
    scene: SceneArgument,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image width and height. [pixels]")] = None,
    device: DeviceOption = "auto",
    gpu: GpuFlag = False,
    repeat: Annotated[int, typer.Option(metavar="N", min=1, help="Measurements, each with another seed.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False,
    **flags: Any,
) -> None:
    """Paths per second, without Russian roulette, after a warm-up of one sample per pixel."""
    settings = settings_from([*from_flags(flags), *from_size(size)], BENCH_SETTINGS)
    result = measure(open_scene(scene), settings, device=device_from(device, gpu), repeat=repeat)
    if as_json:
        show_json(result.as_dict())
        return
    speeds = " ".join(f"{speed:.3f}" for speed in result.mpaths_per_s)
    means = " ".join(f"{mean:.5f}" for mean in result.mean_rgb)
    show(f"{result.median:.3f} Mpaths/s (median of {speeds}) on {result.device}; mean {means}")


@app.command()
@with_setting_flags("threads", base=BENCH_SETTINGS)
def build(
    scene: SceneArgument,
    device: DeviceOption = "auto",
    gpu: GpuFlag = False,
    repeat: Annotated[int, typer.Option(metavar="N", min=1, help="Measurements.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False,
    **flags: Any,
) -> None:
    """Seconds to prepare a scene, and to follow its meshes when they deform; bytes per triangle of each array."""
    from ..bench.build import measure_build
    from ._build import show_build

    settings = settings_from(from_flags(flags), BENCH_SETTINGS)
    place = device_from(device, gpu)
    figures = measure_build(open_scene(scene), device=place, threads=settings.threads, repeat=repeat)
    if as_json:
        show_json(figures.as_dict())
    else:
        show_build(figures)


@app.command()
@with_setting_flags("spp", "max_depth", "width", "threads", "sampler", base=PROFILE_SETTINGS)
def profile(
    scene: SceneArgument,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Image width and height. [pixels]")] = None,
    repeat: Annotated[int, typer.Option(metavar="N", min=1, help="Measurements.")] = 3,
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False,
    **flags: Any,
) -> None:
    """Where a path's time goes on the CPU, and rays per second of one thread beside Embree's, if embreex is there."""
    from ..bench.profile import measure_profile
    from ._profile import show_profile

    settings = settings_from([*from_flags(flags), *from_size(size)], PROFILE_SETTINGS)
    figures = measure_profile(open_scene(scene), settings, repeat=repeat)
    if as_json:
        show_json(figures.as_dict())
    else:
        show_profile(figures)


@app.command()
@with_setting_flags("threads", "seed", base=FIGURE1_SETTINGS)
def figure1(
    scene: Annotated[
        list[str] | None,
        typer.Option(metavar="SCENE", help="A scene file or built-in scene; may be repeated. Default: four of them."),
    ] = None,
    samples: Annotated[str, typer.Option(metavar="N,N,...", help="Samples per pixel.")] = ",".join(map(str, SAMPLES)),
    size: Annotated[str, typer.Option(metavar="WxH", help="Image width and height. [pixels]")] = "512x512",
    device: DeviceOption = "cuda:0",
    against: Annotated[str, typer.Option(metavar="auto|cpu|cuda|cuda:N", help="What it is compared with.")] = "cpu",
    cpu_limit: Annotated[
        float, typer.Option(metavar="SECONDS", min=0, help="CPU renders that take longer are extrapolated.")
    ] = CPU_LIMIT,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PATH", help="A folder, or a PNG, SVG or JSON file.")
    ] = Path(),
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object instead of a table.")] = False,
    **flags: Any,
) -> None:
    """Speed-up of a GPU over the CPU, over samples per pixel: a table, a plot, and their numbers as JSON.

    Ctrl-C stops: what was measured until then is written.
    """
    from ._figure1 import finish, follow, samples_from
    from ._figures import collect, files_for

    settings = settings_from([*from_flags(flags), *from_size(size)], FIGURE1_SETTINGS)
    counts, scenes = samples_from(samples), [open_scene(name) for name in scene or SCENES]
    files = files_for(output, "figure1")
    points, stopped = collect(measure_points(scenes, counts, settings, device, against, cpu_limit), follow)
    finish(files, report(points, settings, cpu_limit, complete=stopped is None), points, as_json)
    if isinstance(stopped, KeyboardInterrupt):
        raise typer.Exit(exit_code(stopped))
    if stopped:
        raise stopped


@app.command()
@with_setting_flags("spp", "max_depth", "threads", "sampler", base=comparing.COMPARE_SETTINGS)
def compare(
    scene: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENE]...", help="Scenes of matt meshes and lamps. Default: the three bench scenes."),
    ] = None,
    peers: Annotated[
        str, typer.Option(metavar="NAME,NAME,...", help="mitsuba-llvm, mitsuba-scalar, cycles. Default: all installed.")
    ] = "",
    size: Annotated[str, typer.Option(metavar="WxH", help="Image width and height. [pixels]")] = "512x512",
    device: DeviceOption = "cpu",
    rounds: Annotated[int, typer.Option(metavar="N", min=1, help="In each, every renderer renders once.")] = 4,
    error_size: Annotated[
        int, typer.Option(metavar="N", min=0, max=4096, help="Side of the pictures for errors; 0: none. [pixels]")
    ] = 256,
    reference_spp: Annotated[
        int, typer.Option(metavar="N", min=1, help="Samples per pixel of what errors are measured against.")
    ] = comparing.REFERENCE_SPP,
    python: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=PYTHON", help="The Python that has a renderer's package; may be repeated."),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PATH", help="A folder, or a PNG, SVG or JSON file.")
    ] = Path(),
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object instead of a table.")] = False,
    **flags: Any,
) -> None:
    """Speed and time to equal error beside Mitsuba and Cycles, interleaved: a table, a plot, and their numbers as JSON.

    Ctrl-C stops: the scenes that were measured until then are written.
    """
    from ._compare import finish, follow, pythons_from
    from ._figures import collect, files_for

    settings = settings_from([*from_flags(flags), *from_size(size)], comparing.COMPARE_SETTINGS)
    pythons = pythons_from(python or [])
    names = comparing.chosen_peers([name.strip() for name in peers.split(",") if name.strip()], pythons)
    scenes, files = [open_scene(name) for name in scene or comparing.SCENES], files_for(output, "compare")
    measuring = comparing.compare_renderers(
        scenes,
        names,
        settings,
        device=device,
        rounds=rounds,
        error_size=error_size,
        reference_spp=reference_spp,
        pythons=pythons,
    )
    results, stopped = collect(measuring, follow)
    finish(files, comparing.report(results, settings, complete=stopped is None), results, as_json)
    if isinstance(stopped, KeyboardInterrupt):
        raise typer.Exit(exit_code(stopped))
    if stopped:
        raise stopped
