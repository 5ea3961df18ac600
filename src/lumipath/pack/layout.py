"""The packed scene: flat arrays, their records, and the feature bits. Declared here once, for packing and for kernels.

Every record is a row of float32 (`rows of 4` are read by one 128-bit load); integers lie in it as bits.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from ..lang import Features, f32, i32, u32

# ---- feature bits: what the scene and the settings use --------------------------------------------------------------
MIRRORS = 1 << 0
DIELECTRICS = 1 << 1
TEXTURES = 1 << 2
SMOOTH_NORMALS = 1 << 3
BLENDED_MATERIALS = 1 << 4
CULLING = 1 << 5
QUADRICS = 1 << 6
TRIANGLE_LIGHTS = 1 << 7
QUADRIC_LIGHTS = 1 << 8
POINT_LIGHTS = 1 << 9
DIRECTIONAL_LIGHTS = 1 << 10
ENVIRONMENT = 1 << 11
MANY_LIGHTS = 1 << 12
INDEPENDENT_SAMPLER = 1 << 13
UNIFORM_HEMISPHERE = 1 << 14
SCHLICK_FRESNEL = 1 << 15
LENS = 1 << 16
ROULETTE = 1 << 17
WIDE_TREE = 1 << 18
LIGHT_TREE = 1 << 19
SPOT_LIGHTS = 1 << 20
SUNS = 1 << 21
BLADES = 1 << 22
ROUND_LIGHTS = 1 << 28

# Integrators, one at a time; none of these bits is the path tracer.
WHITTED = 1 << 32
ALBEDO = 1 << 33
NORMAL = 1 << 34
DEPTH = 1 << 35
OCCLUSION = 1 << 36
# Not an integrator to choose: the pass that fills `LayerArrays`.
LAYERS = 1 << 37

# The film keeps squares of samples, and each tile of it has a goal of its own.
ADAPTIVE = 1 << 40

DELTA_LIGHTS = POINT_LIGHTS | SPOT_LIGHTS | DIRECTIONAL_LIGHTS | SUNS
"""What Whitted ray tracing takes for points and directions."""

ANY_LIGHT = TRIANGLE_LIGHTS | QUADRIC_LIGHTS | DELTA_LIGHTS | ENVIRONMENT
SURFACE_LIGHTS = TRIANGLE_LIGHTS | QUADRIC_LIGHTS
VERTEX_DATA = TEXTURES | SMOOTH_NORMALS | BLENDED_MATERIALS
PIXEL_INTEGRATORS = WHITTED | ALBEDO | NORMAL | DEPTH | OCCLUSION | LAYERS
"""Those whose sample is one function, with no batches of paths."""

# ---- primitives: 4 floats: geometric unit normal xyz (0 for a quadric), then as bits the material's number (24) and
#      the exponent of the primitive's greatest coordinate (8)
PRIMITIVE_SIZE = i32(4)
MATERIAL_MASK = i32((1 << 24) - 1)
REACH_SHIFT = i32(24)

# ---- vertices: 8 floats: position xyz, u; shading normal xyz, v ------------------------------------------------------
VERTEX_SIZE = i32(8)

# ---- materials: 28 floats. Each colour is followed by its texture number as bits, -1 for none ------------------------
MATERIAL_SIZE = i32(28)
DIFFUSE = i32(0)  # albedo rgb
EMISSION = i32(4)  # radiance rgb
MIRROR = i32(8)  # weight rgb
EXTINCTION = i32(12)  # of the inside, 1/m, rgb; the fourth float is 1 for a dielectric, else 0
REFLECTION_TINT = i32(16)  # of Fresnel reflection, rgb
INTERNAL_TINT = i32(20)  # of total internal reflection, rgb
REFRACTION = i32(24)  # index of refraction, mean transmissive weight, unused, unused

# ---- what only Whitted ray tracing needs to know of materials: 16 floats. Colours as above --------------------------
PHONG_SIZE = i32(16)
PHONG_AMBIENT = i32(0)  # reflected fraction of ambient light, rgb
PHONG_HIGHLIGHT = i32(4)  # weight of the highlight, rgb
PHONG_MIRROR = i32(8)  # weight of the mirror, rgb
PHONG_EXPONENT = i32(12)  # shininess, three unused

# ---- textures: 4 ints: first texel, width, height, 1 to clamp; texels: 4 floats: rgb, unused ------------------------
TEXTURE_SIZE = i32(4)

# ---- quadrics: 16 floats: world to object as rows of 4, then kind as bits, radius at 0, radius at height, height;
#      of a sphere only 1 in place of the first radius, if its transform is a similarity -------------------------------
QUADRIC_SIZE = i32(16)
SPHERE = i32(0)
OPEN_CONE = i32(1)
CAPPED_CONE = i32(2)

# ---- lights: 24 floats, in the order triangles, quadrics, points, spots, directional, suns, environment -------------
# 0 alias threshold, other index, probability, kind; then by kind:
#   triangle    4 vertex, density per area   8 edge, primitive   12 edge, 1 if two-sided   16 normal, material
#   quadric     4 object to world as rows of 4   16 quadric, primitive, material, density per object area
#   point       4 position   8 colour   12 attenuation
#   spot        4 position, cosine of the outer angle   8 intensity, 1 / (cosine of the inner angle - that)   12 axis;
#               a point light of an intensity is a spot that shines everywhere
#   directional 4 direction to the light   8 colour
#   sun         4 direction to its middle, square of its radius as a chord of the unit sphere
#               8 colour, radiance over colour   12 density per solid angle
#   environment nothing more
# With LIGHT_TREE, what is in the tree has the probability 1, and densities to match, since that of the tree depends on
# the point that is lit; the alias table is that of the lights that are infinitely far away.
LIGHT_SIZE = i32(24)
TRIANGLE_LIGHT = i32(0)
QUADRIC_LIGHT = i32(1)
POINT_LIGHT = i32(2)
DIRECTIONAL_LIGHT = i32(3)
ENVIRONMENT_LIGHT = i32(4)
SPOT_LIGHT = i32(5)
SUN_LIGHT = i32(6)

# ---- light tree: 12 floats a node: centre and radius of a sphere around its lights; axis of their normals, intensity
#      (negative where light leaves in both directions of the axis); cosine and sine of the angle between axis and
#      normals, cosine of the angle from a normal in which light leaves, and as bits the link: the first of two
#      children, which follow each other, or -1 - light. The root is node 0 and node 1 is empty, so that k ^ 1 is the
#      sibling of k
LIGHT_NODE_SIZE = i32(12)

# ---- environment: 4 floats a texel: radiance rgb, density per solid angle times sin(theta). Rows and cells are alias
#      tables of 2 floats: threshold, other index as bits; first the row is drawn, then the cell in it


class PackedScene(NamedTuple):
    """A scene as kernels see it; picklable, and the same on every device."""

    features: Features
    accel: Any  # the BVH: a NamedTuple of `accel`
    primitives: NDArray[Any]  # (P, 4) float32; triangles first, then quadrics
    corners: NDArray[Any]  # (T, 4) int32: vertex numbers of a triangle; empty without VERTEX_DATA
    vertices: NDArray[Any]  # (V, 8) float32; empty without VERTEX_DATA
    vertex_materials: NDArray[Any]  # (V,) int32; empty without BLENDED_MATERIALS
    emitter_density: NDArray[Any]  # (P,) float32: density per area of being sampled as a light; 0: not a light
    quadrics: NDArray[Any]  # (Q, 16) float32
    materials: NDArray[Any]  # (M, 28) float32
    phong: NDArray[Any]  # (M, 16) float32
    textures: NDArray[Any]  # (N, 4) int32
    texels: NDArray[Any]  # (., 4) float32
    lights: NDArray[Any]  # (L, 24) float32
    light_count: i32
    first_delta: i32  # the first point, spot or directional light or sun; they follow each other
    delta_count: i32
    first_sun: i32
    sun_count: i32
    light_nodes: NDArray[Any]  # (K, 12) float32; empty without LIGHT_TREE
    light_parents: NDArray[Any]  # (K,) int32: of each node, -1 of the root; empty without LIGHT_TREE
    emitter_node: NDArray[Any]  # (P,) int32: leaf of each primitive in the light tree, -1: none; empty without it
    tree_probability: f32  # of choosing among the lights in the tree, not among those infinitely far away
    first_infinite: i32  # the first light that is infinitely far away; they follow each other
    ambient: NDArray[Any]  # (4,) float32: sum of the ambient lights rgb, unused
    extent: f32  # diagonal of the box around all shapes, metres
    triangle_count: i32
    environment: NDArray[Any]  # (H * W, 4) float32
    environment_rows: NDArray[Any]  # (H, 2) float32
    environment_cells: NDArray[Any]  # (H * W, 2) float32
    environment_frame: NDArray[Any]  # (12,) float32: world to environment (a rotation) as rows of 4
    environment_width: i32
    environment_height: i32
    environment_probability: f32  # of choosing the environment among the lights


# ---- View.lens: where the distance of the plane in focus is
FOCUS = i32(7)


class View(NamedTuple):
    """Camera, film and limits of one render, as kernels see them."""

    # (20,) float32: position, aperture; right, focus; up, half height; backward, half width;
    # blades of the aperture, turn of their first corner from the right (turns), unused, unused
    lens: NDArray[Any]
    width: i32  # of the full image, pixels
    height: i32
    left: i32  # of the part on the film
    top: i32
    film_width: i32
    film_height: i32
    seed: u32
    first_sample: u32  # number of the sample that the film's count 0 stands for
    max_depth: i32
    rr_depth: i32
    ao_distance: f32  # metres; 0: follows from the scene's extent


TILE = i32(16)
"""Side of the squares of pixels of which each has a goal, and which CPU threads take one by one."""


class FilmArrays(NamedTuple):
    """The film as kernels see it."""

    total: NDArray[Any]  # (H, W, 3) float32: sums of samples
    lost: NDArray[Any]  # (H, W, 3) float32: what the rounding of the sums lost
    counts: NDArray[Any]  # (H, W) uint32: numbers of samples
    squares: NDArray[Any]  # (H, W) float32: sums of the squared luminance of samples; (0, 0) without ADAPTIVE
    goals: NDArray[Any]  # (ceil(H / TILE), ceil(W / TILE)) int32: samples that a tile is to have; or (0, 0)


class LayerColumns(NamedTuple):
    """The first column of each layer in `LayerArrays.sums`; -1: not wanted."""

    albedo: i32
    normal: i32
    geometric_normal: i32
    position: i32
    emission: i32
    uv: i32
    depth: i32


class LayerArrays(NamedTuple):
    """Layers of the first hit as kernels see them.

    Sums over the samples (H, W, C) float32, numbers of samples that hit something (H, W) uint32, numbers of samples
    (H, W) uint32, and the primitive at each pixel's middle (H, W) int32, -1 for none.
    """

    sums: NDArray[Any]
    hits: NDArray[Any]
    counts: NDArray[Any]
    primitives: NDArray[Any]
    columns: LayerColumns
    channels: i32  # C
