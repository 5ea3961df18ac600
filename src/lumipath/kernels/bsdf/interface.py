"""The part of a principled surface that light goes through: facets that reflect or refract (Walter et al. 2007).

glTF 2.0: KHR_materials_transmission, KHR_materials_volume, KHR_materials_ior. Radiance is carried as in `dielectric`.
"""

from __future__ import annotations

from ...lang import Vec3, f32, inverse, kernel, struct
from ...pack.layout import BSDF_INTERFACE, BSDF_TRANSMISSION, TRANSMISSION
from ..fresnel import dielectric_reflectance, refracted_cosine, schlick_weight
from ..microfacet import ggx_visible_density, visible_weight
from ..vectors import between, black, dot, luminance, max_component, normalize, white
from .values import BsdfValue, no_value, number_slot, slot


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
def opaque_share(scene, s):
    """A scene of opaque surfaces."""
    return f32(0.0)


@kernel(needs=TRANSMISSION, otherwise=opaque_share)
def transmitting_share(scene, s):
    """How much of a surface light goes through where it is no metal."""
    return number_slot(scene, s, BSDF_TRANSMISSION)


@kernel
def no_interface(scene, s, share, tint, f0, f90):
    """A scene of opaque surfaces."""
    return Interface(0.0, black(), black(), 0.0, 0.0, 1.0, False)


@kernel(needs=TRANSMISSION, otherwise=no_interface)
def interface_at(scene, s, share, tint, f0, f90):
    """The interface at a point of a surface; arguments as the fields of `Interface`."""
    row = slot(scene, s.material, BSDF_INTERFACE)
    index = row[0]
    thin = row[1] > 0.0
    usual = (index - 1.0) / (index + 1.0)
    return Interface(share, tint, f0, f90, usual * usual, index if s.front | thin else inverse(index), thin)


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
def sent_through(interface, wo, h, refracted):
    """The direction behind a facet; thin walls mirror a reflection to their other side."""
    c = dot(wo, h)
    scale = inverse(interface.eta)
    bent = h * (c * scale - refracted) - wo * scale
    back = h * (2.0 * c) - wo
    return Vec3(back.x, back.y, -back.z) if interface.thin else bent


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
    # Density of directions over that of facets (pbrt, 4th edition, 9.37).
    stretch = ci + co * inverse(interface.eta)
    jacobian = inverse(4.0 * co) if interface.thin else abs(ci) / max(stretch * stretch, 1e-16)
    pdf = ggx_visible_density(wo, h, m.alpha_x, m.alpha_y) * jacobian
    f = facet.through * (visible_weight(wo, above, m.alpha_x, m.alpha_y) * pdf)
    return BsdfValue(f, pdf * (1.0 - reflecting_chance(scene, facet)))
