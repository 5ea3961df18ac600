"""Render the pictures of docs/scenes.md: all of them, or those of the scenes that are named.

python docs/thumbnails.py [NAME ...]
"""

from __future__ import annotations

import sys
from pathlib import Path

import lumipath as lp
from lumipath.scenes import names

FOLDER = Path(__file__).parent / "images" / "scenes"
WIDTH = 192
SAMPLES = 1024
# Where light is found by chance.
MORE_SAMPLES = {
    "caustics": 8192,
    "bokeh": 4096,
    "cornell-box-glass": 4096,
    "cornell-box-specular": 8192,
    "cornell-box-transmissive": 4096,
    "knot40k": 4096,
    "lights": 4096,
    "many-lobes": 4096,
    "many-lamps": 4096,
}
BOXES = ("cornell-box", "cornell-box-glass", "cornell-box-specular", "cornell-box-transmissive", "knot40k")
EXPOSURE = {**dict.fromkeys(BOXES, 1.0), "forest": 0.3}


def main(chosen: list[str], folder: Path = FOLDER, width: int = WIDTH, spp: int | None = None) -> None:
    """Write NAME.jpg for each scene; `spp` takes the place of the samples that each needs."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in chosen or names():
        image = lp.render(lp.builtin(name), width=width, spp=spp or MORE_SAMPLES.get(name, SAMPLES))
        image.save(folder / f"{name}.jpg", exposure=EXPOSURE.get(name, 0.0))
        print(f"{name}: {image.metadata['seconds']:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
