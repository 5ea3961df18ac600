"""Iridescence: the reflectance of a film of some hundred nanometres.

Belcour and Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence", in the
form in which the glTF extension KHR_materials_iridescence writes it down.
"""

from __future__ import annotations

import math

from ...lang import Vec3, f32, kernel, sqrt
from ..fresnel import schlick_weight
from ..functions import cos_sin_turn, exp_minus, floor_int

# The paper fits the sensitivities of the eye by Gaussians of the wave number: value, middle and variance of each. As
# here the path difference is in micrometres, a middle becomes turns, and a variance the exponent of a damping.
_UNIT = 1.0685e-7
_GAUSSIANS = (
    (5.4856e-13, 1.6810e6, 4.3278e9),
    (4.4201e-13, 1.7953e6, 9.3046e9),
    (5.2481e-13, 2.2084e6, 6.6121e9),
    (9.7470e-14, 2.2399e6, 4.5282e9),
)
_X_SIZE, _Y_SIZE, _Z_SIZE, _X2_SIZE = (f32(v * math.sqrt(2 * math.pi * s) / _UNIT) for v, _, s in _GAUSSIANS)
_X_TURNS, _Y_TURNS, _Z_TURNS, _X2_TURNS = (f32(m * 1e-6) for _, m, _ in _GAUSSIANS)
_X_DAMPING, _Y_DAMPING, _Z_DAMPING, _X2_DAMPING = (f32((2 * math.pi) ** 2 * s * 1e-12) for _, _, s in _GAUSSIANS)


@kernel
def cosine_of_turns(x):
    """Cos of 2 pi x for any x."""
    cosine, _ = cos_sin_turn(x - f32(floor_int(x)))
    return cosine


@kernel
def sensed_wave(path, flip):
    """How light whose two parts differ by a path (micrometres) is seen, linear Rec.709; flip: half a wave more."""
    p2 = path * path
    x = _X_SIZE * cosine_of_turns(_X_TURNS * path + flip.x) * exp_minus(_X_DAMPING * p2)
    x += _X2_SIZE * cosine_of_turns(_X2_TURNS * path + flip.x) * exp_minus(_X2_DAMPING * p2)
    y = _Y_SIZE * cosine_of_turns(_Y_TURNS * path + flip.y) * exp_minus(_Y_DAMPING * p2)
    z = _Z_SIZE * cosine_of_turns(_Z_TURNS * path + flip.z) * exp_minus(_Z_DAMPING * p2)
    return Vec3(
        3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
        -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
        0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
    )


@kernel
def bottom_reflectance(f0, index, weight):
    """Of the film's lower side, of one channel: below lies what reflects f0 into the air. Second: turns of phase."""
    root = sqrt(min(f0, 0.9999))
    below = (1.0 + root) / (1.0 - root)
    r = (below - index) / (below + index)
    r = r * r
    return r + (1.0 - r) * weight, (f32(0.5) if below < index else f32(0.0))


@kernel
def film_reflectance(cosine, index, thickness, f0):
    """Reflectance of a film on a surface, linear Rec.709, from 0 to 1.

    Args:
        cosine: of the viewer, from 0 to 1.
        index: of the film, 1 or more.
        thickness: micrometres.
        f0: reflectance of the bare surface face to face, Vec3.
    """
    # A film that is much thinner than a wave is not there.
    x = min(thickness * 33.333333, 1.0)
    eta = 1.0 + (index - 1.0) * (x * x * (3.0 - 2.0 * x))
    inside = sqrt(max(0.0, 1.0 - (1.0 - cosine * cosine) / (eta * eta)))
    # The upper side, and the lower one with its phase.
    top = (eta - 1.0) / (eta + 1.0)
    top = top * top
    top = top + (1.0 - top) * schlick_weight(cosine)
    weight = schlick_weight(inside)
    r, shift_r = bottom_reflectance(f0.x, eta, weight)
    g, shift_g = bottom_reflectance(f0.y, eta, weight)
    b, shift_b = bottom_reflectance(f0.z, eta, weight)
    # The upper side turns a wave over on one of its sides, the lower side where what is below is denser. A turn of both
    # is none, and so are two of them.
    shift = Vec3(shift_r + 0.5, shift_g + 0.5, shift_b + 0.5)
    path = 2.0 * eta * thickness * inside
    both = Vec3(min(max(top * r, 1e-5), 0.9999), min(max(top * g, 1e-5), 0.9999), min(max(top * b, 1e-5), 0.9999))
    root = Vec3(sqrt(both.x), sqrt(both.y), sqrt(both.z))
    through = (1.0 - top) * (1.0 - top)
    series = Vec3(through * r / (1.0 - both.x), through * g / (1.0 - both.y), through * b / (1.0 - both.z))
    # The sum over light that goes to and fro is a Fourier series of the path: its mean and two more terms.
    total = series + Vec3(top, top, top)
    once = (series - Vec3(1.0 - top, 1.0 - top, 1.0 - top)) * root
    total = total + once * sensed_wave(path, shift) * 2.0
    total = total + once * root * sensed_wave(2.0 * path, shift * 2.0) * 2.0
    return Vec3(min(max(total.x, 0.0), 1.0), min(max(total.y, 0.0), 1.0), min(max(total.z, 0.0), 1.0))


@kernel
def without_schlick(reflectance, cosine):
    """What a surface must reflect face to face for Schlick's formula to give a reflectance at this cosine."""
    weight = schlick_weight(cosine)
    scale = 1.0 / max(1.0 - weight, 1e-4)
    return Vec3(
        max(reflectance.x - weight, 0.0) * scale,
        max(reflectance.y - weight, 0.0) * scale,
        max(reflectance.z - weight, 0.0) * scale,
    )
