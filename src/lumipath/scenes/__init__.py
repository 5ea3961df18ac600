"""Built-in scenes by name, made when they are asked for."""

from __future__ import annotations

import difflib
import importlib
from typing import TYPE_CHECKING

from ..errors import SceneError

if TYPE_CHECKING:
    from ..scene import Scene

# Name: module and function here, and a line for people. Kept here, so that a listing loads none of them.
_SCENES = {
    "cornell-box": ("cornell", "cornell_box", "the Cornell box as measured at Cornell University: two white blocks"),
    "cornell-box-glass": ("cornell", "cornell_box_glass", "the Cornell box with a mirror and a glass sphere"),
    "cornell-box-specular": ("cornell", "cornell_box_specular", "the Cornell box with polished blocks and floor"),
    "cornell-box-transmissive": (
        "cornell",
        "cornell_box_transmissive",
        "the Cornell box with a glass block, a polished one and a polished floor",
    ),
    "primitives": ("primitives", "primitives", "spheres, ellipsoids, cones, cylinders, boxes and squares"),
    "glass": ("glass", "glass", "nested glass spheres that absorb light, under a sky"),
    "depth-of-field": ("lens", "depth_of_field", "a row of spheres through a wide lens"),
    "textures": ("textures", "textures", "image textures, smooth normals and blended vertex materials"),
    "knot40k": ("knot", "knot40k", "a lacquered knot of a ribbed tube in the Cornell box, 40,000 triangles"),
    "textured-primitives": ("textured", "textured_primitives", "one chart of colours on every primitive and lobe"),
    "cubemap": ("cubemap", "cubemap", "mirrors and glass in a room that is a cubemap"),
    "lights": ("lights", "lights", "point, directional and ambient lights on three columns"),
    "caustics": ("caustics", "caustics", "light gathered by a glass ball, a metal ring and a red glass cone"),
    "many-lobes": ("lobes", "many_lobes", "materials that add up matt, mirror, glass and emission"),
    "bokeh": ("bokeh", "bokeh", "small lamps out of focus, through a lens of six blades"),
    "sundial": ("sundial", "sundial", "a sundial in the evening sun, under a computed sky"),
    "many-lamps": ("lanterns", "many_lamps", "a thousand lanterns of very different brightness around a lake"),
    "forest": ("forest", "forest", "a thousand trees of 100,000 triangles each, of three kinds that are stored once"),
    "glass-of-water": ("water", "glass_of_water", "water in a glass, which overlap and have priorities"),
    "materials": ("studio", "materials", "the principled material: gold, plastic, lacquer, cloth, films and glass"),
    "material-grid": (
        "studio",
        "material_grid",
        "the principled material by roughness and metallic, glass by its index",
    ),
    "bench-cornell": ("bench", "bench_cornell", "benchmark: a Cornell box of 36 triangles"),
    "bench-blob100k": ("bench", "bench_blob100k", "benchmark: a bumpy sphere in a box, 99,236 triangles"),
    "bench-blob1m": ("bench", "bench_blob1m", "benchmark: a bumpy sphere in a box, 998,012 triangles"),
    "bench-materials-cornell": (
        "bench_materials",
        "bench_materials_cornell",
        "benchmark: bench-cornell of all materials",
    ),
    "bench-materials-blob100k": (
        "bench_materials",
        "bench_materials_blob100k",
        "benchmark: bench-blob100k of all materials",
    ),
    "bench-materials-blob1m": (
        "bench_materials",
        "bench_materials_blob1m",
        "benchmark: bench-blob1m of all materials",
    ),
}

DEFAULT = "cornell-box"


def names() -> dict[str, str]:
    """Name and one-line description of every built-in scene."""
    return {name: description for name, (_, _, description) in _SCENES.items()}


def builtin(name: str) -> Scene:
    """A new copy of the built-in scene of that name.

    Raises:
        SceneError: no such scene; the message gives near matches.
    """
    if name not in _SCENES:
        near = difflib.get_close_matches(name, _SCENES, 3, cutoff=0.5)
        hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(_SCENES)}"
        raise SceneError(f"no built-in scene {name!r}; {hint}")
    module, function, _ = _SCENES[name]
    scene: Scene = getattr(importlib.import_module(f".{module}", __name__), function)()
    return scene


__all__ = ["DEFAULT", "builtin", "names"]
