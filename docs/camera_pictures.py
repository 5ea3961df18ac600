"""Render the pictures of docs/cameras.md: all of them, or those that are named.

python docs/camera_pictures.py [NAME ...]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import attrs
import numpy as np

import lumipath as lp

FOLDER = Path(__file__).parent / "images" / "cameras"
WIDTH = 240
SAMPLES = 256

# Amid the row of balls of the scene `depth-of-field`.
MIDDLE = {"position": (0.4, 0.55, 1.2), "direction": (-0.1, -0.05, -1.0)}
# Before some towers.
LEVEL: dict[str, Any] = {"position": (0.0, 0.35, 4.0), "fov": 50.0}
UPWARDS = {"direction": (0.0, 0.42, -1.0)}


def balls(**camera: Any) -> lp.Scene:
    """A row of balls, all of them sharp, seen by its own camera with other values in it."""
    scene = lp.builtin("depth-of-field")
    return attrs.evolve(scene, cameras=[attrs.evolve(scene.camera(), **{"aperture": 0.0, **camera})])


def towers(**camera: Any) -> lp.Scene:
    """Three towers on the ground of that scene."""
    scene = balls()
    shapes = scene.shapes[:1]
    for x, z, height, colour in ((-1.1, 0.0, 2.6, (0.7, 0.3, 0.2)), (0.1, -1.2, 3.6, 0.7), (1.2, 0.2, 2.2, 0.35)):
        transform = np.diag([0.7, height, 0.7, 1.0])
        transform[:3, 3] = x, height / 2, z
        shapes.append(lp.Box(transform=transform, material=lp.Material(diffuse=colour)))
    return attrs.evolve(scene, shapes=shapes, cameras=[lp.Camera(**{**LEVEL, **camera})])


def target() -> lp.Scene:
    """White stripes that become narrower, and a slanted edge, on black."""
    white = lp.Material(emission=1.0)

    def stripe(*corners: tuple[float, float]) -> lp.Mesh:
        return lp.Mesh(vertices=[(x, y, -1.0) for x, y in corners], faces=[(0, 1, 2), (0, 2, 3)], material=white)

    # All of it goes on beyond the image, since filters reach there.
    shapes, x = [stripe((-20, -20), (5.6, -20), (-3, -1), (-20, -1))], -12.0
    for k in range(12):
        wide = 2.0 - 0.14 * k
        shapes.append(stripe((x, 0), (x + wide / 2, 0), (x + wide / 2, 20), (x, 20)))
        x += wide
    return lp.Scene(shapes=shapes, cameras=[lp.Camera(projection="orthographic", height=24.0)])


# Scene and settings of each picture.
PICTURES: dict[str, tuple[lp.Scene, dict[str, Any]]] = {
    "perspective": (balls(), {}),
    # Farther away: the lower rays would begin below the floor.
    "orthographic": (balls(projection="orthographic", position=(-1.3, 2.0, 10.0)), {}),
    "panorama": (balls(projection="panorama", **MIDDLE), {"width": 2 * WIDTH}),
    "fisheye": (balls(projection="fisheye", fisheye_fov=220.0, **MIDDLE), {}),
    "fisheye-equisolid": (balls(projection="fisheye-equisolid", fisheye_fov=220.0, **MIDDLE), {}),
    "tilted": (towers(**UPWARDS), {}),
    "shifted": (towers(shift=(0.0, 0.42)), {}),
    **{f"filter-{name}": (target(), {"filter": name}) for name in ("box", "gaussian", "blackman-harris", "mitchell")},
}
# Of the pictures of filters, which are enlarged so that pixels are seen.
FILTERED_WIDTH, ENLARGED = 24, 8


def main(chosen: list[str], folder: Path = FOLDER, width: int | None = None, spp: int = SAMPLES) -> None:
    """Write NAME.jpg, or NAME.png for a filter, for each picture; `width` takes the place of the width of each."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in chosen or PICTURES:
        scene, settings = PICTURES[name]
        is_filter = name.startswith("filter-")
        usual = FILTERED_WIDTH if is_filter else settings.get("width", WIDTH)
        image = lp.render(scene, **{**settings, "width": width or usual, "spp": spp})
        if is_filter:
            image = lp.Image(np.kron(image.pixels, np.ones((ENLARGED, ENLARGED, 1), np.float32)))
        image.save(folder / f"{name}.{'png' if is_filter else 'jpg'}")
        print(name)


if __name__ == "__main__":
    main(sys.argv[1:])
