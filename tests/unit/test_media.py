"""Several media at once, packed into one number."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped

from lumipath.errors import SceneError
from lumipath.kernels.media import contains, entered, index_in, left, strongest, transmittance
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene
from lumipath.scene import Dielectric, Diffuse, Material, Mix, Principled, Scene, Sphere, ThinDielectric

OUTSIDE = np.int32(-1)

enter = looped(lambda media, medium: entered(media, medium), dtype=np.int32)
leave = looped(lambda media, medium: left(media, medium), dtype=np.int32)
holds = looped(lambda media, medium: contains(media, medium), dtype=np.int32)


def media_of(*numbers):
    media = OUTSIDE
    for number in numbers:
        media = enter(media, np.int32(number))[0]
    return media


def packed(*materials):
    return pack_scene(Scene(shapes=[Sphere(material=material) for material in materials])).scene


def test_what_is_entered_can_be_left_in_any_order():
    media = media_of(3, 0, 126, 3)
    for number, rest in ((0, (3, 126, 3)), (126, (3, 0, 3)), (3, (3, 0, 126))):
        assert leave(media, np.int32(number))[0] == media_of(*rest)
    assert leave(leave(media_of(5, 7), np.int32(5)), np.int32(7))[0] == OUTSIDE


def test_a_fifth_medium_is_not_there_and_what_was_not_entered_cannot_be_left():
    media = media_of(1, 2, 3, 4)
    assert enter(media, np.int32(5))[0] == media
    assert leave(media, np.int32(5))[0] == media
    assert leave(OUTSIDE, np.int32(0))[0] == OUTSIDE


def test_a_path_knows_what_it_is_in():
    media = media_of(1, 126)
    assert holds(media, np.int32([0, 1, 2, 126])).tolist() == [0, 1, 0, 1]


@pytest.fixture(scope="module")
def glasses():
    """Number 0: weak; 1 and 2: as strong as each other; 3: above all others, without a priority."""
    absorbing = {"attenuation_color": (0.5, 0.25, 1.0), "attenuation_distance": 1.0}
    return packed(
        Dielectric(ior=1.1, priority=-1),
        Dielectric(ior=1.2, priority=4, **absorbing),
        Dielectric(ior=1.3, priority=4),
        Dielectric(ior=1.4),
        Material(diffuse=0.5),
        ThinDielectric(),
    )


def test_the_highest_priority_wins_and_of_equals_the_last(glasses):
    wins = looped(lambda scene, media: strongest(scene, media), dtype=np.int32, scene=True)
    index = looped(lambda scene, media: index_in(scene, media), scene=True)
    cases = {(): -1, (0,): 0, (0, 1): 1, (1, 0): 1, (1, 2): 2, (2, 0, 1): 1, (3, 1): 3, (1, 3): 3}
    media = np.array([media_of(*numbers) for numbers in cases], np.int32)
    assert wins(glasses, media).tolist() == list(cases.values())
    expected = [1.0, *(1.1 + 0.1 * number for number in list(cases.values())[1:])]
    np.testing.assert_allclose(index(glasses, media), expected, rtol=1e-6)


def test_the_strongest_medium_absorbs(glasses):
    absorb = looped(lambda scene, media, t: transmittance(scene, media, t).x, scene=True)
    media = np.array([media_of(), media_of(1), media_of(1, 0), media_of(1, 2)], np.int32)
    np.testing.assert_allclose(absorb(glasses, media, 2.0), [1, 0.25, 0.25, 1], rtol=1e-5)


def test_only_bodies_have_media_and_only_where_one_has_a_priority(glasses):
    assert glasses.features.mask & layout.NESTED
    numbers = glasses.materials.view(np.int32)[:, layout.REFRACTION + 2]
    assert numbers.tolist() == [0, 1, 2, 3, -1, -1]
    plain = packed(Dielectric(), Dielectric(roughness=0.5))
    assert not plain.features.mask & layout.NESTED
    assert not plain.media.any()


def test_parts_of_a_mix_lead_into_one_medium():
    clear, frosted = Dielectric(priority=1), Dielectric(roughness=0.5, priority=1)
    scene = packed(Mix(first=clear, second=frosted), Dielectric(priority=2), Dielectric(priority=1))
    numbers = scene.materials.view(np.int32)[:, layout.REFRACTION + 2]
    # The mix itself is never met; its parts are the last two.
    assert numbers.tolist() == [-1, 0, 1, 1, 1]
    assert len(scene.media) == 2


def test_a_mix_has_one_inside():
    glass, paint = Dielectric(ior=1.5), Diffuse()
    other = Principled(ior=1.5, transmission=1.0, roughness=0.2)
    for second in (paint, other, ThinDielectric()):
        assert Mix(first=glass, second=Mix(first=second, second=paint)).inside == glass.inside
    for second in (Dielectric(ior=1.4), Dielectric(priority=1), Principled(ior=1.4, transmission=0.1)):
        with pytest.raises(SceneError, match="Mix 'bad': first and second enclose different media"):
            Mix(first=Mix(first=paint, second=glass), second=second, name="bad")


def test_too_many_media_are_refused():
    with pytest.raises(SceneError, match="127 media of dielectrics, of which some have a priority: at most 126 are p"):
        packed(*(Dielectric(ior=1 + k / 100, priority=1) for k in range(127)))


@pytest.mark.parametrize("priority", [1.5, True, 1001, "high"])
def test_a_priority_is_a_whole_number(priority):
    with pytest.raises(SceneError, match=r"priority is .* it must be a whole number from -1000 to 1000"):
        Dielectric(priority=priority)
