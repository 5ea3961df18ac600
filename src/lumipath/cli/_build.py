"""What `lumipath bench build` shows."""

from __future__ import annotations

import statistics

from ..bench.build import BuildFigures
from ._figures import show_table
from ._terminal import show

# Arrays of fewer bytes a triangle than this are shown as one.
_LITTLE = 0.01

_STEPS = {
    "pack_s": "pack the scene",
    "tree_s": "build the binary tree",
    "build_s": "build the tree, lay it out, bring all to the device",
    "repack_s": "pack what vertices decide, after they have moved",
    "refit_s": "refit the tree, bring what has changed",
}


def show_build(figures: BuildFigures) -> None:
    """Two tables: seconds, and bytes a triangle."""
    seconds = {text: getattr(figures, name) for name, text in _STEPS.items()}
    rows = [(text, f"{statistics.median(s):.3f}", f"{min(s):.3f} to {max(s):.3f}") for text, s in seconds.items()]
    show_table(("step", "seconds", "range"), rows)
    large = {name: size for name, size in figures.bytes.items() if size >= _LITTLE * figures.triangles}
    sizes = sorted(large.items(), key=lambda item: -item[1])
    others = sum(figures.bytes.values()) - sum(large.values())
    sizes += [("all others", others), ("together", sum(figures.bytes.values()))]
    rows = [(name, f"{size / figures.triangles:.2f}", f"{size / 1e6:.2f}") for name, size in sizes]
    show_table(("array", "bytes per triangle", "MB"), rows)
    show(f"{figures.scene}: {figures.triangles} triangles stored; medians of {len(figures.pack_s)} on {figures.device}")
