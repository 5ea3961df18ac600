"""Layers that lie over a principled surface: a clear coat, and under it the sheen of cloth.

What a layer reflects by itself, its directional albedo, is kept from what lies below it, as seen from the viewer and
from the light, so that the sum stays reciprocal and never exceeds 1 (glTF 2.0, appendix B; KHR_materials_clearcoat,
KHR_materials_sheen).
"""

from __future__ import annotations

from ...lang import INV_PI, Vec3, f32, inverse, kernel, sqrt, struct
from ...pack.layout import (
    BSDF_CLEARCOAT,
    BSDF_CLEARCOAT_ROUGHNESS,
    BSDF_SHEEN,
    BSDF_SHEEN_ROUGHNESS,
    CLEARCOAT,
    ENERGY_SHEEN,
    SHEEN,
)
from ..energy import (
    LEAST_ALPHA,
    LEAST_SHEEN_ALPHA,
    directional,
    directional_albedo,
    facet_albedo,
    fibre_place,
    hemispherical,
)
from ..fresnel import schlick_weight
from ..functions import unit_power
from ..microfacet import regularized, visible_weight
from ..vectors import black, dot, max_component
from .conductor import reflection_density
from .values import BsdfValue, number_slot, tint_slot

# Face to face, of a lacquer with the index 1.5.
_COAT_F0 = f32(0.04)


@struct
class Coat:
    """A clear coat: its weight, alpha, and what it reflects towards the viewer and on average."""

    weight: f32
    alpha_x: f32
    alpha_y: f32
    facing: f32
    mean: f32


@struct
class Sheen:
    """Fibres: their colour and its greatest part, exponent of their distribution, alpha, white albedo to the viewer."""

    colour: Vec3
    share: f32
    exponent: f32
    alpha: f32
    facing: f32


@struct
class Cover:
    """What layers let through to what is below: to what scatters evenly, to glossy lobes, and to the sheen."""

    matt: f32
    glossy: f32
    sheen: f32


# ---- clear coat ------------------------------------------------------------------------------------------------------


@kernel
def no_coat(scene, s, q):
    """A scene without coats."""
    return Coat(0.0, 1.0, 1.0, 0.0, 0.0)


@kernel(needs=CLEARCOAT, otherwise=no_coat)
def coat_at(scene, s, q):
    """The coat at a point of a surface."""
    weight = number_slot(scene, s, BSDF_CLEARCOAT)
    roughness = number_slot(scene, s, BSDF_CLEARCOAT_ROUGHNESS)
    alpha = max(roughness * roughness, LEAST_ALPHA)
    alpha, _ = regularized(scene, alpha, alpha, q.blurred)
    albedo = facet_albedo(scene, q.wo.z, alpha, alpha)
    facing = weight * directional(albedo, _COAT_F0, 1.0)
    return Coat(weight, alpha, alpha, facing, weight * hemispherical(albedo, _COAT_F0, 1.0))


@kernel
def no_coat_albedo(scene, coat, mu):
    """A scene without coats."""
    return f32(0.0)


@kernel(needs=CLEARCOAT, otherwise=no_coat_albedo)
def coat_albedo(scene, coat, mu):
    """What a coat reflects of light at the cosine mu."""
    return coat.weight * directional(facet_albedo(scene, mu, coat.alpha_x, coat.alpha_x), _COAT_F0, 1.0)


@kernel
def covered_once(scene, coat, alpha, rise, left):
    """A scene without coats."""
    return f32(1.0)


@kernel(needs=CLEARCOAT, otherwise=covered_once)
def covered_twice(scene, coat, alpha, rise, left):
    """What a matt base is divided by, since coat and facets keep the same light from it, that which grazes.

    A product of two factors, each of which has the mean 1 over the hemisphere, has a mean above that by their
    covariance.

    Args:
        scene: PackedScene.
        coat: that lies over the facets.
        alpha: of the facets.
        rise: of their reflectance from face to face to the edge.
        left: what they leave of light on average.
    """
    both = coat.weight * albedo_spread(coat.alpha_x, 1.0 - _COAT_F0) * albedo_spread(alpha, max(rise, 0.0))
    return 1.0 + both / ((1.0 - coat.mean) * left)


@kernel
def albedo_spread(alpha, rise):
    """Standard deviation of the albedo of facets over the hemisphere: of smooth ones sqrt(1/66 - 1/441), else a fit."""
    return 0.1136 * rise / (1.0 + 14.0 * alpha * sqrt(sqrt(alpha)))


@kernel
def coat_reflectance(coat, cosine):
    """Of its facets."""
    return coat.weight * (_COAT_F0 + (1.0 - _COAT_F0) * schlick_weight(cosine))


@kernel
def eval_coat(coat, wo, wi, h):
    """F times cosine, and density, of a rough coat; h is halfway between both."""
    pdf = reflection_density(coat, wo, h)
    f = coat_reflectance(coat, dot(wo, h)) * visible_weight(wo, wi, coat.alpha_x, coat.alpha_y) * pdf
    return BsdfValue(Vec3(f, f, f), pdf)


# ---- sheen -----------------------------------------------------------------------------------------------------------


@kernel
def no_sheen(scene, s, wo):
    """A scene without sheen."""
    return Sheen(black(), 0.0, 1.0, 1.0, 0.0)


@kernel(needs=SHEEN, otherwise=no_sheen)
def sheen_at(scene, s, wo):
    """The sheen at a point of a surface."""
    colour = tint_slot(scene, s, BSDF_SHEEN)
    roughness = number_slot(scene, s, BSDF_SHEEN_ROUGHNESS)
    alpha = max(roughness * roughness, LEAST_SHEEN_ALPHA)
    facing = directional_albedo(scene, ENERGY_SHEEN, fibre_place(wo.z, alpha))
    return Sheen(colour, max_component(colour), inverse(alpha), alpha, facing)


@kernel
def no_sheen_albedo(scene, sheen, mu):
    """A scene without sheen."""
    return f32(0.0)


@kernel(needs=SHEEN, otherwise=no_sheen_albedo)
def sheen_albedo(scene, sheen, mu):
    """What white fibres reflect of light at the cosine mu; above 1 where `eval_sheen` scales them down."""
    return directional_albedo(scene, ENERGY_SHEEN, fibre_place(mu, sheen.alpha))


@kernel
def fibres(wo, wi, h, exponent):
    """White fibres: f without the cosine.

    Estevez and Kulla 2017, "Production Friendly Microfacet Sheen BRDF", with the visibility of Neubelt and Pettineo
    2013, "Crafting a Next-Gen Material Pipeline for The Order: 1886".
    """
    d = (2.0 + exponent) * 0.5 * INV_PI * unit_power(min(max(1.0 - h.z * h.z, 0.0), 1.0), 0.5 * exponent)
    return d / (4.0 * (wo.z + wi.z - wo.z * wi.z))


@kernel
def eval_sheen(scene, sheen, wo, wi, h):
    """F times cosine of the sheen alone."""
    # At grazing angles the formula gives back more than arrives.
    excess = max(1.0, max(sheen.facing, sheen_albedo(scene, sheen, wi.z)))
    return sheen.colour * (fibres(wo, wi, h, sheen.exponent) * wi.z / excess)


# ---- both ------------------------------------------------------------------------------------------------------------


@kernel
def cover(scene, coat, sheen, mu):
    """What both layers let through between the viewer and the cosine mu."""
    coated = coat_albedo(scene, coat, mu)
    woven = sheen.share * min(max(sheen.facing, sheen_albedo(scene, sheen, mu)), 1.0)
    # Exact for mirrors, which see the same cosine twice ...
    glossy = 1.0 - max(coat.facing, coated)
    # ... and for what scatters evenly (Kelemen and Szirmay-Kalos 2001).
    matt = (1.0 - coat.facing) * (1.0 - coated) * inverse(1.0 - coat.mean)
    return Cover(matt * (1.0 - woven), glossy * (1.0 - woven), glossy)
