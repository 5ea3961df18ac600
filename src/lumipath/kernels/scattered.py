"""What becomes of a path where it scatters: structs that the kinds of materials share."""

from __future__ import annotations

from ..lang import Vec3, f32, i32, struct
from .rays import Ray


@struct
class DirectLight:
    """A shadow ray and the radiance that it lets through."""

    shadow: Ray
    radiance: Vec3
    group: i32


@struct
class Scattered:
    """What a surface does with a path that arrives: direct light, and the direction that the path goes on in."""

    shadow: Ray  # tmax = 0: none
    direct: Vec3  # radiance that reaches the pixel if nothing is on `shadow`
    direction: Vec3
    weight: Vec3  # f times cosine over density; 0: the path ends
    pdf: f32  # as in Path
    blocked: bool  # the true surface lies in the way
    light: i32  # light group of `direct`
