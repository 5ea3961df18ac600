"""The material of glTF 2.0 with its extensions: metal, or matt, or let through, under a sheen and a clear coat.

GGX facets reflect (pbrMetallicRoughness, KHR_materials_specular, _ior, _anisotropy, _iridescence). What they do not
reflect goes into the matt base, or through (`interface`); over all lie the layers of `coats`. One lobe is drawn by its
estimated part of the light, and weighed against what all others would have done.
"""

from __future__ import annotations

from ...lang import Vec3, f32, inverse, kernel, sqrt, struct
from ...pack.layout import (
    ANISOTROPY,
    BSDF_ANISOTROPY,
    BSDF_FILM,
    BSDF_IRIDESCENCE,
    BSDF_METALLIC,
    BSDF_ROUGHNESS,
    BSDF_SPECULAR,
    BSDF_SPECULAR_COLOUR,
    CLEARCOAT,
    IRIDESCENCE,
    SHEEN,
    SPECULAR,
    TRANSMISSION,
)
from ..energy import LEAST_ALPHA, compensation, directional, facet_albedo, hemispherical
from ..microfacet import ggx_visible_normal, reflected, regularized, visible_weight
from ..vectors import between, black, dot, luminance, max_component, normalize, white
from ..warps import cosine_hemisphere, cosine_hemisphere_pdf, uniform_hemisphere, uniform_hemisphere_pdf
from .coats import Coat, Sheen, coat_at, coat_reflectance, cover, covered_twice, eval_coat, eval_sheen, sheen_at
from .conductor import is_smooth, reflection_density
from .interface import (
    Interface,
    eval_through,
    facet_at,
    interface_albedo,
    interface_at,
    interface_of,
    reflecting_chance,
    sent_through,
)
from .thin_film import film_reflectance, without_schlick
from .values import BsdfSample, BsdfValue, base_colour_slot, no_value, number_slot, slot, tint_slot


@struct
class Ends:
    """Reflectance of facets face to face, and at the edge."""

    f0: Vec3
    f90: Vec3


@struct
class Odds:
    """Probabilities of drawing a lobe; what is left is that of the matt one."""

    coat: f32
    sheen: f32
    glossy: f32


@struct
class Principled:
    """The material at a point, as seen from one direction.

    matt: weight of even scattering, but for what facets keep from it on the light's side.
    bare0, bare90: reflectance of the facets over the matt base, face to face and at the edge, in their strongest
    channel. f0, f90: of facets of metal and of those over the matt base together, each by its share, with what light
    between facets adds.
    """

    matt: Vec3
    bare0: f32
    bare90: f32
    f0: Vec3
    f90: Vec3
    alpha_x: f32
    alpha_y: f32
    interface: Interface
    coat: Coat
    sheen: Sheen
    odds: Odds


# ---- the parameters at a point ---------------------------------------------------------------------------------------


@kernel
def usual_ends(scene, s, f0):
    """A scene whose dielectrics reflect as their index says."""
    return Ends(Vec3(f0, f0, f0), white())


@kernel(needs=SPECULAR, otherwise=usual_ends)
def dielectric_ends(scene, s, f0):
    """KHR_materials_specular."""
    strength = number_slot(scene, s, BSDF_SPECULAR)
    tinted = tint_slot(scene, s, BSDF_SPECULAR_COLOUR) * f0
    capped = Vec3(min(tinted.x, 1.0), min(tinted.y, 1.0), min(tinted.z, 1.0))
    return Ends(capped * strength, white() * strength)


@kernel
def isotropic(scene, s, alpha):
    """The same alpha along x and y."""
    return alpha, alpha


@kernel(needs=ANISOTROPY, otherwise=isotropic)
def stretched(scene, s, alpha):
    """Alpha along x and y (KHR_materials_anisotropy)."""
    strength = slot(scene, s.material, BSDF_ANISOTROPY)[0]
    return between(alpha, f32(1.0), strength * strength), alpha


@kernel
def no_film(scene, s, mu, base, bare, metallic):
    """A scene without thin films; both faces as they are."""
    return base, bare


@kernel(needs=IRIDESCENCE, otherwise=no_film)
def with_film(scene, s, mu, base, bare, metallic):
    """Metal and dielectric face to face, under a film that is seen at the cosine mu (KHR_materials_iridescence)."""
    strength = number_slot(scene, s, BSDF_IRIDESCENCE)
    thickness = number_slot(scene, s, BSDF_FILM)
    index = slot(scene, s.material, BSDF_FILM)[1]
    below = between(bare, base, metallic)
    film = without_schlick(film_reflectance(mu, index, thickness * 1e-3, below), mu)
    film = film if strength > 0.0 else below
    return between(base, film, strength), between(bare, film, strength)


@kernel
def principled_at(scene, s, q):
    """The parameters at a point of a surface, for a `Question`."""
    wo = q.wo
    base = base_colour_slot(scene, s)
    metallic = number_slot(scene, s, BSDF_METALLIC)
    roughness = number_slot(scene, s, BSDF_ROUGHNESS)
    alpha_x, alpha_y = stretched(scene, s, max(roughness * roughness, LEAST_ALPHA))
    alpha_x, alpha_y = regularized(scene, alpha_x, alpha_y, q.blurred)
    seen = facet_albedo(scene, wo.z, alpha_x, alpha_y)

    # Facets of a dielectric and of a metal; those of a metal pass light on to each other.
    given = interface_of(scene, s, q.eta)
    bare = dielectric_ends(scene, s, given.usual)
    metal0, bare_f0 = with_film(scene, s, wo.z, base, bare.f0, metallic)
    average = metal0 + (white() - metal0) * f32(1.0 / 21.0)
    boost = compensation(seen.all, average) * metallic
    through = given.share * (1.0 - metallic)
    opaque = (1.0 - through) - metallic
    f0 = bare_f0 * opaque + metal0 * boost
    f90 = bare.f90 * opaque + boost
    interface = interface_at(
        scene, s, wo.z, alpha_x, alpha_y, seen.all.directional, given, bare_f0, bare.f90.x, base, through
    )

    # What facets leave of light for the matt base: exact for it as it scatters evenly (Kelemen and Szirmay-Kalos 2001).
    bare0 = max_component(bare_f0)
    bare90 = bare.f90.x
    coat = coat_at(scene, s, q)
    left = 1.0 - directional(seen, bare0, bare90)
    left_on_average = 1.0 - hemispherical(seen, bare0, bare90)
    shared = covered_twice(scene, coat, sqrt(alpha_x * alpha_y), bare90 - bare0, left_on_average)
    matt = base * (opaque * left * inverse(left_on_average * shared))

    # Each lobe's part of white light from everywhere that goes to the viewer.
    sheen = sheen_at(scene, s, wo)
    woven = min(sheen.facing, 1.0)
    below = (1.0 - coat.facing) * (1.0 - sheen.share * woven)
    glossy = directional(seen, luminance(f0), luminance(f90)) + interface_albedo(scene, interface, wo.z)
    coat_part = coat.facing
    sheen_part = luminance(sheen.colour) * woven * (1.0 - coat.facing)
    glossy_part = glossy * below
    scale = inverse(max(coat_part + sheen_part + glossy_part + luminance(base) * (opaque * left * below), 1e-20))
    odds = Odds(coat_part * scale, sheen_part * scale, glossy_part * scale)
    return Principled(matt, bare0, bare90, f0, f90, alpha_x, alpha_y, interface, coat, sheen, odds)


# ---- the value of all rough lobes ------------------------------------------------------------------------------------


@kernel
def add_nothing(scene, m, wo, wi, h, under, value):
    """A scene without this layer."""
    return value


@kernel(needs=CLEARCOAT, otherwise=add_nothing)
def add_coat(scene, m, wo, wi, h, under, value):
    """The clear coat's part."""
    if is_smooth(m.coat):
        return value
    more = eval_coat(m.coat, wo, wi, h)
    return BsdfValue(value.f + more.f, value.pdf + m.odds.coat * more.pdf)


@kernel(needs=SHEEN, otherwise=add_nothing)
def add_sheen(scene, m, wo, wi, h, under, value):
    """The sheen's part."""
    f = eval_sheen(scene, m.sheen, wo, wi, h) * under.sheen
    return BsdfValue(value.f + f, value.pdf + m.odds.sheen * uniform_hemisphere_pdf(wi.z))


@kernel
def add_glossy(scene, m, wo, wi, h, under, value):
    """The part of the facets."""
    if is_smooth(m):
        return value
    facet = facet_at(scene, m, dot(wo, h))
    pdf = reflection_density(m, wo, h)
    f = facet.reflected * (under.glossy * visible_weight(wo, wi, m.alpha_x, m.alpha_y) * pdf)
    return BsdfValue(value.f + f, value.pdf + m.odds.glossy * reflecting_chance(scene, facet) * pdf)


@kernel
def matt_odds(odds):
    """Probability of drawing the matt lobe."""
    return max(1.0 - odds.coat - odds.sheen - odds.glossy, 0.0)


@kernel
def only_above(scene, m, wo, wi):
    """A scene of opaque surfaces."""
    return no_value()


@kernel(needs=TRANSMISSION, otherwise=only_above)
def eval_below(scene, m, wo, wi):
    """F times cosine, and density, of light from beyond."""
    if (wi.z >= 0.0) | is_smooth(m) | (m.interface.share <= 0.0):
        return no_value()
    value = eval_through(scene, m, wo, wi)
    return BsdfValue(value.f * cover(scene, m.coat, m.sheen, -wi.z).glossy, value.pdf * m.odds.glossy)


@kernel
def eval_principled(scene, m, wo, wi):
    """F times cosine, and density; wo.z > 0."""
    if wi.z <= 0.0:
        return eval_below(scene, m, wo, wi)
    h = normalize(wo + wi)
    under = cover(scene, m.coat, m.sheen, wi.z)
    left = 1.0 - directional(facet_albedo(scene, wi.z, m.alpha_x, m.alpha_y), m.bare0, m.bare90)
    cosine = cosine_hemisphere_pdf(wi.z)
    value = BsdfValue(m.matt * (left * under.matt * cosine), matt_odds(m.odds) * cosine)
    value = add_glossy(scene, m, wo, wi, h, under, value)
    value = add_sheen(scene, m, wo, wi, h, under, value)
    return add_coat(scene, m, wo, wi, h, under, value)


# ---- directions ------------------------------------------------------------------------------------------------------


@struct
class Drawn:
    """A direction, (0, 0, 0) where it lies on the wrong side; of a smooth lobe with its weight."""

    wi: Vec3
    smooth: bool
    weight: Vec3


@kernel
def rough(wi):
    """A direction drawn from a lobe that other strategies can hit too."""
    return Drawn(wi, False, black())


@kernel
def facet_for(m, wo, u, v):
    """A facet that wo sees."""
    h = ggx_visible_normal(wo, m.alpha_x, m.alpha_y, u, v)
    return Vec3(0, 0, 1) if is_smooth(m) else h


@kernel
def draw_reflection(scene, m, wo, u, v, choice):
    """A scene of opaque surfaces: reflect at a facet."""
    h = facet_for(m, wo, u, v)
    wi = reflected(wo, h)
    weight = facet_at(scene, m, dot(wo, h)).reflected
    return Drawn(wi if wi.z > 0.0 else black(), is_smooth(m), weight)


@kernel(needs=TRANSMISSION, otherwise=draw_reflection)
def draw_facet(scene, m, wo, u, v, choice):
    """Reflect at a facet, or go through it."""
    h = facet_for(m, wo, u, v)
    facet = facet_at(scene, m, dot(wo, h))
    chance = reflecting_chance(scene, facet)
    reflects = choice < chance
    wi = reflected(wo, h) if reflects else sent_through(m.interface, wo, h, facet.refracted)
    weight = facet.reflected * inverse(chance) if reflects else facet.through * inverse(1.0 - chance)
    return Drawn(wi if (wi.z > 0.0) == reflects else black(), is_smooth(m), weight)


@kernel
def draw_base(scene, m, wo, u, v, choice):
    """A direction from the facets or the matt base."""
    if choice < m.odds.glossy:
        drawn = draw_facet(scene, m, wo, u, v, choice / m.odds.glossy)
        kept = cover(scene, m.coat, m.sheen, abs(drawn.wi.z)).glossy
        return Drawn(drawn.wi, drawn.smooth, drawn.weight * (kept / m.odds.glossy))
    return rough(cosine_hemisphere(u, v))


@kernel(needs=SHEEN, otherwise=draw_base)
def draw_woven(scene, m, wo, u, v, choice):
    """A direction from the sheen or what is under it."""
    if choice < m.odds.sheen:
        return rough(uniform_hemisphere(u, v))
    return draw_base(scene, m, wo, u, v, choice - m.odds.sheen)


@kernel(needs=CLEARCOAT, otherwise=draw_woven)
def draw(scene, m, wo, u, v, choice):
    """A direction from the coat or what is under it."""
    if choice < m.odds.coat:
        wi = reflected(wo, facet_for(m.coat, wo, u, v))
        weight = coat_reflectance(m.coat, wo.z) / m.odds.coat
        return Drawn(wi if wi.z > 0.0 else black(), is_smooth(m.coat), Vec3(weight, weight, weight))
    return draw_woven(scene, m, wo, u, v, choice - m.odds.coat)


@kernel
def sample_principled(scene, m, wo, u, v, choice):
    """Draw one lobe, a direction from it, and weigh that by all of them."""
    drawn = draw(scene, m, wo, u, v, choice)
    if drawn.smooth:
        return BsdfSample(drawn.wi, drawn.weight, 0.0)
    value = eval_principled(scene, m, wo, drawn.wi)
    return BsdfSample(drawn.wi, value.f * inverse(max(value.pdf, 1e-20)), value.pdf)
