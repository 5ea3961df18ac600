"""The principled BSDF over arrays of directions, and materials that show all of its parts."""

from __future__ import annotations

import numpy as np
from bsdf_calls import looped, packed_with

from lumipath.kernels.bsdf.principled import eval_principled, principled_at, sample_principled
from lumipath.kernels.bsdf.responses import Question
from lumipath.kernels.media import index_beyond
from lumipath.kernels.surface import Surface
from lumipath.kernels.tangents import no_tangents
from lumipath.lang import Vec3, i32, kernel
from lumipath.scene import Principled, Texture

MATERIALS = {
    "plastic": Principled(base_color=(0.8, 0.4, 0.1), roughness=0.3),
    "smooth plastic": Principled(base_color=(0.8, 0.4, 0.1), roughness=0.0),
    "white plastic": Principled(base_color=1.0, roughness=0.6),
    "rubber": Principled(base_color=0.5, roughness=1.0, specular=0.0),
    "pearl": Principled(base_color=0.9, roughness=0.35, ior=2.0, specular=0.7, specular_color=(1.0, 0.5, 0.2)),
    "metal": Principled(base_color=(0.9, 0.6, 0.3), metallic=1.0, roughness=0.4),
    "white metal": Principled(base_color=1.0, metallic=1.0, roughness=0.8),
    "half metal": Principled(base_color=(0.9, 0.6, 0.3), metallic=0.5, roughness=0.5),
    "brushed metal": Principled(base_color=0.7, metallic=1.0, roughness=0.3, anisotropy=0.7),
    "lacquer": Principled(base_color=(0.7, 0.1, 0.1), roughness=0.7, clearcoat=1.0, clearcoat_roughness=0.3),
    "white lacquer": Principled(base_color=1.0, roughness=0.7, clearcoat=0.8, clearcoat_roughness=0.5),
    "varnished metal": Principled(base_color=1.0, metallic=1.0, roughness=0.4, clearcoat=1.0),
    "velvet": Principled(base_color=(0.3, 0.05, 0.2), roughness=0.9, sheen_color=(0.9, 0.6, 0.8), sheen_roughness=0.4),
    "white velvet": Principled(base_color=1.0, roughness=0.9, sheen_color=1.0, sheen_roughness=0.15),
    "soap": Principled(base_color=0.5, roughness=0.25, iridescence=1.0, iridescence_thickness=350.0),
    "oiled metal": Principled(
        base_color=0.9, metallic=1.0, roughness=0.3, iridescence=1.0, iridescence_ior=1.8, iridescence_thickness=500.0
    ),
    "frosted glass": Principled(base_color=1.0, transmission=1.0, roughness=0.5),
    "tinted glass": Principled(base_color=(0.9, 0.5, 0.3), transmission=1.0, roughness=0.3, ior=1.7),
    "clear glass": Principled(base_color=1.0, transmission=1.0, roughness=0.0),
    "milk glass": Principled(base_color=(0.9, 0.8, 0.7), transmission=0.6, roughness=0.4, clearcoat=0.5),
    "tracing paper": Principled(base_color=0.9, transmission=0.7, roughness=0.6, thin=True),
    "window": Principled(base_color=1.0, transmission=1.0, roughness=0.0, thin=True),
    "everything": Principled(
        base_color=(0.9, 0.7, 0.8),
        metallic=0.3,
        roughness=0.4,
        transmission=0.5,
        specular=0.8,
        specular_color=(1.0, 0.8, 0.6),
        clearcoat=0.7,
        clearcoat_roughness=0.2,
        sheen_color=(0.4, 0.3, 0.5),
        sheen_roughness=0.5,
        anisotropy=0.4,
        iridescence=0.6,
    ),
    "textured": Principled(
        base_color=Texture(image=np.full((1, 1, 3), 0.5)), roughness=Texture(image=np.full((1, 1, 3), 0.4))
    ),
}
NAMES = list(MATERIALS)
KINDS = {
    "plastic": {},
    "metal": {"metallic": 1.0},
    "glass": {"transmission": 1.0},
    "wall": {"transmission": 1.0, "thin": True},
    "lacquer": {"clearcoat": 1.0, "clearcoat_roughness": 0.3},
    "varnish": {"clearcoat": 1.0},
    "velvet": {"sheen_color": 1.0, "sheen_roughness": 0.5},
}
WHITE = {
    f"{kind} {roughness}": Principled(base_color=1.0, roughness=roughness, **options)
    for kind, options in KINDS.items()
    for roughness in (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)
}
"""White surfaces of all kinds and roughnesses."""


@kernel
def surface(material, front):
    """A flat surface, z upwards."""
    up = Vec3(0, 0, 1)
    return Surface(Vec3(0, 0, 0), up, up, front, material, i32(-1), 0.0, 0.0, 0.0, 0.0, 1.0, no_tangents(), 0.0)


@kernel
def question(scene, s, wo, wi):
    """What a BSDF is asked that borders on nothing else."""
    return Question(wo, wi, 0.0, 0.0, 0.0, index_beyond(scene, s, i32(-1)), False)


def _value(scene, material, front, ox, oy, oz, ix, iy, iz):
    wo = Vec3(ox, oy, oz)
    s = surface(i32(material), front)
    m = principled_at(scene, s, question(scene, s, wo, wo))
    found = eval_principled(scene, m, wo, Vec3(ix, iy, iz))
    return found.f.x, found.f.y, found.f.z, found.pdf


def _sample(scene, material, front, ox, oy, oz, u, v, choice):
    wo = Vec3(ox, oy, oz)
    s = surface(i32(material), front)
    m = principled_at(scene, s, question(scene, s, wo, wo))
    found = sample_principled(scene, m, wo, u, v, choice)
    return found.wi.x, found.wi.y, found.wi.z, found.weight.x, found.weight.y, found.weight.z, found.pdf


_values = looped(_value, outputs=4, scene=True)
_samples = looped(_sample, outputs=7, scene=True)


class PrincipledScene:
    """A packed scene with some materials, and their BSDFs.

    Args:
        materials: by name.
    """

    def __init__(self, materials: dict[str, Principled]) -> None:
        self.packed = packed_with(*materials.values())
        self._numbers = {name: number for number, name in enumerate(materials)}

    def values(self, name: str, wo: np.ndarray, wi: np.ndarray, front: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """(3, N) f times cosine, and (N,) densities, for (3, N) directions."""
        found = _values(self.packed, np.int32(self._numbers[name]), np.bool_(front), *wo, *wi)
        return found[:3].astype(float), found[3].astype(float)

    def samples(self, name: str, wo: np.ndarray, numbers: np.ndarray, front: bool = True) -> tuple[np.ndarray, ...]:
        """(3, N) directions, (3, N) weights and (N,) densities, for (3, N) random numbers."""
        found = _samples(self.packed, np.int32(self._numbers[name]), np.bool_(front), *wo, *numbers)
        return found[:3], found[3:6].astype(float), found[6].astype(float)
