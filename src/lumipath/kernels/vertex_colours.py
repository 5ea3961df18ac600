"""Colours given at the corners of triangles."""

from __future__ import annotations

from ..lang import f32, kernel, load, load4
from ..pack.layout import VERTEX_COLOURS
from .vectors import white, xyz


@kernel
def corner_colours(scene, corner, w1, w2):
    """Red, green, blue and alpha at a point of a triangle whose vertex numbers lie at `corner`."""
    a = load4(scene.vertex_colours, load(scene.corners, corner) * 4)
    b = load4(scene.vertex_colours, load(scene.corners, corner + 1) * 4)
    c = load4(scene.vertex_colours, load(scene.corners, corner + 2) * 4)
    w0 = 1.0 - w1 - w2
    return xyz(a) * w0 + xyz(b) * w1 + xyz(c) * w2, a[3] * w0 + b[3] * w1 + c[3] * w2


@kernel
def uncoloured(scene, corner, w1, w2):
    """A scene without such colours."""
    return white()


@kernel(needs=VERTEX_COLOURS, otherwise=uncoloured)
def vertex_colour(scene, corner, w1, w2):
    """What the material's colour is multiplied by; `corner` as in `Surface`."""
    if corner < 0:
        return white()
    colour, _ = corner_colours(scene, corner, w1, w2)
    return colour


@kernel
def opaque(scene, corner, w1, w2):
    """A scene without such colours."""
    return f32(1.0)


@kernel(needs=VERTEX_COLOURS, otherwise=opaque)
def vertex_alpha(scene, corner, w1, w2):
    """What the material's opacity is multiplied by; `corner` as in `Surface`."""
    if corner < 0:
        return f32(1.0)
    _, alpha = corner_colours(scene, corner, w1, w2)
    return alpha
