"""What `lumipath bench profile` shows."""

from __future__ import annotations

import statistics

from ..bench.profile import ProfileFigures
from ._figures import show_table
from ._terminal import show, show_message

_STAGES = {
    "generate": "camera rays",
    "extend": "nearest hits of paths",
    "shade": "surfaces, lights, next directions",
    "shadow": "shadow rays",
    "develop": "adding to the film",
}


def show_profile(figures: ProfileFigures) -> None:
    """Two tables: shares of the stages, and rays per second."""
    rows = [(name, _STAGES[name], f"{100 * share:.1f} %") for name, share in figures.shares.items()]
    show_table(("stage", "what it does", "share"), rows)
    beside = any(rays.embree_mrays_per_s for rays in figures.rays)
    titles = ("rays of one thread", "Mrays/s", *(("Embree", "ratio", "disagree") if beside else ()))
    lines = []
    for rays in figures.rays:
        ours = statistics.median(rays.mrays_per_s)
        line = [rays.kind, f"{ours:.2f}"]
        if rays.embree_mrays_per_s:
            theirs = statistics.median(rays.embree_mrays_per_s)
            line += [f"{theirs:.2f}", f"{ours / theirs:.2f}", f"{rays.disagreeing or 0:.1e}"]
        lines.append(line)
    show_table(titles, lines)
    show(f"{figures.scene}: {figures.mpaths_per_s:.3f} Mpaths/s on {figures.device}")
    if not beside:
        show_message("Embree is not compared with: pip install embreex")
