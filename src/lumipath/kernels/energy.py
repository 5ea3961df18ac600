"""Light that microfacets pass from one to the next, which the sum over single facets leaves out.

Turquin 2019, "Practical multiple scattering compensation for microfacet models": what a lobe reflects of white light
is tabulated, and the lobe is divided by it, so that white facets reflect everything at any roughness.
"""

from __future__ import annotations

from ..lang import Vec3, f32, i32, kernel, load, sqrt, struct
from ..pack.layout import ANISOTROPY, ENERGY_SCHLICK, ENERGY_SIDE, ENERGY_TABLE, ENERGY_WHITE
from .fresnel import schlick_weight
from .vectors import white

# The first and the last row of tables. Anisotropic facets are rougher than 1 in one direction.
LEAST_ALPHA = f32(1e-4)
GREATEST_ROUGHNESS = f32(1.75)
# Of smoother cloth nothing but the very edge would shine.
LEAST_SHEEN_ALPHA = f32(1e-2)
_ROWS_PER_ROUGHNESS = f32(f32(ENERGY_SIDE - 1) / GREATEST_ROUGHNESS)


@struct
class Place:
    """A place in a table: the first of four cells, and how far between them it is."""

    cell: i32
    row: i32
    across: f32
    down: f32


@kernel
def table_cosine(x, alpha):
    """The cosine at x, from 0 to 1 along a row; cosines of the order of alpha have as much room as all others."""
    return x * alpha / (1.0 + alpha - x)


@kernel
def place_of(mu, alpha):
    """Where the cosine mu and the roughness alpha lie in a table of facets."""
    a = max(alpha, LEAST_ALPHA)
    # The inverse of `table_cosine`.
    x = min(mu * (1.0 + a) / (mu + a), 1.0) * f32(ENERGY_SIDE - 1)
    y = min(sqrt(a) * _ROWS_PER_ROUGHNESS, f32(ENERGY_SIDE - 1))
    return place_at(x, y)


@kernel
def fibre_place(mu, alpha):
    """The same for the table of sheen, which needs room where it grazes, whatever the roughness."""
    return place_at(sqrt(min(mu, 1.0)) * f32(ENERGY_SIDE - 1), sqrt(min(alpha, 1.0)) * f32(ENERGY_SIDE - 1))


@kernel
def place_at(x, y):
    """The place at a column and a row, which need not be whole."""
    column = min(i32(x), i32(ENERGY_SIDE - 2))
    row = min(i32(y), i32(ENERGY_SIDE - 2))
    return Place(i32(row * ENERGY_SIDE + column), row, x - f32(column), y - f32(row))


@struct
class Albedo:
    """Fraction of light that is reflected: at one cosine, and its mean over the hemisphere, weighted by the cosine."""

    directional: f32
    mean: f32


@kernel
def directional_albedo(scene, table, place):
    """The directional albedo that a table tells, bilinearly."""
    i = table * ENERGY_TABLE + place.cell
    upper = load(scene.energy, i) * (1.0 - place.across) + load(scene.energy, i + 1) * place.across
    i += ENERGY_SIDE
    lower = load(scene.energy, i) * (1.0 - place.across) + load(scene.energy, i + 1) * place.across
    return upper * (1.0 - place.down) + lower * place.down


@kernel
def isotropic_albedo(scene, table, mu, alpha_x, alpha_y):
    """Both albedos of facets of one roughness."""
    place = place_of(mu, alpha_x)
    i = table * ENERGY_TABLE + ENERGY_SIDE * ENERGY_SIDE + place.row
    mean = load(scene.energy, i) * (1.0 - place.down) + load(scene.energy, i + 1) * place.down
    return Albedo(directional_albedo(scene, table, place), mean)


@kernel(needs=ANISOTROPY, otherwise=isotropic_albedo)
def albedo_of(scene, table, mu, alpha_x, alpha_y):
    """Both albedos of facets of any roughness: the mean over two directions between the axes."""
    # At 22.5 and 67.5 degrees, by cos^2 and sin^2.
    x2 = alpha_x * alpha_x
    y2 = alpha_y * alpha_y
    first = sqrt(0.8535534 * x2 + 0.1464466 * y2)
    second = sqrt(0.1464466 * x2 + 0.8535534 * y2)
    a = isotropic_albedo(scene, table, mu, first, first)
    b = isotropic_albedo(scene, table, mu, second, second)
    return Albedo(0.5 * (a.directional + b.directional), 0.5 * (a.mean + b.mean))


@struct
class FacetAlbedo:
    """What facets reflect at once whose reflectance is 1 everywhere, and of those that reflect Schlick's weight."""

    all: Albedo
    edge: Albedo


@kernel
def facet_albedo(scene, mu, alpha_x, alpha_y):
    """Both at the cosine mu; the alphas are those of GGX."""
    everything = albedo_of(scene, ENERGY_WHITE, mu, alpha_x, alpha_y)
    # The table has what is not that of a smooth surface, which it could not resolve.
    edge = albedo_of(scene, ENERGY_SCHLICK, mu, alpha_x, alpha_y)
    return FacetAlbedo(everything, Albedo(schlick_weight(mu) * everything.directional + edge.directional, edge.mean))


@kernel
def directional(albedo, f0, f90):
    """Of a `FacetAlbedo`, for facets that reflect f0 face to face and f90 at the edge; numbers or vectors."""
    return f0 * (albedo.all.directional - albedo.edge.directional) + f90 * albedo.edge.directional


@kernel
def hemispherical(albedo, f0, f90):
    """The same for its mean over the hemisphere."""
    return f0 * (albedo.all.mean - albedo.edge.mean) + f90 * albedo.edge.mean


@kernel
def schlick_albedo(scene, mu, alpha_x, alpha_y, f0):
    """Fraction of the light at the cosine mu that facets with Schlick's reflectance reflect at once.

    Args:
        scene: PackedScene.
        mu: cosine of the viewer, above 0.
        alpha_x: of GGX.
        alpha_y: of GGX.
        f0: reflectance face to face, Vec3.
    """
    return directional(facet_albedo(scene, mu, alpha_x, alpha_y), f0, white())


@kernel
def energy_compensation(scene, mu, alpha_x, alpha_y, average):
    """What to multiply a lobe of reflecting facets by, so that it counts light of all further reflections.

    White facets then reflect everything. Coloured ones grow more saturated, since light meets several of them (Kulla
    and Conty 2017, "Revisiting physically based shading at Imageworks", gives the colour).

    Args:
        scene: PackedScene.
        mu: cosine of the viewer, above 0.
        alpha_x: of GGX.
        alpha_y: of GGX.
        average: mean reflectance of a facet over the hemisphere, weighted by the cosine, Vec3.
    """
    return compensation(albedo_of(scene, ENERGY_WHITE, mu, alpha_x, alpha_y), average)


@kernel
def compensation(albedo, average):
    """The same from the albedo of white facets."""
    k = (1.0 - albedo.directional) / albedo.directional * albedo.mean
    rest = 1.0 - albedo.mean
    return Vec3(
        1.0 + k * average.x / (1.0 - average.x * rest),
        1.0 + k * average.y / (1.0 - average.y * rest),
        1.0 + k * average.z / (1.0 - average.z * rest),
    )


@kernel
def dielectric_compensation(scene, table, mu, alpha_x, alpha_y):
    """The same for facets that reflect or refract, and lose nothing themselves; `table` is that of their index."""
    return 1.0 / albedo_of(scene, table, mu, alpha_x, alpha_y).directional
