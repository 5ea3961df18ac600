"""The part of a principled surface that light goes through: facets that reflect or refract (Walter et al. 2007).

glTF 2.0: KHR_materials_transmission, KHR_materials_volume, KHR_materials_ior. Radiance is carried as in `dielectric`.
"""

from __future__ import annotations

from ...lang import Vec3, as_int, f32, i32, inverse, kernel, struct
from ...pack.layout import BSDF_REFRACTION, BSDF_TRANSMISSION, TRANSMISSION
from ..energy import dielectric_compensation
from ..fresnel import dielectric_reflectance, refracted_cosine, schlick_weight
from ..microfacet import SMOOTH_ALPHA, ggx_visible_density, reflected, refracted, visible_weight
from ..vectors import between, black, dot, luminance, max_component, normalize, white
from .rough_dielectric import refraction_jacobian
from .values import BsdfValue, no_value, number_slot, slot

# Facets between equal indices have no half vector.
LEAST_DIFFERENCE = f32(1e-3)


@struct
class Interface:
    """The share of a surface that light goes through, times what makes up for light between facets; the tint of a
    passage; reflectance of facets face to face and at the edge, and that which belongs to the index; the index beyond.
    """

    share: f32
    tint: Vec3
    f0: Vec3
    f90: f32
    usual: f32
    eta: f32
    thin: bool


@struct
class Facet:
    """What facets do to light at one angle: both fractions, and the cosine behind them, 0 for none."""

    reflected: Vec3
    through: Vec3
    refracted: f32


@kernel
def opaque_surface(scene, s, eta):
    """A scene of opaque surfaces."""
    return Interface(0.0, black(), black(), 0.0, slot(scene, s.material, BSDF_REFRACTION)[3], 1.0, False)


@kernel(needs=TRANSMISSION, otherwise=opaque_surface)
def interface_of(scene, s, eta):
    """What is known of an interface by itself, were the surface no metal; `eta` as in `Question`."""
    row = slot(scene, s.material, BSDF_REFRACTION)
    share = number_slot(scene, s, BSDF_TRANSMISSION)
    thin = row[2] > 0.0
    bent = eta if abs(eta - 1.0) > LEAST_DIFFERENCE else 1.0 + LEAST_DIFFERENCE
    bent = row[0] if thin else bent
    usual = (bent - 1.0) / (bent + 1.0)
    usual = usual * usual
    # An opaque surface has no other side that the path knows the index of.
    return Interface(share, black(), black(), 0.0, usual if share > 0.0 else row[3], bent, thin)


@kernel
def no_interface(scene, s, mu, alpha_x, alpha_y, albedo, given, f0, f90, tint, share):
    """A scene of opaque surfaces."""
    return given


@kernel(needs=TRANSMISSION, otherwise=no_interface)
def interface_at(scene, s, mu, alpha_x, alpha_y, albedo, given, f0, f90, tint, share):
    """The interface at a point of a surface.

    Args:
        scene: PackedScene.
        s: the surface.
        mu: cosine of the viewer.
        alpha_x: of GGX.
        alpha_y: of GGX.
        albedo: of white facets at that cosine.
        given: of `interface_of`.
        f0: reflectance of facets face to face, Vec3.
        f90: at the edge, a number.
        tint: of what goes through.
        share: how much of the surface light goes through.
    """
    row = slot(scene, s.material, BSDF_REFRACTION)
    table = as_int(row[1])
    boost = 1.0 / albedo
    if not given.thin:
        boost = dielectric_compensation(scene, table if s.front else i32(table + 1), mu, alpha_x, alpha_y)
        # Between two media that both are not vacuum the index is another one, for which there is no table.
        known = abs(given.eta / (row[0] if s.front else inverse(row[0])) - 1.0) <= LEAST_DIFFERENCE
        boost = boost if known else f32(1.0)
    boost = boost if max(alpha_x, alpha_y) >= SMOOTH_ALPHA else f32(1.0)
    return Interface(share * boost, tint, f0, f90, given.usual, given.eta, given.thin)


@kernel
def through_reflectance(scene, interface, cosine, refracted):
    """What facets reflect where light could go through."""
    exact = dielectric_reflectance(scene, cosine, refracted, interface.eta)
    # Fresnel's curve between other ends: where they are the usual ones, it is his.
    rise = (exact - interface.usual) / (1.0 - interface.usual)
    edge = Vec3(interface.f90, interface.f90, interface.f90)
    reflected = interface.f0 + (edge - interface.f0) * max(rise, 0.0)
    return reflected if refracted > 0.0 else white()


@kernel
def no_interface_albedo(scene, interface, mu):
    """A scene of opaque surfaces."""
    return f32(0.0)


@kernel(needs=TRANSMISSION, otherwise=no_interface_albedo)
def interface_albedo(scene, interface, mu):
    """About what it reflects and lets through, for light at the cosine mu."""
    reflected = luminance(through_reflectance(scene, interface, mu, refracted_cosine(mu, interface.eta)))
    return interface.share * between(luminance(interface.tint), f32(1.0), min(reflected, 1.0))


@kernel
def opaque_facet(scene, m, cosine):
    """Facets that let nothing through: Schlick's reflectance."""
    return Facet(m.f0 + (m.f90 - m.f0) * schlick_weight(cosine), black(), 0.0)


@kernel(needs=TRANSMISSION, otherwise=opaque_facet)
def facet_at(scene, m, cosine):
    """Facets of the whole surface, seen at this cosine."""
    opaque = m.f0 + (m.f90 - m.f0) * schlick_weight(cosine)
    refracted = refracted_cosine(cosine, m.interface.eta)
    reflected = through_reflectance(scene, m.interface, cosine, refracted)
    # A tinted reflection does not leave its complement to what goes through (KHR_materials_specular).
    rest = m.interface.share * (1.0 - max_component(reflected))
    return Facet(opaque + reflected * m.interface.share, m.interface.tint * rest, refracted)


@kernel
def always_reflects(scene, facet):
    """A scene of opaque surfaces."""
    return f32(1.0)


@kernel(needs=TRANSMISSION, otherwise=always_reflects)
def reflecting_chance(scene, facet):
    """Probability with which a facet that was drawn reflects."""
    both = max_component(facet.reflected)
    return both / max(both + max_component(facet.through), 1e-20)


@kernel
def sent_through(interface, wo, h, through):
    """The direction behind a facet, `through` from `refracted_cosine`; thin walls let a reflection pass through."""
    back = reflected(wo, h)
    return Vec3(back.x, back.y, -back.z) if interface.thin else refracted(wo, h, through, interface.eta)


@kernel
def eval_through(scene, m, wo, wi):
    """F times cosine, and density, of rough facets for wi.z < 0, were no other lobe ever drawn."""
    interface = m.interface
    above = Vec3(wi.x, wi.y, -wi.z)
    # The facet that leads from wo to wi, upwards.
    h = normalize(wo + above if interface.thin else wo + wi * interface.eta)
    h = h if h.z >= 0.0 else -h
    co = dot(wo, h)
    ci = dot(wi, h)
    if (co <= 0.0) | ((ci >= 0.0) & (not interface.thin)):
        return no_value()
    facet = facet_at(scene, m, co)
    jacobian = 0.25 / co if interface.thin else refraction_jacobian(interface, wo, wi, h)
    pdf = ggx_visible_density(wo, h, m.alpha_x, m.alpha_y) * jacobian
    f = facet.through * (visible_weight(wo, above, m.alpha_x, m.alpha_y) * pdf)
    return BsdfValue(f, pdf * (1.0 - reflecting_chance(scene, facet)))
