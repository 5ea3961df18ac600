"""The class `Principled`: what it accepts, what it is packed into, and what stands for it."""

from __future__ import annotations

import numpy as np
import pytest

from lumipath.errors import SceneError
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene
from lumipath.scene import Principled, Scene, Sphere, Texture

GREY = Texture(image=np.full((1, 1, 3), 0.5))


def features(**parameters):
    return pack_scene(Scene(shapes=[Sphere(material=Principled(**parameters))])).scene.features.mask


def kind_of_inside(**parameters):
    scene = pack_scene(Scene(shapes=[Sphere(material=Principled(**parameters))])).scene
    return scene.materials[0, layout.EXTINCTION + 3]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"roughness": 1.5}, "Principled: roughness is 1.5: it must be a number from 0 to 1"),
        ({"ior": 0.5}, "Principled: ior is 0.5: it must be a number from 1 to 10"),
        ({"base_color": 2.0}, "base_color"),
        ({"sheen_color": (0.1, 0.2)}, "sheen_color"),
        ({"iridescence_thickness": -1.0, "name": "soap"}, "Principled 'soap': iridescence_thickness is -1.0"),
        ({"attenuation_distance": 0.0}, "attenuation_distance"),
        ({"attenuation_distance": float("nan")}, "attenuation_distance"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(parameters, message):
    with pytest.raises(SceneError, match=message):
        Principled(**parameters)


PARTS = layout.CLEARCOAT | layout.SHEEN | layout.IRIDESCENCE | layout.TRANSMISSION | layout.SPECULAR | layout.ANISOTROPY


@pytest.mark.parametrize(
    ("parameters", "part"),
    [
        ({}, 0),
        ({"metallic": 0.5, "roughness": GREY, "clearcoat_roughness": 1.0, "sheen_roughness": 1.0}, 0),
        ({"clearcoat": 0.5}, layout.CLEARCOAT),
        ({"sheen_color": (0.0, 0.1, 0.0)}, layout.SHEEN),
        ({"iridescence": GREY}, layout.IRIDESCENCE),
        ({"transmission": 0.5}, layout.TRANSMISSION),
        ({"specular": 0.9}, layout.SPECULAR),
        ({"specular_color": (1.0, 0.9, 1.0)}, layout.SPECULAR),
        ({"anisotropy": 0.3}, layout.ANISOTROPY),
    ],
)
def test_only_parts_that_are_used_are_compiled(parameters, part):
    found = features(**parameters)
    assert found & layout.PRINCIPLED
    assert found & PARTS == part


def test_a_texture_of_any_parameter_makes_the_scene_read_textures():
    assert not features() & layout.TEXTURES
    for name in ("base_color", "metallic", "roughness", "transmission", "clearcoat", "sheen_color", "iridescence"):
        assert features(**{name: GREY}) & layout.TEXTURES, name


class TestInside:
    def test_only_what_is_not_thin_has_one(self):
        assert Principled(transmission=0.5).is_dielectric
        assert not Principled(transmission=0.5, thin=True).is_dielectric
        assert not Principled(attenuation_color=0.5, attenuation_distance=1.0).is_dielectric
        # Looks go through it as well; only one of them leads into another medium.
        kinds = [kind_of_inside(transmission=0.5, thin=thin) for thin in (False, True)]
        assert kinds == [layout.BODY, layout.SHEET]

    def test_absorbs_by_distance(self):
        glass = Principled(transmission=1.0, attenuation_color=(0.5, 1.0, 0.25), attenuation_distance=0.1)
        packed = pack_scene(Scene(shapes=[Sphere(material=glass)])).scene
        extinction = packed.materials[0, layout.EXTINCTION : layout.EXTINCTION + 3]
        np.testing.assert_allclose(np.exp(-0.1 * extinction), (0.5, 1.0, 0.25), rtol=1e-6)


class TestLobes:
    def test_matt_metal_and_glass(self):
        red = (0.8, 0.1, 0.1)
        plastic = Principled(base_color=red).as_lobes()
        assert plastic.diffuse == pytest.approx(red)
        assert plastic.specular is None
        mirror = Principled(base_color=red, metallic=1.0, roughness=0.1).as_lobes()
        assert mirror.specular == pytest.approx(red)
        assert mirror.diffuse == (0.0, 0.0, 0.0)
        # What is rough shows its colour, not what it mirrors.
        assert Principled(base_color=red, metallic=1.0, roughness=0.8).as_lobes().diffuse == pytest.approx(red)
        glass = Principled(base_color=red, transmission=1.0, ior=1.4).as_lobes()
        assert glass.is_dielectric
        assert (glass.index, glass.diffuse) == (1.4, (0.0, 0.0, 0.0))
        pane = Principled(base_color=red, transmission=1.0, thin=True).as_lobes()
        assert (pane.transmissive, pane.index, pane.diffuse) == ((1.0, 1.0, 1.0), 1.0, (0.0, 0.0, 0.0))

    @pytest.mark.parametrize(("transmission", "kind"), [(0.4, layout.VEILED_BODY), (0.6, layout.BODY)])
    def test_what_is_mostly_matt_lets_light_through_for_paths_only(self, transmission, kind):
        milk = Principled(base_color=0.8, transmission=transmission, ior=1.4)
        assert kind_of_inside(transmission=transmission) == kind
        assert features(transmission=transmission) & layout.DIELECTRICS
        lobes = milk.as_lobes()
        # Lobes of both kinds count in full.
        assert lobes.is_dielectric == (transmission > 0.5)
        assert lobes.diffuse == pytest.approx((0.0,) * 3 if lobes.is_dielectric else (0.8,) * 3)

    def test_textures_stay(self):
        assert Principled(base_color=GREY).as_lobes().diffuse is GREY
        assert Principled(base_color=GREY, metallic=1.0, roughness=0.0).as_lobes().specular is GREY
