"""How much of a texture a ray covers.

After Akenine-Moller et al. 2021, Improved Shader and Texture Level of Detail Using Ray Cones; docs/decisions has the
reasons for what differs.
"""

from __future__ import annotations

from ..lang import f32, i32, inverse, kernel, sqrt, u32
from ..pack.layout import TEXTURES
from .camera import pixel_spread
from .mixes import with_one_material
from .normal_maps import with_bent_normal
from .sampler import surface_numbers
from .surface import surface_at, with_footprint
from .tangents import uv_per_metre
from .vectors import dot

# Of the cone that a BSDF's density stands for: its width over the root of its solid angle.
_LOBE_SHARE = f32(0.25)
# The least part of a pixel that a sample stands for, as in pbrt (4th edition, section 10.1).
_LEAST = f32(0.125)
_ENOUGH = u32(64)


@kernel
def sharp(scene, view, path, t, s, pixel, sample):
    """A scene without textures."""
    return s


@kernel(needs=TEXTURES, otherwise=sharp)
def with_ray_footprint(scene, view, path, t, s, pixel, sample):
    """The surface with the footprint of the path's ray, whose length is t."""
    spread = pixel_spread(view)
    # A narrow cone around a mirrored ray, a wide one around one that a rough surface scattered.
    if path.pdf > 0.0:
        spread = max(spread, _LOBE_SHARE * inverse(sqrt(path.pdf)))
    # Each further sample of a pixel stands for a smaller part of it, so that pictures become sharp.
    share = max(inverse(sqrt(f32(1.0) + f32(i32(min(sample, _ENOUGH))))), _LEAST)
    width = t * spread * share
    cosine = max(-dot(s.n, path.ray.d), 1e-3)
    # Between two steps of a texture one is chosen by chance.
    chance = surface_numbers(scene, pixel, sample, view.seed, path.depth).c
    return with_footprint(s, width / cosine * uv_per_metre(s.tangents) * (1.0 + chance))


@kernel
def shading_surface(scene, view, path, hit, pixel, sample):
    """The surface that a path has hit, as its material is to see it: with a footprint, one material, bent normals."""
    s = with_ray_footprint(scene, view, path, hit.t, surface_at(scene, path.ray, hit), pixel, sample)
    return with_bent_normal(scene, path.ray, with_one_material(scene, view, s, pixel, sample, path.depth))


@kernel
def looked_at_surface(scene, view, ray, hit, pixel, sample, depth):
    """The surface that a look has hit: one material, bent normals, and textures as they are."""
    s = with_one_material(scene, view, surface_at(scene, ray, hit), pixel, sample, depth)
    return with_bent_normal(scene, ray, s)
