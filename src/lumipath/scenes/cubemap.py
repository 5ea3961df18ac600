"""A cubemap: six images around everything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..formats.cubemap import FACES, equirectangular
from ..scene import Box, Camera, Environment, Material, Scene, Sphere
from ._build import rotate, scale, translate

_SIZE = 192
_TILES = 12
_TINTS = {
    "posx": (0.75, 0.3, 0.22),
    "negx": (0.25, 0.55, 0.3),
    "posy": (0.8, 0.8, 0.78),
    "negy": (0.3, 0.24, 0.2),
    "posz": (0.65, 0.55, 0.3),
    "negz": (0.28, 0.4, 0.65),
}
"""Linear colour of each side of the room: its walls, ceiling and floor."""


def _face(tint: tuple[float, float, float], *, window: bool) -> NDArray[np.float32]:
    """A chequered side of a room, (S, S, 3), darker in its corners; perhaps with a window of four bright panes."""
    s = (np.arange(_SIZE) + 0.5) / _SIZE
    x, y = np.meshgrid(s, s)
    odd = (np.floor(x * _TILES) + np.floor(y * _TILES)) % 2
    shade = (1.0 - 0.6 * np.maximum(abs(2 * x - 1), abs(2 * y - 1)) ** 3) * (0.35 + 0.3 * odd)
    image = np.asarray(tint) * shade[..., None]
    if window:
        u, v = abs(2 * x - 1), abs(2 * y - 1)
        panes = (np.maximum(u, v) < 0.5) & (np.minimum(u, v) > 0.05)
        image[panes] = (5.0, 5.0, 4.6)
    return image.astype(np.float32)


def _room() -> Environment:
    """A room of six colours, turned a little, with windows above, on the right and behind the camera."""
    faces = [_face(_TINTS[face], window=face in ("posx", "posy", "posz")) for face in FACES]
    return Environment(image=equirectangular(np.stack(faces)), rotation=rotate("y", 30), name="room")


def cubemap() -> Scene:
    """A mirror ball, a glass ball, a glazed ball and a mirror cube that float in a room which is a cubemap.

    Look at the straight rows of tiles behind them, at the six sides in the mirror, and at the room upside down in
    the glass.
    """
    mirror = Material(specular=(0.95, 0.95, 0.95), name="mirror")
    glass = Material(transmissive=(1.0, 1.0, 1.0), index=1.5, name="glass")
    glazed = Material(diffuse=(0.7, 0.65, 0.55), specular=(0.1, 0.1, 0.1), name="glazed")
    balls = [
        Sphere(transform=translate(-1.15, 0.0, 0.0) @ scale(0.7), material=mirror, name="mirror ball"),
        Sphere(transform=translate(0.55, -0.1, 0.45) @ scale(0.6), material=glass, name="glass ball"),
        Sphere(transform=translate(0.1, 0.75, -0.9) @ scale(0.4), material=glazed, name="glazed ball"),
        Box(
            transform=translate(1.5, 0.15, -0.7) @ rotate("y", 35) @ rotate("x", 20) @ scale(0.8),
            material=mirror,
            name="mirror cube",
        ),
    ]
    camera = Camera.look_at((0.0, 0.3, 5.0), (0.1, 0.1, 0.0), fov=36.0, aspect=1.6)
    return Scene(shapes=balls, cameras=[camera], environment=_room(), name="cubemap")
