"""Textures as values: what is checked, shared and packed."""

from __future__ import annotations

import numpy as np
import pytest

from lumipath.errors import SceneError
from lumipath.formats.images import read_texture
from lumipath.lang import features_of
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene
from lumipath.pack.textures import mipmaps
from lumipath.rendering.image import Image
from lumipath.scene import Box, Checker, Conductor, Dielectric, Diffuse, Material, Mesh, Mix, Scene, Sphere, Texture
from lumipath.scene.textures import srgb_curve

RNG = np.random.default_rng(1)
BYTES = RNG.integers(0, 256, (6, 5, 4), np.uint8)


def packed(*materials, **options):
    return pack_scene(Scene(shapes=[Sphere(material=material) for material in materials], **options)).scene


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Texture(np.ones((2, 2, 3)), wrap="round"), "wrap 'round' is not one of repeat, mirror, clamp"),
        (lambda: Texture(np.ones((2, 2, 3)), wrap=("clamp", "clamp", "clamp")), "or a pair of them"),
        (lambda: Texture(np.ones((2, 2, 3)), filter="cubic"), "filter 'cubic' is not one of bilinear, nearest"),
        (lambda: Texture(np.ones((2, 2, 3)), channel="x"), "channel 'x' is not one of r, g, b, a"),
        (lambda: Texture(np.ones((2, 2, 3))).view("a"), "it has no alpha"),
        (lambda: Texture(np.ones((2, 2, 5))), "must have the shape N x N x 3, not 2 x 2 x 5"),
        (lambda: Texture(np.ones((2, 2, 5), np.uint8)), "must have the shape N x N x 3 or N x N x 4, not 2 x 2 x 5"),
        (lambda: Texture(np.ones((0, 2, 3), np.uint8)), "has no pixels"),
        (lambda: Texture(np.full((2, 2, 3), np.nan)), "must be finite"),
        (lambda: Texture(np.ones((2, 2, 3)), scale=(1, 0)), "neither part may be 0"),
        (lambda: Texture(np.ones((2, 2, 3)), offset=(np.inf, 0)), "must be finite"),
        (lambda: Texture(np.ones((2, 2, 3)), factor=-1), "must be from 0"),
        (lambda: Checker(squares=0), "squares is 0: it must be a number above 0"),
        (lambda: Diffuse(opacity=1.5), "opacity is 1.5: it must be a number from 0 to 1"),
        (lambda: Diffuse(alpha_cutoff=-1), "alpha_cutoff is -1"),
        (lambda: Diffuse(normal_map=3), "normal_map is 3: it must be a Texture"),
        (lambda: Diffuse(normal_map=Texture(BYTES)), "give its Texture srgb=False"),
        (lambda: Diffuse(two_sided=1), "two_sided is 1: it must be True or False"),
        (lambda: Mix(first=Material(), second=Diffuse()), "first is a Material"),
        (lambda: Mix(first=Diffuse(emission=1), second=Diffuse()), "first emits; give the emission to the mix"),
        (lambda: Mix(first=Diffuse(), second=Diffuse(opacity=0.5)), "second has an opacity"),
        (lambda: Mix(first=Diffuse(), second=Diffuse(two_sided=False)), "second is one-sided"),
        (lambda: Mix(first=Diffuse(), second=Diffuse(), bump_map=Checker()), "normals are those of its parts"),
        (lambda: nested(9), "mixes lie 9 deep in each other; 8 are possible"),
        (
            lambda: Mesh(vertices=np.eye(3), faces=[(0, 1, 2)], colours=np.full((3, 4), 1.5)),
            "colours must be from 0 to 1",
        ),
    ],
)
def test_what_is_wrong_is_named(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def nested(depth):
    mix = Diffuse()
    for _ in range(depth):
        mix = Mix(first=mix, second=Diffuse())
    return mix


def test_views_share_the_image_which_nobody_can_change():
    given = np.ones((2, 2, 4), np.float32)
    texture = Texture(given)
    given[:] = 7
    view = texture.view("g", 0.5)
    assert view.image is texture.image
    assert view.mean() == (0.5, 0.5, 0.5)
    with pytest.raises(ValueError, match="read-only"):
        texture.image[0, 0] = 3


def test_the_mean_of_an_image_of_8_bits_is_that_of_its_linear_values():
    linear = srgb_curve()[BYTES[:, :, :3]].mean((0, 1), dtype=np.float64)
    assert Texture(BYTES).mean() == pytest.approx(linear)
    assert Texture(BYTES, srgb=False, factor=(1, 2, 3)).mean() == pytest.approx(
        BYTES[:, :, :3].mean((0, 1)) / 255 * (1, 2, 3)
    )
    assert Texture(BYTES).view("a").mean()[0] == pytest.approx(BYTES[:, :, 3].mean() / 255)


def test_images_of_8_bits_take_4_bytes_a_texel_and_a_third_more_for_coarser_steps():
    scene = packed(Diffuse(reflectance=Texture(np.zeros((64, 64, 3), np.uint8))))
    assert scene.texel_words.nbytes == 4 * sum(4**k for k in range(7))
    # Both curves.
    assert scene.texels.size == 512
    single = packed(Diffuse(reflectance=Texture(np.zeros((64, 64, 3), np.uint8), mipmaps=False)))
    assert single.texel_words.size == 64 * 64


def test_equal_images_and_views_are_stored_once():
    texture = Texture(BYTES)
    metal = Conductor(reflectance=texture, roughness=texture.view("g"), opacity=texture.view("a"))
    scene = packed(metal, Diffuse(reflectance=Texture(BYTES.copy())), Diffuse(reflectance=Texture(BYTES, srgb=False)))
    firsts = scene.textures.view(np.int32)[:, 0]
    assert len(firsts) == 5
    # As sRGB and as linear numbers, since their coarser steps differ.
    assert len(set(firsts.tolist())) == 2


@pytest.mark.parametrize("shape", [(1, 1), (8, 8), (7, 5), (1, 6), (9, 2)])
def test_coarser_steps_keep_the_mean(shape):
    image = RNG.random((*shape, 3)).astype(np.float32)
    steps = mipmaps(image, False)
    assert [step.shape[:2] for step in steps] == [
        (max(shape[0] >> k, 1), max(shape[1] >> k, 1)) for k in range(int(np.log2(max(shape))) + 1)
    ]
    for step in steps:
        np.testing.assert_allclose(step.mean((0, 1)), image.mean((0, 1)), rtol=1e-5)


def test_coarser_steps_of_srgb_numbers_are_means_of_linear_values():
    image = np.zeros((2, 2, 4), np.uint8)
    image[0] = 255
    # The sRGB number of one half.
    assert mipmaps(image, True)[1].tolist() == [[[188, 188, 188, 128]]]
    assert mipmaps(image, False)[1].tolist() == [[[128] * 4]]


def mask_of(material, **options):
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    mesh = Mesh(vertices=corners, faces=[(0, 1, 2)], material=material, **options)
    return features_of(pack_scene(Scene(shapes=[mesh])).scene)


DATA = Texture(BYTES, srgb=False)
METAL = layout.CONDUCTORS | layout.MIRRORS


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Diffuse(), 0),
        (Diffuse(opacity=1.0, alpha_cutoff=0.5), 0),
        (Diffuse(opacity=0.5), layout.OPACITY),
        (Diffuse(opacity=DATA.view("a")), layout.OPACITY | layout.TEXTURES),
        (Diffuse(normal_map=DATA), layout.NORMAL_MAPS | layout.TEXTURES),
        (Diffuse(bump_map=DATA), layout.NORMAL_MAPS | layout.TEXTURES),
        (Diffuse(two_sided=False), layout.CULLING),
        (Diffuse(reflectance=DATA), layout.TEXTURES | layout.TEXTURED_LOBES),
        (Diffuse(emission=DATA), layout.TEXTURES | layout.TEXTURED_EMISSION | layout.TRIANGLE_LIGHTS),
        # Lobes that stand for a metal are not what paths scatter at.
        (Conductor(reflectance=DATA), METAL | layout.TEXTURES),
        (Conductor(edge_tint=DATA), METAL | layout.TEXTURES | layout.TEXTURED_TINTS),
        (Conductor(roughness=DATA), METAL | layout.TEXTURES | layout.TEXTURED_NUMBERS),
        (Conductor(metal="gold"), METAL | layout.MEASURED_METALS),
        (Dielectric(roughness=0.1), layout.ROUGH_DIELECTRICS | layout.DIELECTRICS),
        (Dielectric(), layout.DIELECTRICS | layout.LOBE_GLASS),
        (Mix(first=Diffuse(), second=Diffuse(roughness=1.0)), layout.MIXES | layout.ROUGH_DIFFUSE),
        (Mix(first=Diffuse(), second=Diffuse(), emission=1.0), layout.MIXES | layout.TRIANGLE_LIGHTS),
    ],
    ids=str,
)
def test_a_scene_has_the_features_that_its_surfaces_need(material, expected):
    assert mask_of(material) == expected


def test_vertex_colours_are_a_feature_and_their_alpha_another():
    assert mask_of(Diffuse(), colours=np.ones((3, 3))) == layout.VERTEX_COLOURS
    assert mask_of(Diffuse(), colours=np.ones((3, 4))) == layout.VERTEX_COLOURS
    assert mask_of(Diffuse(), colours=np.eye(3, 4)) == layout.VERTEX_COLOURS | layout.OPACITY


def test_only_primitives_that_let_rays_through_are_marked():
    scene = Scene(shapes=[Box(material=Diffuse()), Sphere(material=Diffuse(opacity=0.5)), Sphere()])
    words = pack_scene(scene).scene.primitives.view(np.int32)[:, 3]
    assert ((words & layout.HAS_HOLES) != 0).tolist() == [False] * 12 + [True, False]
    assert (words & layout.MATERIAL_MASK).tolist() == [0] * 12 + [1, 2]


def test_parts_of_mixes_come_behind_all_other_materials():
    inner = Mix(first=Diffuse(name="a"), second=Diffuse(name="b"), name="inner")
    shapes = [Sphere(material=Mix(first=inner, second=Diffuse(name="c"), name="outer")), Sphere(material=Diffuse())]
    made = pack_scene(Scene(shapes=shapes))
    assert made.material_names == ("outer", "", "inner", "c", "a", "b")
    assert made.scene.maps.view(np.int32)[[0, 2], 9:11].tolist() == [[2, 3], [4, 5]]


def test_a_gltf_transform_lies_the_same_way_round():
    # As an engine computes it, with v downwards: scaled, turned counter-clockwise as seen on the image, moved.
    offset, angle, scale = (0.1, 0.3), 0.7, (2.0, 0.5)
    u, v = RNG.random((2, 50))
    a, b = scale[0] * u, scale[1] * (1 - v)
    c, s = np.cos(angle), np.sin(angle)
    want_u, want_v = c * a + s * b + offset[0], 1 - (-s * a + c * b + offset[1])
    matrix = Texture(BYTES).with_gltf_transform(offset, angle, scale).matrix()
    np.testing.assert_allclose(matrix @ [u, v, np.ones(50)], [want_u, want_v], atol=1e-12)


def test_files_of_8_bits_stay_so_and_alpha_comes_where_it_is_asked_for(tmp_path):
    Image(np.full((2, 3, 3), 0.5)).save(tmp_path / "a.png")
    texture = read_texture(tmp_path / "a.png", wrap="mirror")
    assert texture.image.dtype == np.uint8
    assert texture.image.shape == (2, 3, 3)
    assert texture.wrap == ("mirror", "mirror")
    assert texture.mean() == pytest.approx((0.5,) * 3, abs=0.005)
    data = read_texture(tmp_path / "a.png", srgb=False, alpha=True)
    assert data.image[0, 0].tolist() == [188, 188, 188, 255]
    Image(np.full((2, 3, 3), 2.5)).save(tmp_path / "a.exr")
    assert read_texture(tmp_path / "a.exr", alpha=True).image[0, 0].tolist() == [2.5, 2.5, 2.5, 1]
