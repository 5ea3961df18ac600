"""Glass and metals by name: what their fields mean, and what packing makes of them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lumipath.errors import SceneError
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene
from lumipath.scene import Conductor, Dielectric, Material, Scene, Sphere, Texture, ThinDielectric
from lumipath.scene.metals import METALS


def packed(material):
    return pack_scene(Scene(shapes=[Sphere(material=material)])).scene


def test_clear_glass_is_the_dielectric_lobe_and_costs_nothing_more():
    ours = packed(Dielectric(ior=1.4, attenuation_color=(0.5, 0.6, 0.7), attenuation_distance=2.0))
    lobes = packed(Material(index=1.4, transmissive=tuple(part**0.5 for part in (0.5, 0.6, 0.7))))
    assert ours.features == lobes.features
    assert not ours.bsdfs.any()
    assert not ours.energy.any()
    row, other = ours.materials[0], lobes.materials[0]
    np.testing.assert_allclose(row[:25], other[:25], rtol=1e-6)
    # The lobe's weight is 1: nothing else is there to choose.
    assert row[layout.REFRACTION + 1] == 1


def test_a_medium_may_absorb_everything_within_a_millimetre():
    row = packed(Dielectric(attenuation_color=(0.1, 0.01, 1e-30), attenuation_distance=1e-4)).materials[0]
    expected = [math.log(10) / 1e-4, math.log(100) / 1e-4, math.log(1e20) / 1e-4]
    np.testing.assert_allclose(row[layout.EXTINCTION : layout.EXTINCTION + 3], expected, rtol=1e-6)
    assert row[layout.EXTINCTION + 3] == 1


@pytest.mark.parametrize(
    "options",
    [{"roughness": 0.1}, {"reflection_tint": 0.5}, {"transmission_tint": (1, 0.5, 1)}],
    ids=lambda options: next(iter(options)),
)
def test_other_glass_has_a_record_of_its_own(options):
    scene = packed(Dielectric(ior=1.3, **options))
    assert scene.features.mask & layout.ROUGH_DIELECTRICS
    assert scene.features.mask & layout.DIELECTRICS
    assert scene.bsdfs.view(np.int32)[0, 0] == layout.ROUGH_DIELECTRIC_KIND
    assert scene.bsdfs[0, layout.BSDF_REFRACTION] == np.float32(1.3)


def test_glass_of_one_index_shares_its_tables():
    shapes = [Sphere(material=Dielectric(ior=ior, roughness=0.2)) for ior in (1.5, 1.3, 1.5)]
    scene = pack_scene(Scene(shapes=shapes)).scene
    assert scene.energy.shape == (layout.ENERGY_INDICES + 4, layout.ENERGY_TABLE)
    first = int(layout.ENERGY_INDICES)
    assert scene.bsdfs.view(np.int32)[:, layout.BSDF_REFRACTION + 1].tolist() == [first, first + 2, first]


def test_roughness_and_tints_may_be_textures():
    texture = Texture(image=np.full((2, 2, 3), 0.5))
    scene = packed(Dielectric(roughness=texture, transmission_tint=texture))
    assert len(scene.textures) == 1
    assert scene.bsdfs.view(np.int32)[0, [layout.BSDF_ROUGHNESS + 3, layout.BSDF_COLOUR + 3]].tolist() == [0, 0]


def test_a_pane_has_no_inside():
    scene = packed(ThinDielectric(ior=1.6, tint=(1, 0.9, 0.8)))
    assert scene.features.mask & layout.THIN_DIELECTRICS
    np.testing.assert_array_equal(scene.materials[0, layout.EXTINCTION : layout.EXTINCTION + 3], 0)


def test_every_metal_is_documented():
    page = (Path(__file__).parents[2] / "docs" / "materials.md").read_text(encoding="utf-8")
    assert [name for name in METALS if f"`{name}`" not in page] == []
    for name in METALS:
        assert 0.4 < np.mean(Conductor(metal=name).face_on()) < 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Dielectric(ior=0), "Dielectric: ior is 0: it must be a number from 0.1 to 10"),
        (lambda: Dielectric(roughness=2, name="ice"), "Dielectric 'ice': roughness is 2"),
        (lambda: Dielectric(attenuation_distance=0), "attenuation_distance is 0"),
        (lambda: Dielectric(transmission_tint=(1, 2, 1)), "transmission_tint"),
        (lambda: ThinDielectric(ior=0.9), "ThinDielectric: ior is 0.9: it must be a number from 1 to 10"),
        (lambda: ThinDielectric(tint=-1), "tint"),
    ],
)
def test_bad_values_are_named(make, message):
    with pytest.raises(SceneError, match=message) as raised:
        make()
    assert "\n" not in str(raised.value)
