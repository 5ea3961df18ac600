"""Textures, environments, alias tables, camera rays: against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from parts import turned
from scipy import stats

from lumipath.kernels.alias import pick_alias
from lumipath.kernels.camera import camera_ray
from lumipath.kernels.environment import environment_from, sample_environment
from lumipath.kernels.sampler import Numbers
from lumipath.kernels.textures import texture_colour
from lumipath.lang import Features, Vec3, i32
from lumipath.pack.alias import alias_table
from lumipath.pack.layout import ENVIRONMENT, LENS
from lumipath.pack.scene import pack_scene, pack_view
from lumipath.scene import Camera, Environment, Material, Scene, Sphere, Texture
from lumipath.settings import RenderSettings

# ---- textures -------------------------------------------------------------------------------------------------------


def _texture(scene, number, u, v):
    c = texture_colour(scene, number, u, v, 0.0)
    return c.x, c.y, c.z


texture = looped(_texture, outputs=3, scene=True)


def textured(*textures):
    materials = [Material(diffuse=t) for t in textures]
    return pack_scene(Scene(shapes=[Sphere(material=m) for m in materials])).scene


def reference(image, u, v, wrap):
    """Bilinear look-up in float64; v counts from the bottom."""
    height, width, _ = image.shape
    u, v = np.asarray(u, float), np.asarray(v, float)
    if wrap == "clamp":
        u, v = np.clip(u, 0, 1), np.clip(v, 0, 1)
    x, y = u * width - 0.5, (1 - v) * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - column)[:, None], (y - row)[:, None]

    def texel(r, c):
        if wrap == "clamp":
            return image[np.clip(r, 0, height - 1), np.clip(c, 0, width - 1)]
        return image[r % height, c % width]

    top = texel(row, column) * (1 - fx) + texel(row, column + 1) * fx
    bottom = texel(row + 1, column) * (1 - fx) + texel(row + 1, column + 1) * fx
    return top * (1 - fy) + bottom * fy


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (4, 1), (3, 7), (16, 16)])
def test_textures_are_interpolated_and_wrapped_like_numpy(shape, wrap):
    rng = np.random.default_rng(1)
    images = [rng.random((*s, 3)).astype(np.float32) for s in ((2, 2), shape)]
    scene = textured(Texture(image=images[0]), Texture(image=images[1], wrap=wrap))
    uv = rng.uniform(-2, 3, (2, 20_000)).astype(np.float32)
    edges = np.float32(np.meshgrid([-1, 0, 1e-8, 0.5, 1 - 2**-24, 1, 2], [-1, 0, 1e-8, 0.5, 1 - 2**-24, 1, 2]))
    u, v = np.concatenate([uv, edges.reshape(2, -1)], axis=1)
    found = texture(scene, np.int32(1), u, v).T
    # Near coordinate 3 float32 places a point to within 2e-7 of the image.
    np.testing.assert_allclose(found, reference(images[1].astype(float), u, v, wrap), atol=5e-6 * max(shape))


def test_a_texel_is_met_exactly_at_its_centre_and_row_0_is_at_the_top():
    image = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    u, v = np.float32([0.125, 0.875, 0.125]), np.float32([0.75, 0.75, 0.25])
    found = texture(textured(Texture(image=image)), np.int32(0), u, v).T
    np.testing.assert_array_equal(found, [image[0, 0], image[0, 3], image[1, 0]])


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
def test_coordinates_of_any_size_give_a_colour_of_the_texture(wrap):
    image = np.random.default_rng(2).uniform(0.2, 0.8, (5, 6, 3)).astype(np.float32)
    coordinate = np.float32([1e5, -1e5, 123456.7, 1e7, -1e7, 1e9, -1e9])
    found = texture(textured(Texture(image=image, wrap=wrap)), np.int32(0), coordinate, coordinate[::-1])
    assert found.min() >= image.min() - 1e-6
    assert found.max() <= image.max() + 1e-6


# ---- alias tables ---------------------------------------------------------------------------------------------------


def _alias(table, count, u):
    pick = pick_alias(table, i32(0), count, u)
    return pick.index, pick.rest


alias = looped(_alias, outputs=2, scene=True)
WEIGHTS = {
    "one": [3.0],
    "equal": [1.0] * 7,
    "unequal": [1, 2, 3, 4, 10, 0.5],
    "with zeros": [0, 5, 0, 0, 1, 0],
    "peaky": [1e-6] * 50 + [1.0] + [1e-6] * 13,
    "all zero": [0.0] * 4,
    "random": np.random.default_rng(3).random(1000) ** 8,
}


def packed_alias(weights):
    threshold, other = alias_table(np.asarray(weights, float))
    return np.ascontiguousarray(np.stack([threshold, other.view(np.float32)], 1)), threshold, other


@pytest.mark.parametrize("name", WEIGHTS)
def test_alias_tables_hold_the_probabilities_of_their_weights(name):
    weights = np.asarray(WEIGHTS[name], float)
    _, threshold, other = packed_alias(weights)
    n = len(weights)
    share = threshold.astype(float) / n + np.bincount(other, (1 - threshold.astype(float)) / n, n)
    expected = weights / weights.sum() if weights.sum() else np.full(n, 1 / n)
    np.testing.assert_allclose(share, expected, atol=2e-7)
    assert ((threshold >= 0) & (threshold <= 1)).all()


@pytest.mark.parametrize("name", WEIGHTS)
def test_drawing_from_an_alias_table_follows_the_weights_and_leaves_a_uniform_number(name):
    weights = np.asarray(WEIGHTS[name], float)
    count = 300_000
    u = ((np.arange(count) + 0.5) / count).astype(np.float32)
    index, rest = alias(packed_alias(weights)[0], np.int32(len(weights)), u)
    expected = weights / weights.sum() if weights.sum() else np.full(len(weights), 1 / len(weights))
    found = np.bincount(index.astype(int), minlength=len(weights)) / count
    # Even numbers make even draws: two roundings an outcome.
    np.testing.assert_allclose(found, expected, atol=(2 + len(weights)) / count)
    assert rest.min() >= 0
    assert rest.max() < 1
    for k in np.flatnonzero(expected > 0.05):
        chosen = rest[index == k]
        histogram = np.histogram(chosen, 8, (0, 1))[0] / len(chosen)
        np.testing.assert_allclose(histogram, 1 / 8, atol=0.01)


def test_numbers_at_the_ends_draw_valid_outcomes():
    for weights in WEIGHTS.values():
        index, rest = alias(packed_alias(weights)[0], np.int32(len(weights)), np.float32([0, 1 - 2**-24]))
        assert ((index >= 0) & (index < len(weights))).all()
        assert np.isfinite(rest).all()


# ---- environment ----------------------------------------------------------------------------------------------------


def _seen(scene, x, y, z):
    s = environment_from(scene, Vec3(x, y, z))
    return s.radiance.x, s.radiance.y, s.radiance.z, s.pdf


def _drawn(scene, a, b):
    s = sample_environment(scene, a, b)
    return s.direction.x, s.direction.y, s.direction.z, s.radiance.x, s.radiance.y, s.radiance.z, s.pdf


seen = looped(_seen, outputs=4, scene=True)
drawn = looped(_drawn, outputs=7, scene=True)


def packed_sky(image, rotation=None):
    environment = Environment(image=image, rotation=np.eye(4) if rotation is None else rotation)
    scene = pack_scene(Scene(shapes=[Sphere()], environment=environment)).scene
    return scene._replace(features=Features(ENVIRONMENT))


def peaky(rows=8):
    image = np.random.default_rng(4).random((rows, 2 * rows, 3)).astype(np.float32) * 0.1
    image[2, 3] = 500
    image[rows - 1, 0] = 50
    image[4:6, 8:] = 0
    return image


def test_no_direction_at_all_stays_inside_the_image():
    # Whoever shades many paths at once computes for paths that nobody will look at, too.
    none = np.float32([np.nan, 0, np.inf, 0])
    assert len(seen(packed_sky(peaky()), none, np.zeros(4, np.float32), none)[0]) == 4


def directions(count, seed=5):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("rotation", [np.eye(4), turned("y", 40) @ turned("x", 70)], ids=["plain", "turned"])
def test_the_environment_is_looked_up_like_numpy(rotation):
    image = peaky()
    d = directions(20_000)
    found = seen(packed_sky(image, rotation), *d.T)[:3].T
    x, y, z = (d.astype(float) @ rotation[:3, :3]).T
    u, v = np.arctan2(x, -z) / (2 * np.pi) + 0.5, np.arccos(np.clip(y, -1, 1)) / np.pi
    expected = reference(
        np.concatenate([image[:1], image, image[-1:]]).astype(float), u, 1 - (v * 8 + 1) / 10, "repeat"
    )
    np.testing.assert_allclose(found, expected, atol=0.1, rtol=5e-3)
    assert np.abs(found - expected).mean() < 1e-3


def test_the_middle_of_the_image_lies_along_minus_z_its_right_quarter_along_x_and_its_top_along_y():
    rows = 64
    image = np.zeros((rows, 2 * rows, 3), np.float32) + 0.01
    image[30:34, 62:66] = (1, 0, 0)
    image[30:34, 94:98] = (0, 1, 0)
    image[:2] = (0, 0, 1)
    axes = np.float32([(0, 0, -1), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    found = seen(packed_sky(image), *axes.T)[:3].T
    np.testing.assert_allclose(found, [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.01, 0.01, 0.01)], atol=1e-3)


@pytest.mark.parametrize("rotation", [np.eye(4), turned("z", 110) @ turned("x", 30)], ids=["plain", "turned"])
def test_drawn_directions_come_with_the_radiance_and_density_that_are_seen_there(rotation):
    scene = packed_sky(peaky(), rotation)
    u = np.random.default_rng(6).random((2, 50_000), np.float32)
    found = drawn(scene, *u)
    np.testing.assert_allclose(np.linalg.norm(found[:3], axis=0), 1, atol=1e-5)
    there = seen(scene, *found[:3])
    # Directions at a border between texels may fall to either side of it.
    same = np.abs(there[3] / found[6] - 1) < 1e-3
    assert same.mean() > 0.998
    np.testing.assert_allclose(there[:3, same], found[3:6, same], rtol=2e-2, atol=2e-2)


def test_the_density_of_the_environment_integrates_to_1_and_covers_all_light():
    scene = packed_sky(peaky())
    n = 1024
    theta = np.pi * (np.arange(n) + 0.5) / n
    phi = np.pi * (np.arange(2 * n) + 0.5) / n
    t, p = np.meshgrid(theta, phi, indexing="ij")
    d = np.stack([np.sin(t) * np.sin(p), np.cos(t), -np.sin(t) * np.cos(p)]).reshape(3, -1)
    *radiance, pdf = seen(scene, *np.float32(d))
    assert (pdf.reshape(n, -1).astype(float) * np.sin(t)).sum() * (np.pi / n) ** 2 == pytest.approx(1, abs=1e-3)
    assert pdf[np.sum(radiance, axis=0) > 0].min() > 0


def test_directions_are_drawn_with_their_density():
    image = peaky(8)
    scene = packed_sky(image)
    u = np.random.default_rng(7).random((2, 400_000), np.float32)
    found = drawn(scene, *u).astype(float)
    column = np.floor((np.arctan2(found[0], -found[2]) / (2 * np.pi) + 0.5) * 16).astype(int) % 16
    row = np.minimum(np.floor(np.arccos(np.clip(found[1], -1, 1)) / np.pi * 8).astype(int), 7)
    counts = np.bincount(row * 16 + column, minlength=128)
    # By the densities that directions in the middles of the texels are said to have.
    theta, phi = np.pi * (np.arange(8) + 0.5) / 8, 2 * np.pi * (np.arange(16) + 0.5) / 16 - np.pi
    t, p = np.meshgrid(theta, phi, indexing="ij")
    d = np.stack([np.sin(t) * np.sin(p), np.cos(t), -np.sin(t) * np.cos(p)]).reshape(3, -1)
    expected = seen(scene, *np.float32(d))[3] * np.sin(t).ravel() * (np.pi / 8) ** 2
    assert expected.sum() == pytest.approx(1, abs=1e-4)
    assert stats.chisquare(counts, expected / expected.sum() * counts.sum()).pvalue > 1e-4


def test_an_estimate_of_the_light_of_the_whole_environment_is_right_and_has_little_noise():
    scene = packed_sky(peaky(8))
    u = np.random.default_rng(8).random((2, 100_000), np.float32)
    found = drawn(scene, *u).astype(float)
    estimate = found[3] / found[6]
    n = 512
    t, p = np.meshgrid(np.pi * (np.arange(n) + 0.5) / n, np.pi * (np.arange(2 * n) + 0.5) / n, indexing="ij")
    d = np.stack([np.sin(t) * np.sin(p), np.cos(t), -np.sin(t) * np.cos(p)]).reshape(3, -1)
    exact = (seen(scene, *np.float32(d))[0].reshape(t.shape) * np.sin(t)).sum() * (np.pi / n) ** 2
    error = estimate.std() / np.sqrt(len(estimate))
    assert abs(estimate.mean() - exact) < 4.5 * error + 1e-4 * exact
    assert estimate.std() < 2 * exact


# ---- camera ---------------------------------------------------------------------------------------------------------


def _ray(pair, column, row, a, b, c, d):
    scene, view = pair
    r = camera_ray(scene, view, column, row, Numbers(c, d, a, b))
    return r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.tmax


rays = looped(_ray, outputs=7, scene=True)
TILTED = Camera(position=(1, 2, 3), direction=(-1, -2, 0.5), up=(0.1, 1, 0.2), fov=65, aspect=1.5)


def camera_rays(camera, mask=0, width=30, **settings):
    rng = np.random.default_rng(9)
    view = pack_view(camera, RenderSettings(width=width, **settings))
    column, row = (rng.integers(0, n, 5000).astype(np.int32) for n in (view.width, view.height))
    numbers = rng.random((4, 5000), np.float32)
    scene = pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(mask))
    found = rays((scene, view), column, row, *numbers).astype(float)
    right, up, backward = camera.axes()
    half = np.tan(np.radians(camera.fov) / 2)
    x = ((column + numbers[0]) / view.width * 2 - 1) * half * view.width / view.height
    y = (1 - (row + numbers[1]) / view.height * 2) * half
    plane = x[:, None] * right + y[:, None] * up - backward
    return found, plane, numbers


@pytest.mark.parametrize("camera", [Camera(), TILTED], ids=["default", "tilted"])
def test_pinhole_rays_go_through_their_pixels(camera):
    found, plane, _ = camera_rays(camera)
    np.testing.assert_allclose(found[:3].T, np.tile(camera.position, (5000, 1)), atol=1e-6)
    np.testing.assert_allclose(found[3:6].T, plane / np.linalg.norm(plane, axis=1, keepdims=True), atol=1e-6)
    assert np.isinf(found[6]).all()


def test_lens_rays_start_on_the_lens_and_meet_the_pinhole_rays_on_the_plane_in_focus():
    found, plane, numbers = camera_rays(TILTED, LENS, aperture=0.25, focus=3.0)
    o, d = found[:3].T, found[3:6].T
    right, up, backward = TILTED.axes()
    offset = o - TILTED.position
    np.testing.assert_allclose(offset @ backward, 0, atol=1e-6)
    radius = np.linalg.norm(offset, axis=1)
    np.testing.assert_allclose(radius, 0.25 * np.sqrt(numbers[2]), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)
    met = o + d * (3.0 / -(d @ backward))[:, None]
    np.testing.assert_allclose(met, TILTED.position + plane * 3.0, atol=1e-5)
    # The whole disc is used, evenly.
    angle = np.arctan2(offset @ up, offset @ right)
    cells = np.histogram2d((radius / 0.25) ** 2, angle, (5, 8), ((0, 1.0001), (-np.pi, np.pi)))[0]
    assert stats.chisquare(cells.ravel()).pvalue > 1e-4


def test_the_first_pixel_is_at_the_top_left():
    view = pack_view(Camera(), RenderSettings(width=10))
    scene = pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(0))
    d = rays((scene, view), np.int32([0, 9]), np.int32([0, 9]), *np.float32([[0.5, 0.5]] * 4))[3:6]
    assert d[0, 0] < 0 < d[1, 0]
    assert d[0, 1] > 0 > d[1, 1]
    np.testing.assert_allclose(d[:, 0] / d[2, 0], [0.45, -0.45, 1], atol=1e-6)
