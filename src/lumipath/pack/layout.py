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
# The window of the image is not about the viewing direction; then projections, at most one: none is perspective.
SHIFT = 1 << 23
ORTHOGRAPHIC = 1 << 24
PANORAMA = 1 << 25
FISHEYE = 1 << 26
EQUISOLID = 1 << 27
ROUND_LIGHTS = 1 << 28
INSTANCES = 1 << 29
BLUE_NOISE = 1 << 30

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
# What `FilmArrays.parts` holds, in this order: emission, direct and indirect light; light by groups; squares.
PARTS = 1 << 41
GROUPS = 1 << 42
VARIANCE = 1 << 43

# Kinds of BSDFs beside the sum of lobes, and what materials do besides.
ROUGH_DIFFUSE = 1 << 48
CONDUCTORS = 1 << 49
ROUGH_DIELECTRICS = 1 << 50
THIN_DIELECTRICS = 1 << 51
PRINCIPLED = 1 << 52
MIXES = 1 << 53
OPACITY = 1 << 54
NORMAL_MAPS = 1 << 55
ANISOTROPY = 1 << 56
VERTEX_COLOURS = 1 << 58
# Media have priorities: a path is in several at once.
NESTED = 1 << 57
# Settings against fireflies.
CLAMP_INDIRECT = 1 << 59
REGULARIZE = 1 << 60
# Parts of the principled material.
CLEARCOAT = 1 << 61
SHEEN = 1 << 62
IRIDESCENCE = 1 << 63
TRANSMISSION = 1 << 64
SPECULAR = 1 << 65  # dielectrics reflect otherwise than their index says

# Samples of a pixel are spread by a table, not evenly over its square; some count negatively.
FILTER = 1 << 45
SIGNED_FILTER = 1 << 46

# What textures give, beside `TEXTURES` for anything: emission, lobes, numbers and tints of BSDFs. Base colours of BSDFs
# need no bit, since most textures are theirs.
TEXTURED_EMISSION = 1 << 66
TEXTURED_LOBES = 1 << 67
TEXTURED_NUMBERS = 1 << 68
TEXTURED_TINTS = 1 << 69
MEASURED_METALS = 1 << 70
# Lobes that paths scatter at; `MIRRORS` and `DIELECTRICS` are also those that stand for BSDFs, and insides.
LOBE_MIRRORS = 1 << 71
LOBE_GLASS = 1 << 72

SCATTERING_DETAILS = MEASURED_METALS | TEXTURED_LOBES | TEXTURED_TINTS | LOBE_MIRRORS | LOBE_GLASS
LOOKS = WHITTED | ALBEDO | NORMAL | DEPTH | OCCLUSION | LAYERS
"""What sees the lobes that stand for a BSDF."""
MICROFACETS = CONDUCTORS | ROUGH_DIELECTRICS | THIN_DIELECTRICS | PRINCIPLED
"""Kinds that make up for light lost between microfacets, and so need the tables of `PackedScene.energy`."""
BSDFS = ROUGH_DIFFUSE | CONDUCTORS | ROUGH_DIELECTRICS | THIN_DIELECTRICS | PRINCIPLED
PRINCIPLED_PARTS = CLEARCOAT | SHEEN | IRIDESCENCE | TRANSMISSION | SPECULAR
DELTA_LIGHTS = POINT_LIGHTS | SPOT_LIGHTS | DIRECTIONAL_LIGHTS | SUNS
"""What Whitted ray tracing takes for points and directions."""
ANY_LIGHT = TRIANGLE_LIGHTS | QUADRIC_LIGHTS | DELTA_LIGHTS | ENVIRONMENT
SURFACE_LIGHTS = TRIANGLE_LIGHTS | QUADRIC_LIGHTS
TANGENTS = TEXTURES | NORMAL_MAPS | ANISOTROPY
"""What needs to know how texture coordinates lie on a surface."""
VERTEX_DATA = TANGENTS | SMOOTH_NORMALS | BLENDED_MATERIALS | VERTEX_COLOURS
MAPS = MIXES | OPACITY | NORMAL_MAPS
"""What records of `PackedScene.maps` are for."""
FILM_LAYERS = PARTS | GROUPS | VARIANCE
"""Layers that every sample of the image adds to."""
RADIAL = PANORAMA | FISHEYE | EQUISOLID
"""Projections that look in all directions from one point: depth is the distance from it."""
PROJECTION = SHIFT | ORTHOGRAPHIC | RADIAL
"""All that says which direction a point of the image shows."""
PIXEL_INTEGRATORS = WHITTED | ALBEDO | NORMAL | DEPTH | OCCLUSION | LAYERS
"""Those whose sample is one function, with no batches of paths."""

# ---- primitives: 4 floats: geometric unit normal xyz (0 for a quadric), then as bits the material's number (23),
#      whether rays may go through (1), and the exponent of the primitive's greatest coordinate (8)
PRIMITIVE_SIZE = i32(4)
MATERIAL_MASK = i32((1 << 23) - 1)
HAS_HOLES = i32(1 << 23)
REACH_SHIFT = i32(24)

# ---- vertices: 8 floats: position xyz, u; shading normal xyz, v ------------------------------------------------------
VERTEX_SIZE = i32(8)

# ---- materials: 28 floats. Each colour is followed by its texture number as bits, -1 for none ------------------------
MATERIAL_SIZE = i32(28)
DIFFUSE = i32(0)  # albedo rgb
EMISSION = i32(4)  # radiance rgb
MIRROR = i32(8)  # weight rgb
EXTINCTION = i32(12)  # of the inside, 1/m, rgb; the fourth float is 0 where no light goes through, or
REFLECTION_TINT = i32(16)  # of Fresnel reflection, rgb
INTERNAL_TINT = i32(20)  # of total internal reflection, rgb
REFRACTION = i32(24)  # index of refraction, mean transmissive weight, with NESTED its medium as bits, unused
VEILED_BODY = f32(0.5)  # as BODY, but so little light goes through that only paths take notice
BODY = f32(1)  # light goes through it into an inside
SHEET = f32(2)  # light goes through it and comes out again

# ---- BSDFs: 80 floats. Their head is the kind as bits, three unused; then slots of 4. A colour is a factor rgb and the
#      number of a texture as bits, -1 for none; a number is a factor, two unused, and its texture
BSDF_SIZE = i32(80)
BSDF_COLOUR = i32(4)  # albedo, base colour, reflectance or eta of a metal, or tint of what glass transmits
BSDF_EDGE = i32(8)  # metal: k, or its reflectance at 82 degrees relative to Schlick's; glass: tint of reflection
BSDF_ROUGHNESS = i32(12)
BSDF_ANISOTROPY = i32(16)  # strength, rotation (turns), unused, unused
BSDF_REFRACTION = i32(20)  # index of refraction; as bits its table of energy from outside, the next is from inside;
#      of the principled material also 1 for thin walls or 0, and the reflectance face to face
# Of the principled material only.
BSDF_METALLIC = i32(24)
BSDF_TRANSMISSION = i32(28)
BSDF_SPECULAR = i32(32)
BSDF_SPECULAR_COLOUR = i32(36)
BSDF_CLEARCOAT = i32(40)
BSDF_CLEARCOAT_ROUGHNESS = i32(44)
BSDF_SHEEN = i32(48)  # colour
BSDF_SHEEN_ROUGHNESS = i32(52)
BSDF_IRIDESCENCE = i32(56)
BSDF_FILM = i32(60)  # a number: thickness, nm; and in the first unused place the film's index of refraction

# Kinds. LOBES: the record in `materials` is all there is.
LOBES_KIND = i32(0)
ROUGH_DIFFUSE_KIND = i32(1)
MEASURED_METAL_KIND = i32(2)
TINTED_METAL_KIND = i32(3)
ROUGH_DIELECTRIC_KIND = i32(4)
THIN_DIELECTRIC_KIND = i32(5)
PRINCIPLED_KIND = i32(6)

# ---- maps: 16 floats: what materials do besides scattering. Textures are numbers as bits, -1 for none ----------------
MAP_SIZE = i32(16)
MAP_OPACITY = i32(0)  # opacity, its cutoff (-1: none), unused, texture
MAP_NORMALS = i32(4)  # scale of the normal map, metres of the bump map, texture of normals, texture of heights
MAP_MIX = i32(8)  # weight of the second part, numbers of both parts as bits (-1: no mix), texture of the weight

# ---- media, with NESTED: 8 floats: extinction rgb (1/m), priority; index of refraction, three unused
MEDIUM_SIZE = i32(8)
MOST_MEDIA = 126  # 7 bits each, one of them for none
NO_PRIORITY = f32(1e37)  # whatever is above it stands for none

# ---- energy: tables of directional albedos, of `pack/energy.py`. A table has 32 rows of roughness with 32 cells
#      of cosine, and then the mean of each row over the hemisphere
ENERGY_SIDE = i32(32)
ENERGY_TABLE = i32(32 * 33)
ENERGY_WHITE = i32(0)  # of white facets
ENERGY_SCHLICK = i32(1)  # of facets with Schlick's weight, less that weight at the cosine times the white; full means
ENERGY_SHEEN = i32(2)  # of white fibres
ENERGY_INDICES = i32(3)  # from here on two for each index of refraction: from outside and from inside

# ---- what only Whitted ray tracing needs to know of materials: 16 floats. Colours as above --------------------------
PHONG_SIZE = i32(16)
PHONG_AMBIENT = i32(0)  # reflected fraction of ambient light, rgb
PHONG_HIGHLIGHT = i32(4)  # weight of the highlight, rgb
PHONG_MIRROR = i32(8)  # weight of the mirror, rgb
PHONG_EXPONENT = i32(12)  # shininess, three unused

# ---- textures: 16 floats ---------------------------------------------------------------------------------------------
# 0 first texel, width, height, and TEXTURE bits, all as bits   4 factor of red, green, blue and alpha
# 8 from (u, v, 1) to the image's u, then texels per unit of uv  12 the same to its v, then the number of steps as bits
# Coarser steps follow the image, each half as wide and high, rounded down. 8-bit texels are words of red, green, blue
# and alpha, the lowest byte first; where there are any, `texels` begins with the values of 256 sRGB numbers and then of
# 256 linear ones. Other texels are 4 floats.
TEXTURE_SIZE = i32(16)
REPEATED_U = i32(1)
REPEATED_V = i32(2)
MIRRORED_U = i32(4)
MIRRORED_V = i32(8)
NEAREST = i32(16)
CHEQUERED = i32(32)
BYTES = i32(64)
LINEAR_BYTES = i32(128)
CHANNEL_SHIFT = i32(8)  # 3 bits: 0 colour, 1 to 4 red to alpha

# ---- quadrics: 16 floats: world to object as rows of 4, then kind as bits, radius at 0, radius at height, height;
#      of a sphere only 1 in place of the first radius, if it is round and without holes -------------------------------
QUADRIC_SIZE = i32(16)
SPHERE = i32(0)
OPEN_CONE = i32(1)
CAPPED_CONE = i32(2)

# ---- instances: 20 floats: world to object as rows of 4, then as bits the link to the target's tree (filled in by each
#      device), the material in place of those of the target or -1, the number of the shape in the scene, and unused;
#      what `kernels.instances` makes the reach of a primitive of: scale, shift, spread, unused
INSTANCE_SIZE = i32(20)
INSTANCE_LINK = i32(12)
INSTANCE_MATERIAL = i32(13)
INSTANCE_SHAPE = i32(14)
INSTANCE_SCALE = i32(16)
INSTANCE_SHIFT = i32(17)
INSTANCE_SPREAD = i32(18)

# ---- lights: 24 floats, in the order triangles, quadrics, points, spots, directional, suns, environment -------------
# 0 alias threshold, other index, probability, kind; then by kind:
#   triangle    4 vertex, density per area   8 edge, primitive   12 edge, 1 if two-sided   16 normal, material
#   quadric     4 object to world as rows of 4   16 quadric, primitive, material, density per object area
#   point       4 position   8 colour   12 attenuation
#   spot        4 position, 1 - cosine of the outer angle   8 intensity, 1 / (that - 1 + cosine of the inner angle)
#               12 axis; a point light of an intensity is a spot that shines everywhere
#   directional 4 direction to the light   8 colour
#   sun         4 direction to its middle, square of its radius as a chord of the unit sphere
#               8 colour, radiance over colour   12 density per solid angle
#   environment nothing more
# and in the last float the number of the light's group, as bits.
# With LIGHT_TREE, what is in the tree has the probability 1, and densities to match, since that of the tree depends on
# the point that is lit; the alias table is that of the lights that are infinitely far away.
LIGHT_SIZE = i32(24)
LIGHT_GROUP = i32(23)
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
    instances: NDArray[Any]  # (I, 20) float32
    materials: NDArray[Any]  # (M, 28) float32
    phong: NDArray[Any]  # (M, 16) float32
    bsdfs: NDArray[Any]  # (M, 80) float32; empty without BSDFS
    maps: NDArray[Any]  # (M, 16) float32; empty without MAPS
    vertex_colours: NDArray[Any]  # (V, 4) float32; empty without VERTEX_COLOURS
    energy: NDArray[Any]  # (E, 1056) float32; empty without MICROFACETS
    media: NDArray[Any]  # (D, 8) float32; empty without NESTED
    textures: NDArray[Any]  # (N, 16) float32
    texels: NDArray[Any]  # (., 4) float32
    texel_words: NDArray[Any]  # (.,) int32
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
    light_groups: NDArray[Any]  # (1 + M,) int32: numbers of the groups of the environment and of what materials emit
    group_count: i32  # number 0 is that of lights without a group
    extent: f32  # diagonal of the box around all shapes, metres
    triangle_count: i32
    environment: NDArray[Any]  # (H * W, 4) float32
    environment_rows: NDArray[Any]  # (H, 2) float32
    environment_cells: NDArray[Any]  # (H * W, 2) float32
    environment_frame: NDArray[Any]  # (12,) float32: world to environment (a rotation) as rows of 4
    environment_width: i32
    environment_height: i32
    environment_probability: f32  # of choosing the environment among the lights


# ---- View.lens: what is where
FOCUS = i32(7)  # distance of the plane in focus
WINDOW = i32(20)  # middle of the window, x and y; number of a fisheye, see `kernels/camera.py`; unused
# Weight of a sample of a filter; of a negative one; among positive ones, share of those from two negative lobes; unused
FILTER_WEIGHTS = i32(24)
# Two tables, of the positive part of the filter and of its negative one: see `kernels/filters.py`
FILTER_TABLES = i32(28)
FILTER_CELLS = i32(256)


class View(NamedTuple):
    """Camera, film and limits of one render, as kernels see them."""

    # (28 or more,) float32: position, aperture; right, focus; up, half height; backward, half width;
    # blades of the aperture, turn of their first corner from the right (turns), unused, unused;
    # then as above, tables only with FILTER. Half height and width are those of the window, see `Camera.window`
    lens: NDArray[Any]
    width: i32  # of the full image, pixels
    height: i32
    left: i32  # of the part on the film
    top: i32
    film_width: i32
    film_height: i32
    seed: u32
    first_sample: u32  # number of the sample that the film's count 0 stands for
    sample_bits: u32  # with BLUE_NOISE, 2 to the power of this many samples of a pixel belong together
    max_depth: i32
    rr_depth: i32
    ao_distance: f32  # metres; 0: follows from the scene's extent
    clamp_indirect: f32  # W/(m^2 sr); for CLAMP_INDIRECT


TILE = i32(16)
"""Side of the squares of pixels of which each has a goal, and which CPU threads take one by one."""


class FilmArrays(NamedTuple):
    """The film as kernels see it."""

    total: NDArray[Any]  # (H, W, 3) float32: sums of samples
    lost: NDArray[Any]  # (H, W, 3) float32: what the rounding of the sums lost
    counts: NDArray[Any]  # (H, W) uint32: numbers of samples
    squares: NDArray[Any]  # (H, W) float32: sums of the squared luminance of samples; (0, 0) without ADAPTIVE
    goals: NDArray[Any]  # (ceil(H / TILE), ceil(W / TILE)) int32: samples that a tile is to have; or (0, 0)
    parts: NDArray[Any]  # (H, W, C) float32: sums of the FILM_LAYERS, three columns each; (0, 0, 0) without them
    parts_lost: NDArray[Any]  # as parts: what the rounding of these sums lost


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
    (H, W) uint32, and the primitive at each pixel's middle (H, W) int32, -1 for none, with its instance, -1 for none.
    """

    sums: NDArray[Any]
    hits: NDArray[Any]
    counts: NDArray[Any]
    primitives: NDArray[Any]
    instances: NDArray[Any]
    columns: LayerColumns
    channels: i32  # C
