"""The principled material against the formulas of the glTF specification, in NumPy."""

from __future__ import annotations

import gltf_reference
import numpy as np
import pytest
from bsdf_calls import at_angle
from principled_calls import MATERIALS, PrincipledScene

PARAMETERS = {
    "plastic": {"base": (0.8, 0.4, 0.1), "roughness": 0.3},
    "rubber": {"base": (0.5, 0.5, 0.5), "roughness": 1.0, "specular": 0.0},
    "pearl": {
        "base": (0.9, 0.9, 0.9),
        "roughness": 0.35,
        "ior": 2.0,
        "specular": 0.7,
        "specular_color": (1.0, 0.5, 0.2),
    },
    "metal": {"base": (0.9, 0.6, 0.3), "metallic": 1.0, "roughness": 0.4},
    "half metal": {"base": (0.9, 0.6, 0.3), "metallic": 0.5, "roughness": 0.5},
    "lacquer": {"base": (0.7, 0.1, 0.1), "roughness": 0.7, "clearcoat": 1.0, "clearcoat_roughness": 0.3},
    "velvet": {"base": (0.3, 0.05, 0.2), "roughness": 0.9, "sheen": (0.9, 0.6, 0.8), "sheen_roughness": 0.4},
    "white velvet": {"base": (1.0, 1.0, 1.0), "roughness": 0.9, "sheen": (1.0, 1.0, 1.0), "sheen_roughness": 0.15},
    "soap": {"base": (0.5, 0.5, 0.5), "roughness": 0.25, "film": (1.0, 1.3, 350.0)},
    "oiled metal": {"base": (0.9, 0.9, 0.9), "metallic": 1.0, "roughness": 0.3, "film": (1.0, 1.8, 500.0)},
    "textured": {"base": (0.5, 0.5, 0.5), "roughness": 0.4},
}


@pytest.fixture(scope="module")
def scene():
    return PrincipledScene(MATERIALS)


@pytest.mark.parametrize("name", PARAMETERS)
def test_values_are_those_of_the_specification(scene, name):
    rng = np.random.default_rng(5)
    o, w = (at_angle(rng.uniform(0.1, 0.98, 12), rng.random(12)) for _ in range(2))
    # Near the mirrored direction too.
    w[:, :4] = o[:, :4] * np.array([[-1.0], [-1.0], [1.0]])
    found, _ = scene.values(name, o, w)
    exact = [gltf_reference.value(a, b, **PARAMETERS[name]) for a, b in zip(o.T.astype(float), w.T.astype(float))]
    np.testing.assert_allclose(found.T, exact, rtol=0.012, atol=5e-4)


def test_an_anisotropic_highlight_has_the_shape_of_the_specification(scene):
    o, w = at_angle(np.full(64, 0.9), 0.05), at_angle(np.full(64, 0.9), np.arange(64) / 64)
    found, _ = scene.values("brushed metal", o, w)
    exact = [
        gltf_reference.value(a, b, base=(0.7, 0.7, 0.7), metallic=1.0, roughness=0.3, anisotropy=0.7)
        for a, b in zip(o.T.astype(float), w.T.astype(float))
    ]
    ratio = found[0] / np.array(exact)[:, 0]
    # What light between facets adds depends on the viewer only.
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-3)
    assert 1.0 < ratio[0] < 1.3


def test_colours_of_a_film_change_with_its_thickness(scene):
    mirror = {"metallic": 1.0, "roughness": 0.3}
    o = at_angle(0.8).astype(float)
    w = o * (-1, -1, 1)
    hues = [
        gltf_reference.value(o, w, base=(0.9,) * 3, film=(1.0, 1.8, nm), **mirror).argmax() for nm in (120, 220, 500)
    ]
    assert len(set(hues)) > 1
