"""The glTF material in NumPy, from the text of the specification; albedos are integrated, not looked up.

glTF 2.0, appendix B, and the texts of KHR_materials_specular, _clearcoat, _sheen, _iridescence and _anisotropy. Layers
share energy as docs/decisions/0018-principled.md says.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = 400


def schlick(cosine: Array) -> Array:
    """The weight of the edge."""
    return (1 - np.clip(cosine, 0, 1)) ** 5


def ggx(o: Array, w: Array, h: Array, at: float, ab: float) -> Array:
    """D times the visibility V (KHR_materials_anisotropy), for (3, N) unit vectors."""
    f = np.stack([h[0] * ab, h[1] * at, h[2] * at * ab])
    w2 = at * ab / (f**2).sum(axis=0)
    density = at * ab * w2**2 / np.pi
    from_viewer = w[2] * np.sqrt((at * o[0]) ** 2 + (ab * o[1]) ** 2 + o[2] ** 2)
    from_light = o[2] * np.sqrt((at * w[0]) ** 2 + (ab * w[1]) ** 2 + w[2] ** 2)
    return density * 0.5 / (from_viewer + from_light)


def charlie(o: Array, w: Array, h: Array, alpha: float) -> Array:
    """D times the cheap visibility of KHR_materials_sheen."""
    sine = np.sqrt(np.clip(1 - h[2] ** 2, 0, 1))
    density = (2 + 1 / alpha) * sine ** (1 / alpha) / (2 * np.pi)
    return density / (4 * (w[2] + o[2] - w[2] * o[2]))


def between(o: Array, w: Array) -> Array:
    """The half vector."""
    h = o + w
    return h / np.linalg.norm(h, axis=0)


def albedo(brdf: Callable[[Array, Array, Array], Array], mu: float) -> float:
    """What a BRDF, f without cosine, reflects of white light at the cosine `mu`; at any azimuth."""
    o = np.array([np.sqrt(1 - mu * mu), 0.0, mu])[:, None]
    # Dense towards the horizon, where sheen and polished facets shine.
    step = (np.arange(_STEPS) + 0.5) / _STEPS
    cosine = np.repeat(step**2, _STEPS)
    turn = np.tile(step, _STEPS) * np.pi
    sine = np.sqrt(1 - cosine**2)
    w = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine])
    weight = cosine * 2 * np.repeat(step, _STEPS) / _STEPS * 2 * np.pi / _STEPS
    return float((brdf(o, w, between(o, w)) * weight).sum())


@cache
def facets(alpha: float, mu: float) -> tuple[float, float]:
    """Albedo of isotropic facets that reflect everything, and of those that reflect Schlick's weight."""
    return (
        albedo(lambda o, w, h: ggx(o, w, h, alpha, alpha), mu),
        albedo(lambda o, w, h: ggx(o, w, h, alpha, alpha) * schlick((o * h).sum(axis=0)), mu),
    )


@cache
def mean_facets(alpha: float) -> tuple[float, float]:
    """Their means over the hemisphere (Gauss-Legendre)."""
    x, w = np.polynomial.legendre.leggauss(12)
    mu = (x + 1) / 2
    found = np.array([facets(alpha, float(m)) for m in mu])
    whole, edge = (found * (w * mu)[:, None]).sum(axis=0)
    return float(whole), float(edge)


def reflected(alpha: float, mu: float, f0: float, f90: float = 1.0) -> float:
    """Albedo of facets with these ends."""
    whole, edge = facets(alpha, mu)
    return f0 * (whole - edge) + f90 * edge


def mean_reflected(alpha: float, f0: float, f90: float = 1.0) -> float:
    """Its mean over the hemisphere."""
    whole, edge = mean_facets(alpha)
    return f0 * (whole - edge) + f90 * edge


@cache
def fibres(alpha: float, mu: float) -> float:
    """Albedo of white sheen."""
    return albedo(lambda o, w, h: charlie(o, w, h, alpha), mu)


def thin_film(mu: float, index: float, nanometres: float, f0: Array) -> Array:
    """Reflectance of a film (KHR_materials_iridescence), three channels."""
    x = np.clip(nanometres / 30, 0, 1)
    index = 1 + (index - 1) * x * x * (3 - 2 * x)
    inner = np.sqrt(1 - (1 - mu * mu) / index**2)
    r12 = ((1 - index) / (1 + index)) ** 2
    r12 = r12 + (1 - r12) * schlick(mu)
    base = (1 + np.sqrt(np.minimum(f0, 0.9999))) / (1 - np.sqrt(np.minimum(f0, 0.9999)))
    r23 = ((base - index) / (base + index)) ** 2
    r23 = r23 + (1 - r23) * schlick(inner)
    phase = np.pi + np.where(base < index, np.pi, 0.0)
    path = 2 * index * nanometres * 1e-9 * inner
    t121 = 1 - r12
    r123 = np.clip(r12 * r23, 1e-5, 0.9999)
    series = t121**2 * r23 / (1 - r123)
    total = r12 + series
    term = series - t121
    for m in (1, 2):
        term = term * np.sqrt(r123)
        total = total + 2 * term * _sensitivity(m * path, m * phase)
    return np.clip(total, 0, 1)


def _sensitivity(path: float, shift: Array) -> Array:
    """The eye's answer to a wave (Belcour and Barla 2017), linear Rec.709."""
    wave = 2 * np.pi * path
    value = np.array([5.4856e-13, 4.4201e-13, 5.2481e-13])
    middle = np.array([1.6810e06, 1.7953e06, 2.2084e06])
    variance = np.array([4.3278e09, 9.3046e09, 6.6121e09])
    xyz = value * np.sqrt(2 * np.pi * variance) * np.cos(middle * wave + shift) * np.exp(-variance * wave**2)
    second = 9.7470e-14 * np.sqrt(2 * np.pi * 4.5282e09) * np.cos(2.2399e06 * wave + shift[0])
    xyz[0] += second * np.exp(-4.5282e09 * wave**2)
    matrix = [
        (3.2404542, -1.5371385, -0.4985314),
        (-0.9692660, 1.8760108, 0.0415560),
        (0.0556434, -0.2040259, 1.0572252),
    ]
    return np.array(matrix) @ (xyz / 1.0685e-7)


def value(
    o: Array,
    w: Array,
    *,
    base: tuple[float, float, float],
    metallic: float = 0.0,
    roughness: float = 0.5,
    ior: float = 1.5,
    specular: float = 1.0,
    specular_color: tuple[float, float, float] = (1.0, 1.0, 1.0),
    clearcoat: float = 0.0,
    clearcoat_roughness: float = 0.0,
    sheen: tuple[float, float, float] = (0.0, 0.0, 0.0),
    sheen_roughness: float = 0.3,
    anisotropy: float = 0.0,
    film: tuple[float, float, float] | None = None,
) -> Array:
    """(3,) f times cosine for two directions above the surface; film: strength, index, nm."""
    h = between(o, w)
    cosine = float(o @ h)
    tint = np.array(base)
    bare = np.minimum(((ior - 1) / (ior + 1)) ** 2 * np.array(specular_color), 1) * specular
    metal = tint.copy()
    if film:
        strength, index, nanometres = film
        under = (1 - metallic) * bare + metallic * metal
        weight = schlick(o[2])
        coloured = np.maximum((thin_film(float(o[2]), index, nanometres, under) - weight) / (1 - weight), 0)
        bare, metal = ((1 - strength) * x + strength * coloured for x in (bare, metal))
    alpha = roughness**2
    at = alpha + (1 - alpha) * anisotropy**2
    assert not anisotropy or metallic == 1, "albedos are those of isotropic facets"
    lobe = float(ggx(o[:, None], w[:, None], h[:, None], at, alpha)[0])
    edge = schlick(cosine)
    dielectric = (bare + (specular - bare) * edge) * lobe
    strongest = float(bare.max())
    left = [1 - reflected(alpha, float(mu), strongest, specular) for mu in (o[2], w[2])]
    matt = tint / np.pi * left[0] * left[1] / (1 - mean_reflected(alpha, strongest, specular))
    conductor = (metal + (1 - metal) * edge) * lobe
    if not anisotropy:
        whole, mean = facets(alpha, float(o[2]))[0], mean_facets(alpha)[0]
        average = metal + (1 - metal) / 21
        conductor = conductor * (1 + (1 - whole) / whole * average * mean / (1 - average * (1 - mean)))

    # Layers above.
    coat_alpha = max(clearcoat_roughness**2, 1e-4)
    coat = [clearcoat * reflected(coat_alpha, float(mu), 0.04) if clearcoat else 0.0 for mu in (o[2], w[2])]
    coat_mean = clearcoat * mean_reflected(coat_alpha, 0.04) if clearcoat else 0.0
    sheen_alpha = sheen_roughness**2
    woven = [fibres(sheen_alpha, float(mu)) if max(sheen) else 0.0 for mu in (o[2], w[2])]
    under_sheen = 1 - max(sheen) * min(max(woven), 1.0)
    glossy = (1 - max(coat)) * under_sheen
    even = (1 - coat[0]) * (1 - coat[1]) / (1 - coat_mean) * under_sheen
    total = (1 - metallic) * (dielectric * glossy + matt * even) + metallic * conductor * glossy
    if max(sheen):
        fibre = float(charlie(o[:, None], w[:, None], h[:, None], sheen_alpha)[0])
        total = total + np.array(sheen) * fibre / max(1.0, *woven) * (1 - max(coat))
    if clearcoat:
        lacquer = float(ggx(o[:, None], w[:, None], h[:, None], coat_alpha, coat_alpha)[0])
        total = total + clearcoat * (0.04 + 0.96 * edge) * lacquer
    return np.asarray(total * w[2])
