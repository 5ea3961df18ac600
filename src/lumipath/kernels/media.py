"""The medium that a path travels in: absorption, and which medium comes next."""

from __future__ import annotations

from ..lang import Vec3, f32, i32, inverse, kernel, load4
from ..pack.layout import DIELECTRICS, EXTINCTION, MATERIAL_SIZE, REFRACTION
from .functions import exp_minus
from .vectors import white, xyz


@kernel
def clear(scene, medium, t):
    """Nothing is absorbed."""
    return white()


@kernel(needs=DIELECTRICS, otherwise=clear)
def transmittance(scene, medium, t):
    """Fraction of light left after the distance t inside of material `medium`, -1 outside (Beer's law)."""
    # What comes from infinitely far away comes from outside.
    if (medium < 0) | (t > 1e18):
        return white()
    k = xyz(load4(scene.materials, medium * MATERIAL_SIZE + EXTINCTION))
    return Vec3(exp_minus(k.x * t), exp_minus(k.y * t), exp_minus(k.z * t))


@kernel
def never_dielectric(scene, material):
    """No material lets light through."""
    return False


@kernel(needs=DIELECTRICS, otherwise=never_dielectric)
def is_dielectric(scene, material):
    """Whether light goes through this material."""
    return load4(scene.materials, material * MATERIAL_SIZE + EXTINCTION)[3] > 0.0


@kernel
def medium_beyond(scene, s, same_side, medium):
    """The medium that a path goes on in: another one only where it passes through the surface of a dielectric."""
    if same_side | (not is_dielectric(scene, s.material)):
        return medium
    return s.material if s.front else i32(-1)


@kernel
def no_index(scene, s):
    """Nothing is refracted."""
    return f32(1.0)


@kernel(needs=DIELECTRICS, otherwise=no_index)
def index_beyond(scene, s):
    """Index of refraction beyond a surface relative to the viewer's side."""
    index = load4(scene.materials, s.material * MATERIAL_SIZE + REFRACTION)[0]
    return index if s.front else inverse(index)
