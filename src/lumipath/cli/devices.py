"""`lumipath devices`: what this machine can render on."""

from __future__ import annotations

import platform
import time
from importlib import metadata
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ._terminal import show, show_json, show_message, table

if TYPE_CHECKING:
    from ..devices import DeviceInfo

_LIBRARIES = ("numba", "llvmlite", "numpy")


def devices(
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
    warm_up: Annotated[
        bool, typer.Option("--warm-up", help="Compile the kernels that scenes commonly need, for every device.")
    ] = False,
) -> None:
    """List the devices of this machine."""
    from ..devices import list_devices

    if warm_up:
        _warm_up()
        return
    found = [_device_facts(info) for info in list_devices()]
    software = _software_facts()
    if as_json:
        show_json({"devices": found, "software": software})
        return
    for facts in found:
        show(table([(key.replace("_", " "), _as_text(value)) for key, value in facts.items()]) + "\n")
    show(table(list(software.items())))


def _warm_up() -> None:
    """Compile for every kind of device, and say what is done."""
    from ..devices import list_devices
    from ..rendering.warm_up import common_scenes, warm_up

    # GPUs of one capability share their kernels; others compile what they lack when they are first used.
    kinds = list({info.detail.get("capability", "cpu"): info.kind for info in reversed(list_devices())}.values())
    scenes = common_scenes()
    total, start = len(kinds) * len(scenes), time.perf_counter()
    show_message(f"compiling the kernels of {len(scenes)} scenes for {', '.join(kinds)} ...")
    for number, done in enumerate(warm_up(kinds, scenes), 1):
        show_message(f"{number}/{total} {done.scene} on {done.device}: {done.seconds:.1f} s")
    show_message(f"done in {time.perf_counter() - start:.0f} s")


def _device_facts(info: DeviceInfo) -> dict[str, Any]:
    return {"device": info.kind, "name": info.name, "threads": info.threads, **info.detail}


def _software_facts() -> dict[str, str]:
    # Versions come from the packages' metadata: importing numba for its number would take half a second.
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in _LIBRARIES}}


def _as_text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
