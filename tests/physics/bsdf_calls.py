"""BSDFs over arrays of directions and random numbers, without a renderer around them."""

from __future__ import annotations

from typing import Any

import numpy as np
from kernel_calls import looped

from lumipath.kernels.bsdf.conductor import Metal, eval_metal, sample_metal
from lumipath.kernels.bsdf.rough_dielectric import RoughDielectric, eval_rough_dielectric, sample_rough_dielectric
from lumipath.kernels.bsdf.rough_diffuse import RoughDiffuse, eval_rough_diffuse, sample_rough_diffuse
from lumipath.kernels.bsdf.thin_dielectric import ThinDielectric, eval_thin_dielectric, sample_thin_dielectric
from lumipath.lang import Vec3, kernel
from lumipath.pack.layout import PackedScene
from lumipath.pack.scene import pack_scene
from lumipath.scene import Scene, Sphere


def packed_with(*materials: Any) -> PackedScene:
    """A packed scene that has these materials, and nothing to be seen."""
    return pack_scene(Scene(shapes=[Sphere(material=material) for material in materials])).scene


def numbers(seed: int, count: int, dimensions: int = 2) -> np.ndarray:
    """(dimensions, count) float32: random numbers in [0, 1)."""
    drawn = np.random.default_rng(seed).random((dimensions, count), np.float32)
    return np.minimum(drawn, np.float32(1 - 2**-24))


def square(rows: int, columns: int) -> np.ndarray:
    """(2, rows * columns) float32: the middles of the cells of the unit square, row by row."""
    u, v = ((np.arange(count, dtype=np.float32) + 0.5) / count for count in (rows, columns))
    return np.stack([np.repeat(u, columns), np.tile(v, rows)])


def at_angle(cosine: Any, turn: Any = 0.0) -> np.ndarray:
    """(3, ...) float32: unit vectors at the angle of that cosine from z, `turn` turns about it."""
    cosine, turn = np.broadcast_arrays(np.asarray(cosine, float), np.asarray(turn, float))
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(2 * np.pi * turn), sine * np.sin(2 * np.pi * turn), cosine]).astype(np.float32)


# ---- one function for each kind: from parameters, angles and random numbers to numbers -------------------------------


def metal(alpha_x, alpha_y):
    return Metal(False, Vec3(1, 1, 1), Vec3(1, 1, 1), alpha_x, alpha_y, Vec3(1, 1, 1))


def glass(eta, alpha_x, alpha_y):
    return RoughDielectric(eta, alpha_x, alpha_y, Vec3(1, 1, 1), Vec3(1, 1, 1), 1.0)


def sheet(index, alpha):
    return ThinDielectric(index, alpha, Vec3(1, 1, 1), 1.0)


def matt(roughness):
    return RoughDiffuse(Vec3(1, 1, 1), roughness)


metal, glass, sheet, matt = kernel(metal), kernel(glass), kernel(sheet), kernel(matt)


def eval_of_metal(scene, eta, alpha_x, alpha_y, ox, oy, oz, ix, iy, iz):
    value = eval_metal(scene, metal(alpha_x, alpha_y), Vec3(ox, oy, oz), Vec3(ix, iy, iz))
    return value.f.x, value.pdf


def sample_of_metal(scene, eta, alpha_x, alpha_y, ox, oy, oz, u, v, choice):
    s = sample_metal(scene, metal(alpha_x, alpha_y), Vec3(ox, oy, oz), u, v)
    return s.wi.x, s.wi.y, s.wi.z, s.weight.x, s.pdf


def eval_of_glass(scene, eta, alpha_x, alpha_y, ox, oy, oz, ix, iy, iz):
    value = eval_rough_dielectric(scene, glass(eta, alpha_x, alpha_y), Vec3(ox, oy, oz), Vec3(ix, iy, iz))
    return value.f.x, value.pdf


def sample_of_glass(scene, eta, alpha_x, alpha_y, ox, oy, oz, u, v, choice):
    s = sample_rough_dielectric(scene, glass(eta, alpha_x, alpha_y), Vec3(ox, oy, oz), u, v, choice)
    return s.wi.x, s.wi.y, s.wi.z, s.weight.x, s.pdf


def eval_of_sheet(scene, eta, alpha_x, alpha_y, ox, oy, oz, ix, iy, iz):
    value = eval_thin_dielectric(sheet(eta, alpha_x), Vec3(ox, oy, oz), Vec3(ix, iy, iz))
    return value.f.x, value.pdf


def sample_of_sheet(scene, eta, alpha_x, alpha_y, ox, oy, oz, u, v, choice):
    s = sample_thin_dielectric(sheet(eta, alpha_x), Vec3(ox, oy, oz), u, v, choice)
    return s.wi.x, s.wi.y, s.wi.z, s.weight.x, s.pdf


def eval_of_matt(scene, eta, roughness, unused, ox, oy, oz, ix, iy, iz):
    value = eval_rough_diffuse(matt(roughness), Vec3(ox, oy, oz), Vec3(ix, iy, iz))
    return value.f.x, value.pdf


def sample_of_matt(scene, eta, roughness, unused, ox, oy, oz, u, v, choice):
    s = sample_rough_diffuse(matt(roughness), Vec3(ox, oy, oz), u, v)
    return s.wi.x, s.wi.y, s.wi.z, s.weight.x, s.pdf


EVALS = {
    "metal": looped(eval_of_metal, outputs=2, scene=True),
    "glass": looped(eval_of_glass, outputs=2, scene=True),
    "sheet": looped(eval_of_sheet, outputs=2, scene=True),
    "matt": looped(eval_of_matt, outputs=2, scene=True),
}
"""(2, N): f times |cosine|, and density; of white facets without compensation. Arguments: a packed scene, relative
index of refraction, alpha along x and y (of a matt surface roughness and anything), the three numbers of wo, the three
of wi."""

SAMPLES = {
    "metal": looped(sample_of_metal, outputs=5, scene=True),
    "glass": looped(sample_of_glass, outputs=5, scene=True),
    "sheet": looped(sample_of_sheet, outputs=5, scene=True),
    "matt": looped(sample_of_matt, outputs=5, scene=True),
}
"""(5, N): wi, weight and density. Arguments: a packed scene, relative index of refraction, alpha along x and y, the
three numbers of wo, three random numbers."""
