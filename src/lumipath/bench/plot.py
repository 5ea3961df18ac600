"""Plots of what was measured, drawn by matplotlib, which is imported when a plot is."""

from __future__ import annotations

import importlib.util
from itertools import cycle
from pathlib import Path
from typing import Any

from ..errors import UsageError

SUFFIXES = (".png", ".svg")
INSTALL_HINT = "install it with: pip install 'lumipath[bench]'"

# Okabe and Ito's colours, which can be told apart by everybody, and marks that can be without colour.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MARKS = "osD^vP"


def can_plot() -> bool:
    """Whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def require_matplotlib() -> None:
    """Nothing if matplotlib is installed.

    Raises:
        UsageError: it is not; the message says how to install it.
    """
    if not can_plot():
        raise UsageError(f"plots need matplotlib; {INSTALL_HINT}")


def plot_figure1(facts: dict[str, Any], path: Path) -> None:
    """Draw the speed-up over samples per pixel, one line a scene; hollow marks where a time was extrapolated.

    Args:
        facts: of `figure1.report`, or read from its JSON file; with one point or more.
        path: a PNG or SVG file.

    Raises:
        UsageError: matplotlib is not installed.
        OSError: the file cannot be written.
    """
    require_matplotlib()
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    points = facts["points"]
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    handles = []
    for scene, colour, mark in zip(dict.fromkeys(point["scene"] for point in points), cycle(_COLOURS), cycle(_MARKS)):
        line = [point for point in points if point["scene"] == scene]
        axes.plot([point["spp"] for point in line], [point["speed_up"] for point in line], color=colour, zorder=1)
        for point in line:
            face = "white" if point["cpu_extrapolated"] else colour
            axes.plot(point["spp"], point["speed_up"], mark, color=colour, markerfacecolor=face, markersize=6.5)
        label = f"{scene} ({line[0]['triangles']:,} triangles)"
        handles.append(Line2D([], [], color=colour, marker=mark, label=label))
    if any(point["cpu_extrapolated"] for point in points):
        hollow: dict[str, Any] = {"marker": "o", "color": "#555555", "markerfacecolor": "white", "linestyle": "none"}
        handles.append(Line2D([], [], label="CPU time extrapolated", **hollow))
    samples = sorted({point["spp"] for point in points})
    axes.set_xscale("log", base=2)
    axes.set_xticks(samples, [f"{number:,}" for number in samples])
    axes.minorticks_off()
    axes.set_ylim(0, 1.15 * max(point["speed_up"] for point in points))
    axes.set_xlabel("samples per pixel")
    device, against = points[0]["device"], points[0]["against"]
    axes.set_ylabel(f"{against['kind'].upper()} time / {device['kind'].upper()} time")
    settings = facts["settings"]
    size = f"{settings['width']} x {settings['height']} pixels, {settings['max_depth']} bounces"
    axes.set_title(f"{device['name']} against {against['name']}\n{size}", fontsize=10)
    axes.set_axisbelow(True)
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(handles=handles, frameon=False, fontsize=9)
    # Without a date, equal figures make equal files.
    metadata = {"Date": None} if path.suffix.lower() == ".svg" else None
    figure.savefig(path, format=path.suffix[1:].lower(), dpi=150, metadata=metadata)


def plot_compare(facts: dict[str, Any], path: Path) -> None:
    """Draw error over seconds, one panel a scene, one line a renderer; both axes logarithmic.

    Args:
        facts: of `compare.report`, or read from its JSON file; with one scene or more that has errors.
        path: a PNG or SVG file.

    Raises:
        UsageError: matplotlib is not installed.
        OSError: the file cannot be written.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    scenes = facts["scenes"]
    figure = Figure(figsize=(3.6 * len(scenes) + 0.6, 3.9), layout="constrained")
    panels = figure.subplots(1, len(scenes), squeeze=False)[0]
    for axes, scene in zip(panels, scenes):
        for row, colour, mark in zip(scene["renderers"], cycle(_COLOURS), cycle(_MARKS)):
            seconds = [point["seconds"] for point in row["errors"]]
            errors = [point["mse"] for point in row["errors"]]
            axes.plot(seconds, errors, color=colour, marker=mark, markersize=5, label=row["renderer"])
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(f"{scene['scene']} ({scene['triangles']:,} triangles)", fontsize=9)
        axes.set_xlabel("seconds")
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("mean squared error")
    panels[0].legend(frameon=False, fontsize=8)
    machine = facts["machine"]
    figure.suptitle(f"Error over time; {machine['cpu']}, {machine['threads']} threads", fontsize=9)
    metadata = {"Date": None} if path.suffix.lower() == ".svg" else None
    figure.savefig(path, format=path.suffix[1:].lower(), dpi=150, metadata=metadata)
