"""Textures far away: quiet at one sample a pixel, and as they are with many."""

from __future__ import annotations

import numpy as np
import pytest
from judging import assert_same
from parts import floor, sky
from renders import renders

from lumipath.lang import Features, features_of
from lumipath.pack.layout import TEXTURED_EMISSION
from lumipath.scene import Camera, Checker, Diffuse, Scene, Texture

SIZE = {"width": 48, "height": 32, "max_depth": 1}


def chequers(tiles, **options):
    """An image of chequers, two texels a field."""
    odd = np.add.outer(np.arange(tiles), np.arange(tiles)) % 2 == 1
    image = np.where(odd, 0.9, 0.1).astype(np.float32).repeat(2, axis=0).repeat(2, axis=1)
    return Texture(image, **options)


TEXTURES = {
    "image": lambda filtered: chequers(64, scale=(4, 4), mipmaps=filtered),
    "bytes": lambda filtered: Texture(
        (chequers(64).image * 255).astype(np.uint8), srgb=False, scale=(4, 4), mipmaps=filtered
    ),
    "checker": lambda filtered: Checker(0.9, 0.1, 256.0) if filtered else chequers(64, scale=(4, 4), mipmaps=False),
}


def plain(texture, height=1.5):
    """A plain of 256 x 256 fields, a metre each, towards the horizon, under a white sky: seen as bright as it is."""
    shape = floor(128.0, uv=True, material=Diffuse(reflectance=texture))
    camera = Camera.look_at((3.3, height, 60.0), (0.0, 0.0, 20.0), fov=50)
    return Scene(shapes=[shape], environment=sky(), cameras=[camera])


def without_noise_of_light(packed):
    """The plain as if it shone by itself: what a sample shows is the texture alone."""
    materials = packed.materials.copy()
    # The albedo becomes the emission, and nothing is left to scatter.
    materials[:, 4:8] = materials[:, 0:4]
    materials[:, 0:3] = 0
    materials.view(np.int32)[:, 3] = -1
    mask = features_of(packed) | TEXTURED_EMISSION
    return packed._replace(materials=materials, features=Features(mask))


@pytest.mark.parametrize("kind", TEXTURES)
def test_distant_textures_are_quiet_at_one_sample_a_pixel(device, kind):
    settings = SIZE | {"max_depth": 0, "device": device, "change": without_noise_of_light}
    truth = renders(plain(TEXTURES[kind](False)), spp=4096, seeds=1, **settings)[0]
    # Rows below the horizon, where fields are smaller than pixels.
    rows = slice(15, 20)
    error, flicker = {}, {}
    for filtered in (True, False):
        images = renders(plain(TEXTURES[kind](filtered)), spp=1, seeds=8, **settings)
        error[filtered] = np.sqrt(((images - truth)[:, rows] ** 2).mean())
        flicker[filtered] = images[:, rows].std(axis=0).mean()
    assert error[True] < 0.25 * error[False]
    assert flicker[True] < 0.05 * flicker[False]


@pytest.mark.parametrize("kind", TEXTURES)
def test_textures_near_the_camera_are_as_they_are(device, kind):
    settings = SIZE | {"max_depth": 0, "device": device, "change": without_noise_of_light}
    scenes = [plain(TEXTURES[kind](filtered)) for filtered in (True, False)]
    for scene in scenes:
        # Straight down: a pixel covers an eighth of a texel.
        scene.cameras[:] = [Camera.look_at((3.3, 2.0, 60.2), (3.3, 0.0, 60.2), up=(0.1, 0, -1), fov=50)]
    filtered, sharp = (renders(scene, spp=16, seeds=8, **settings) for scene in scenes)
    if kind == "checker":
        # Edges of an image are interpolated, those of chequers are not.
        assert filtered.mean() == pytest.approx(sharp.mean(), rel=0.02)
    else:
        assert_same(filtered, sharp)


def test_many_samples_make_a_distant_texture_sharp(device):
    settings = SIZE | {"max_depth": 0, "device": device, "change": without_noise_of_light}
    truth, few, many = (
        renders(plain(TEXTURES["image"](filtered)), spp=spp, seeds=4, **settings).mean(axis=0)
        for filtered, spp in ((False, 4096), (True, 1), (True, 4096))
    )
    # Fields of about a pixel.
    rows = slice(18, 30)
    blur = [np.sqrt(((image - truth)[rows] ** 2).mean()) for image in (few, many)]
    assert blur[1] < 0.15 * blur[0]
