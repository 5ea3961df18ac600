"""`lumipath bench`: how fast this machine renders."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ..bench.throughput import BENCH_SETTINGS, measure
from ._device import DeviceOption, GpuFlag, device_from
from ._scene import SceneArgument, open_scene
from ._settings import from_flags, from_size, settings_from, with_setting_flags
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
