"""The Cornell box: a real box whose shape and colours were measured at Cornell University.

Geometry, spectra and camera: https://www.graphics.cornell.edu/online/box/data.html. Coordinates are as published (they
are millimetres; the camera looks along +z), in metres here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene import Camera, Material, Mesh, Scene, Sphere
from ._build import quads, scale, translate

MILLIMETRE = 1e-3

# Linear Rec.709 of the measured reflectances under D65.
WHITE = Material(diffuse=(0.738, 0.736, 0.740), name="white")
RED = Material(diffuse=(0.490, 0.050, 0.051), name="red")
GREEN = Material(diffuse=(0.069, 0.398, 0.087), name="green")
# The published lamp spectrum relative to an equal-energy one.
LAMP = Material(emission=(17.2, 11.5, 3.06), name="lamp")

# The lamp lies in the plane of the ceiling; a gap keeps the two apart.
_LAMP_Y = 548.8 - 0.5

_FLOOR = ((552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2))
_CEILING = ((556.0, 548.8, 0), (556.0, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0))
_BACK = ((549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556.0, 548.8, 559.2))
_RIGHT = ((0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2))
_LEFT = ((552.8, 0, 0), (549.6, 0, 559.2), (556.0, 548.8, 559.2), (556.0, 548.8, 0))
_LAMP = ((343.0, _LAMP_Y, 227.0), (343.0, _LAMP_Y, 332.0), (213.0, _LAMP_Y, 332.0), (213.0, _LAMP_Y, 227.0))

_SHORT_BLOCK = (
    ((130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)),
    ((290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)),
    ((130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)),
    ((82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)),
    ((240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)),
)
_TALL_BLOCK = (
    ((423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)),
    ((423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)),
    ((472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)),
    ((314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)),
    ((265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)),
)

# The underside, which a block of glass needs: its inside must be closed.
_TALL_BLOCK_BOTTOM = ((423, 0, 247), (472, 0, 406), (314, 0, 456), (265, 0, 296))
# A gap between it and the floor, so that the two do not coincide.
_GLASS_Y = 1.0

# A film of 25 mm behind a lens of 35 mm.
_FOV = 39.3077


def _part(name: str, material: Material, *corners: Any, two_sided: bool = True) -> Mesh:
    metres = np.asarray(corners, np.float64) * MILLIMETRE
    return quads(*metres, material=material, two_sided=two_sided, name=name)


def room() -> list[Mesh]:
    """Walls that face inwards, and the lamp, which shines downwards only."""
    return [
        _part("floor", WHITE, _FLOOR),
        _part("ceiling", WHITE, _CEILING),
        _part("back wall", WHITE, _BACK),
        _part("right wall", GREEN, _RIGHT),
        _part("left wall", RED, _LEFT),
        _part("lamp", LAMP, _LAMP, two_sided=False),
    ]


def camera() -> Camera:
    """The camera of the published pictures."""
    position = np.array((278.0, 273.0, -800.0)) * MILLIMETRE
    return Camera(position=position, direction=(0.0, 0.0, 1.0), fov=_FOV, focus=1.0)


def cornell_box() -> Scene:
    """The box with its two white blocks; 32 triangles."""
    blocks = [_part("short block", WHITE, *_SHORT_BLOCK), _part("tall block", WHITE, *_TALL_BLOCK)]
    return Scene(shapes=room() + blocks, cameras=[camera()], name="cornell-box")


# The open front of the box is dark: a mirror alone would be black from where the camera stands.
_POLISHED = Material(diffuse=(0.35, 0.35, 0.35), specular=(0.55, 0.55, 0.55), name="polished")
_POLISHED_FLOOR = Material(diffuse=WHITE.diffuse, specular=(0.15, 0.15, 0.15), name="polished floor")


def _polished_room() -> list[Mesh]:
    """The room with a floor that mirrors a little."""
    _, *others = room()
    return [_part("floor", _POLISHED_FLOOR, _FLOOR), *others]


def cornell_box_specular() -> Scene:
    """The box with polished blocks on a polished floor; 32 triangles."""
    blocks = [_part("short block", _POLISHED, *_SHORT_BLOCK), _part("tall block", _POLISHED, *_TALL_BLOCK)]
    return Scene(shapes=_polished_room() + blocks, cameras=[camera()], name="cornell-box-specular")


def cornell_box_transmissive() -> Scene:
    """The box with a polished block and one of glass on a polished floor; 34 triangles."""
    # Of light that travels one metre inside, so much is left.
    glass = Material(transmissive=(0.5, 0.8, 0.7), index=1.5, name="glass")
    corners = np.add((*_TALL_BLOCK, _TALL_BLOCK_BOTTOM), (0.0, _GLASS_Y, 0.0))
    blocks = [_part("short block", _POLISHED, *_SHORT_BLOCK), _part("tall block", glass, *corners)]
    return Scene(shapes=_polished_room() + blocks, cameras=[camera()], name="cornell-box-transmissive")


def _ball(name: str, centre: tuple[float, float, float], radius: float, material: Material) -> Sphere:
    x, y, z = (coordinate * MILLIMETRE for coordinate in centre)
    return Sphere(transform=translate(x, y, z) @ scale(radius * MILLIMETRE), material=material, name=name)


def cornell_box_glass() -> Scene:
    """The box with a mirror sphere in the place of the tall block and a glass one in that of the short block."""
    mirror = Material(specular=(0.95, 0.95, 0.95), name="mirror")
    clear_glass = Material(transmissive=(1.0, 1.0, 1.0), index=1.5, name="clear glass")
    balls = [
        _ball("mirror sphere", (390.0, 110.0, 360.0), 110.0, mirror),
        _ball("glass sphere", (165.0, 100.0, 180.0), 100.0, clear_glass),
    ]
    return Scene(shapes=[*room(), *balls], cameras=[camera()], name="cornell-box-glass")
