"""The microfacets of Trowbridge and Reitz (1975), known as GGX (Walter et al. 2007), isotropic or not.

Directions are local: z is the shading normal. alpha_x and alpha_y are the roughnesses along x and y.
"""

from __future__ import annotations

from ..lang import INV_PI, Vec3, f32, inverse, kernel, sqrt
from ..pack.layout import REGULARIZE
from .functions import cos_sin_turn
from .vectors import dot, normalize

# Rougher than this by alpha, a lobe is sampled as one; below it is a mirror to any camera.
SMOOTH_ALPHA = f32(1e-3)


@kernel
def ggx_density(h, alpha_x, alpha_y):
    """D(h): area of microfacets with the normal h, per area of surface and solid angle (pbrt, 4th edition, 9.16)."""
    x = h.x / alpha_x
    y = h.y / alpha_y
    k = x * x + y * y + h.z * h.z
    return INV_PI / (alpha_x * alpha_y * k * k)


@kernel
def ggx_lambda(w, alpha_x, alpha_y):
    """Smith's Lambda(w): masked area of microfacets over the visible one (pbrt, 4th edition, 9.22)."""
    x = w.x * alpha_x
    y = w.y * alpha_y
    return 0.5 * (sqrt(1.0 + (x * x + y * y) / max(w.z * w.z, 1e-16)) - 1.0)


@kernel
def ggx_visible_normal(wo, alpha_x, alpha_y, u, v):
    """A microfacet normal h, drawn as often as wo sees it; wo.z > 0.

    Dupuy and Benyoub 2023, Sampling Visible GGX Normals with Spherical Caps: in the space where the microfacets are a
    hemisphere, wo reflected at a visible normal is uniform over a cap of the sphere.
    """
    stretched = normalize(Vec3(wo.x * alpha_x, wo.y * alpha_y, wo.z))
    z = (1.0 - u) * (1.0 + stretched.z) - stretched.z
    r = sqrt(max(0.0, 1.0 - z * z))
    c, s = cos_sin_turn(v)
    # The sum of a direction and its reflection points along the normal between them.
    h = Vec3(r * c + stretched.x, r * s + stretched.y, z + stretched.z)
    return normalize(Vec3(h.x * alpha_x, h.y * alpha_y, max(h.z, 1e-7)))


@kernel
def ggx_visible_density(wo, h, alpha_x, alpha_y):
    """Density of `ggx_visible_normal` per solid angle of h: D(h) G1(wo) |wo . h| / wo.z (pbrt, 4th edition, 9.23)."""
    masking = inverse(1.0 + ggx_lambda(wo, alpha_x, alpha_y))
    return ggx_density(h, alpha_x, alpha_y) * masking * abs(dot(wo, h)) / max(abs(wo.z), 1e-16)


@kernel
def visible_weight(wo, wi, alpha_x, alpha_y):
    """Of the light that goes from wo to wi at facets that wo sees, the fraction that wi sees as well.

    Masking and shadowing go together, since both grow with the height of a facet (Heitz 2014, section 6).
    """
    facing = 1.0 + ggx_lambda(wo, alpha_x, alpha_y)
    return facing * inverse(facing + ggx_lambda(wi, alpha_x, alpha_y))


@kernel
def reflected(w, h):
    """W mirrored at a microfacet with the normal h."""
    return h * (2.0 * dot(w, h)) - w


@kernel
def refracted(w, h, through, eta):
    """W refracted at a microfacet with the normal h; `through` from `fresnel.refracted_cosine` (pbrt, 9.3.2)."""
    scale = inverse(eta)
    return h * (dot(w, h) * scale - through) - w * scale


@kernel
def anisotropic_alphas(roughness, anisotropy):
    """Alpha along x and y from roughness and anisotropy, each from 0 to 1 (Burley 2012, section 5.4)."""
    alpha = roughness * roughness
    aspect = sqrt(1.0 - 0.9 * anisotropy)
    return max(alpha / aspect, 1e-4), max(alpha * aspect, 1e-4)


@kernel
def as_they_are(scene, alpha_x, alpha_y, blurred):
    """The roughness of the surface."""
    return alpha_x, alpha_y


@kernel(needs=REGULARIZE, otherwise=as_they_are)
def regularized(scene, alpha_x, alpha_y, blurred):
    """At least a little roughness where the path is blurred already, so that lamps can be sampled (pbrt, 10.1.2)."""
    return raised(alpha_x, blurred), raised(alpha_y, blurred)


@kernel
def raised(alpha, blurred):
    """Alpha, at least 0.1 and twice as much up to 0.3."""
    return min(max(2.0 * alpha, 0.1), 0.3) if blurred & (alpha < 0.3) else alpha
