"""Reference images of built-in scenes: how they are rendered, stored and regenerated.

    python tests/golden/golden.py

writes them anew, after a change that is meant to alter images. Look at what changed before committing it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
if __name__ == "__main__":
    sys.path.insert(0, str(FOLDER.parent / "physics"))

from renders import Renders, renders  # noqa: E402

from lumipath.scenes import builtin  # noqa: E402

SCENES = {
    "cornell-box": {"width": 24, "max_depth": 6, "rr_depth": None},
    "cornell-box-glass": {"width": 24, "max_depth": 8, "rr_depth": None},
    "textures": {"width": 32, "max_depth": 4, "rr_depth": None},
}
REFERENCE_SEEDS = 24
REFERENCE_SPP = 1024


def rendered(name: str, seeds: int, spp: int, first_seed: int = 0, device: str = "cpu") -> Renders:
    """(seeds, H, W, 3): renders of a built-in scene, each of another seed."""
    return renders(builtin(name), seeds=seeds, spp=spp, first_seed=first_seed, device=device, **SCENES[name])


def stored(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean (H, W, 3) float64 and the variance of that mean, (H, W, 3) float64."""
    with np.load(FOLDER / f"{name}.npz") as file:
        return file["mean"].astype(np.float64), file["variance"].astype(np.float64)


def regenerate(name: str) -> None:
    """Write a reference: half precision would add an error of its own, so the mean is single."""
    images = rendered(name, REFERENCE_SEEDS, REFERENCE_SPP, first_seed=10_000)
    variance = images.var(axis=0, ddof=1) / len(images)
    # Half precision cannot hold such small numbers as they are.
    np.savez_compressed(
        FOLDER / f"{name}.npz", mean=images.mean(axis=0).astype(np.float32), variance=variance.astype(np.float32)
    )


if __name__ == "__main__":
    for scene_name in SCENES:
        regenerate(scene_name)
        print(scene_name)
