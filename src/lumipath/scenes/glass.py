"""Glass inside glass: refraction at every boundary, colour from the length of the way through."""

from __future__ import annotations

from ..scene import Camera, Material, Scene, Sphere
from ._build import floor, scale, sky, translate

_GLASS_INDEX = 1.5


def _ball(x: float, radius: float, material: Material, name: str) -> Sphere:
    return Sphere(transform=translate(x, 0.75, 0.0) @ scale(radius), material=material, name=name)


def glass() -> Scene:
    """Three glass balls: one hollow, one with a solid core, one of shells; 7 spheres on a floor under a sky."""
    clear = Material(transmissive=(1.0, 1.0, 1.0), index=_GLASS_INDEX, name="clear glass")
    # Fractions of light left after one metre.
    green = Material(transmissive=(0.2, 0.85, 0.45), index=_GLASS_INDEX, name="green glass")
    amber = Material(transmissive=(0.9, 0.5, 0.1), index=_GLASS_INDEX, name="amber glass")
    # Seen from within the glass, air is the thinner side.
    bubble = Material(transmissive=(1.0, 1.0, 1.0), index=1.0 / _GLASS_INDEX, name="air bubble")
    core = Material(diffuse=(0.8, 0.1, 0.08), name="red core")
    balls = [
        _ball(-1.6, 0.7, green, "hollow ball"),
        _ball(-1.6, 0.45, bubble, "hollow"),
        _ball(0.0, 0.7, amber, "solid ball"),
        _ball(0.0, 0.3, core, "core"),
        _ball(1.6, 0.7, clear, "outer shell"),
        _ball(1.6, 0.6, bubble, "gap"),
        _ball(1.6, 0.4, green, "inner ball"),
    ]
    ground = floor(6.0, material=Material(diffuse=(0.55, 0.5, 0.45), name="floor"))
    camera = Camera.look_at((0.0, 1.6, 6.0), (0.0, 0.7, 0.0), fov=32.0, aspect=1.6)
    return Scene(shapes=[ground, *balls], cameras=[camera], environment=sky(), name="glass")
