"""Shading normals bent by textures."""

from __future__ import annotations

from ..lang import as_int, f32, kernel, load4
from ..pack.layout import MAP_NORMALS, MAP_SIZE, NORMAL_MAPS, TEXTURE_SIZE
from .surface import surface_at, with_shading
from .tangents import normal_in, uv_frame
from .textures import texture_colour
from .vectors import cross, dot, normalize


@kernel
def bent_by_normals(scene, s, n, texture, scale):
    """The normal n turned as a map of normals says; they lie in the frame of the texture coordinates."""
    c = texture_colour(scene, texture, s.u, s.v, s.footprint)
    return normal_in(uv_frame(s.tangents, n), (2.0 * c.x - 1.0) * scale, (2.0 * c.y - 1.0) * scale, 2.0 * c.z - 1.0)


@kernel
def bent_by_heights(scene, s, n, texture, height):
    """The normal n of the surface moved outwards by a map of heights.

    Mikkelsen 2010, Bump Mapping Unparametrized Surfaces on the GPU.
    """
    # Differences over one texel, or over what the ray covers.
    density = load4(scene.textures, texture * TEXTURE_SIZE + 8)[3]
    step = max(0.5 / density, 0.5 * s.footprint)
    along = f32(0.0)
    up = f32(0.0)
    for k in range(4):
        side = f32(1.0) if (k & 1) == 0 else f32(-1.0)
        du = step * side if k < 2 else f32(0.0)
        dv = step * side if k >= 2 else f32(0.0)
        h = texture_colour(scene, texture, s.u + du, s.v + dv, s.footprint).x * side
        along = along + (h if k < 2 else f32(0.0))
        up = up + (h if k >= 2 else f32(0.0))
    scale = height * 0.5 / step
    r1 = cross(s.tangents.v, n)
    r2 = cross(n, s.tangents.u)
    determinant = dot(s.tangents.u, r1)
    side = f32(1.0) if determinant >= 0.0 else f32(-1.0)
    bent = n * abs(determinant) - (r1 * along + r2 * up) * (side * scale)
    return normalize(bent) if dot(bent, bent) > 0.0 else n


@kernel
def seen_normal(s, n, wo):
    """The normal n, turned no more than a mirror needs that shows the viewer something above the surface.

    Keller et al. 2017, The Iray Light Transport Simulation and Rendering System, appendix A.3.
    """
    facing = dot(n, s.n)
    n = n if facing > 1e-3 else normalize(n + s.n * (1e-3 - facing))
    mirrored = n * (2.0 * dot(n, wo)) - wo
    height = dot(mirrored, s.n)
    least = min(0.9 * dot(wo, s.n), 0.01)
    return n if height >= least else normalize(wo + normalize(mirrored + s.n * (least - height)))


@kernel
def unbent(scene, ray, s):
    """A scene without maps of normals or heights."""
    return s


@kernel(needs=NORMAL_MAPS, otherwise=unbent)
def with_bent_normal(scene, ray, s):
    """The surface with the shading normal that its material's maps say."""
    row = load4(scene.maps, s.material * MAP_SIZE + MAP_NORMALS)
    normals = as_int(row[2])
    heights = as_int(row[3])
    flat = not dot(cross(s.tangents.u, s.tangents.v), s.n) != 0.0
    if flat | ((normals < 0) & (heights < 0)):
        return s
    # Maps are made for the front.
    side = f32(1.0) if s.front else f32(-1.0)
    n = s.shading * side
    if normals >= 0:
        n = bent_by_normals(scene, s, n, normals, row[0])
    if heights >= 0:
        n = bent_by_heights(scene, s, n, heights, row[1])
    return with_shading(s, seen_normal(s, n * side, -ray.d))


@kernel
def mapped_surface(scene, ray, hit):
    """The surface that a hit found, its normals bent by maps; a mix is left as it is."""
    return with_bent_normal(scene, ray, surface_at(scene, ray, hit))
