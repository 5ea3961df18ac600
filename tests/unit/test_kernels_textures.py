"""Look-up of textures of all kinds, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped

from lumipath.kernels.textures import texture_colour
from lumipath.pack.scene import pack_scene
from lumipath.pack.textures import mipmaps
from lumipath.scene import Checker, Diffuse, Scene, Sphere, Texture
from lumipath.scene.textures import srgb_curve

RNG = np.random.default_rng(4)
BYTES = RNG.integers(0, 256, (5, 7, 4), np.uint8)
FLOATS = RNG.random((6, 4, 3)).astype(np.float32)


def _look_up(scene, number, u, v, footprint):
    c = texture_colour(scene, number, u, v, footprint)
    return c.x, c.y, c.z


_looked_up = looped(_look_up, outputs=3, scene=True)


def looked_up(texture, u, v, footprint=0.0):
    """(N, 3): what the kernel finds; another texture lies before this one."""
    shapes = [Sphere(material=Diffuse(reflectance=t)) for t in (Texture(np.ones((3, 2, 3))), texture)]
    scene = pack_scene(Scene(shapes=shapes)).scene
    return _looked_up(scene, np.int32(1), np.float32(u), np.float32(v), np.float32(footprint)).T


def linear(image):
    """(H, W, 4) float64 of sRGB numbers with alpha."""
    return np.concatenate([srgb_curve()[image[:, :, :3]], image[:, :, 3:] / 255], axis=2).astype(np.float64)


def folded(i, size, wrap):
    """Texel numbers by the definitions of the wrap modes."""
    if wrap == "repeat":
        return i % size
    if wrap == "clamp":
        return np.clip(i, 0, size - 1)
    i = i % (2 * size)
    return np.where(i < size, i, 2 * size - 1 - i)


def reference(image, u, v, wrap, nearest=False):
    """(N, C): look-up in float64, v upwards."""
    height, width, _ = image.shape
    x, y = np.asarray(u, float) * width, (1 - np.asarray(v, float)) * height
    if nearest:
        return image[folded(np.floor(y).astype(int), height, wrap[1]), folded(np.floor(x).astype(int), width, wrap[0])]
    x, y = x - 0.5, y - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    total = 0
    for k in range(2):
        for j in range(2):
            weight = abs(1 - j - (x - column)) * abs(1 - k - (y - row))
            texel = image[folded(row + k, height, wrap[1]), folded(column + j, width, wrap[0])]
            total = total + weight[:, None] * texel
    return total


UV = RNG.uniform(-2.9, 2.9, (2, 4000)).astype(np.float32)


@pytest.mark.parametrize("across", ["repeat", "mirror", "clamp"])
@pytest.mark.parametrize("upward", ["repeat", "mirror", "clamp"])
def test_each_axis_wraps_in_its_own_way(across, upward):
    wrap = (across, upward)
    np.testing.assert_allclose(looked_up(Texture(FLOATS, wrap), *UV), reference(FLOATS, *UV, wrap), atol=1e-5)
    want = reference(linear(BYTES), *UV, wrap)[:, :3]
    np.testing.assert_allclose(looked_up(Texture(BYTES, wrap), *UV), want, atol=1e-5)


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_the_nearest_texel_is_shown_as_it_is(wrap):
    wraps = (wrap, wrap)
    # Points at a border between texels may fall to either side of it.
    near = np.abs(UV * np.array([[4], [6]]) - np.rint(UV * np.array([[4], [6]]))).min(axis=0) < 1e-4
    found = looked_up(Texture(FLOATS, wrap, filter="nearest"), *UV)
    want = reference(FLOATS, *UV, wraps, nearest=True)
    np.testing.assert_array_equal(found[~near], want[~near])


def test_bytes_are_decoded_exactly():
    u, v = np.meshgrid((np.arange(7) + 0.5) / 7, 1 - (np.arange(5) + 0.5) / 5)
    for srgb in (True, False):
        found = looked_up(Texture(BYTES, srgb=srgb, filter="nearest"), u.ravel(), v.ravel())
        want = linear(BYTES) if srgb else BYTES / 255
        np.testing.assert_allclose(found, want.reshape(-1, 4)[:, :3], rtol=3e-7)


@pytest.mark.parametrize("channel", list("rgba"))
def test_a_channel_is_three_times_its_value(channel):
    found = looked_up(Texture(BYTES).view(channel, 0.5), *UV)
    want = 0.5 * reference(linear(BYTES), *UV, ("repeat",) * 2)[:, "rgba".index(channel)]
    np.testing.assert_allclose(found, np.repeat(want[:, None], 3, axis=1), atol=1e-5)


def test_factor_and_transform():
    texture = Texture(FLOATS, factor=(1, 2, 0.5), offset=(0.3, -0.2), rotation=30, scale=(1.5, 0.75))
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    a, b = 1.5 * UV[0].astype(float), 0.75 * UV[1].astype(float)
    want = reference(FLOATS, c * a - s * b + 0.3, s * a + c * b - 0.2, ("repeat",) * 2) * (1, 2, 0.5)
    np.testing.assert_allclose(looked_up(texture, *UV), want, atol=2e-5)


@pytest.mark.parametrize("image", [BYTES, FLOATS, np.repeat(FLOATS, 8, axis=0)], ids=["bytes", "floats", "tall"])
def test_a_wide_footprint_sees_a_coarser_step(image):
    in_bytes = image.dtype == np.uint8
    steps = mipmaps(image, True)
    size = np.sqrt(image.shape[0] * image.shape[1])
    for k, step in enumerate(steps):
        # As many texels wide as a texel of the step, and somewhat more.
        footprint = 1.4 * 2**k / size
        values = linear(step) if in_bytes else step.astype(float)
        want = reference(values, *UV, ("repeat",) * 2)[:, :3]
        np.testing.assert_allclose(looked_up(Texture(image), *UV, footprint), want, atol=2e-5)
    last = looked_up(Texture(image), *UV, 1e9)
    np.testing.assert_allclose(
        last, np.broadcast_to((linear(step) if in_bytes else step)[0, 0, :3], last.shape), rtol=1e-5
    )
    sharp = looked_up(Texture(image, mipmaps=False), *UV, 1e9)
    np.testing.assert_allclose(sharp, looked_up(Texture(image), *UV), atol=1e-6)


def test_chequers_have_sharp_edges_and_the_first_colour_at_the_origin():
    first, second = (0.9, 0.1, 0.2), (0.1, 0.5, 0.8)
    u, v = RNG.uniform(-3, 3, (2, 4000)).astype(np.float32)
    odd = (np.floor(u * 6) + np.floor(v * 6)) % 2 == 1
    near = np.minimum(abs(u * 6 - np.rint(u * 6)), abs(v * 6 - np.rint(v * 6))) < 1e-4
    found = looked_up(Checker(first, second, 6), u, v)
    np.testing.assert_allclose(found[~near], np.where(odd[:, None], second, first)[~near], rtol=1e-6)


@pytest.mark.parametrize("width", [0.01, 0.1, 0.4, 1.7])
def test_chequers_are_filtered_exactly(width):
    u, v = RNG.uniform(-1, 1, (2, 40)).astype(np.float32)
    grid = (np.arange(800) + 0.5) / 800 - 0.5
    x, y = (c[:, None].astype(float) + width * grid for c in (u, v))
    signs = [1 - 2 * (np.floor(c * 4) % 2) for c in (x, y)]
    share = 0.5 + 0.5 * signs[0].mean(1) * signs[1].mean(1)
    # Footprints come with a random factor from 1 to 2, so a box is two thirds of them.
    found = looked_up(Checker(1.0, 0.0, 4), u, v, 1.5 * width)[:, 0]
    np.testing.assert_allclose(found, share, atol=4e-3)
