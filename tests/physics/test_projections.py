"""Renders by cameras of every projection, against what they must show."""

from __future__ import annotations

import numpy as np
import pytest
from judging import assert_same
from parts import hidden, moved, quad, scaled, sphere_mesh
from renders import renders

from lumipath.errors import UsageError
from lumipath.rendering.session import Session, render
from lumipath.scene import AmbientLight, Camera, Environment, Material, Scene, Sphere

FISHEYES = ("fisheye", "fisheye-equisolid")


def interpolated(image, column, row):
    """The radiance of an environment image at columns and rows in texels, between texel centres."""
    height, width, _ = image.shape
    x, y = np.asarray(column) - 0.5, np.asarray(row) - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - i)[..., None], (y - j)[..., None]
    rows = [np.clip(j + k, 0, height - 1) for k in (0, 1)]
    top, bottom = ((1 - fx) * image[r, i % width] + fx * image[r, (i + 1) % width] for r in rows)
    return (1 - fy) * top + fy * bottom


def sky(rows=8):
    return Environment(image=np.random.default_rng(4).uniform(0.2, 1.0, (rows, 2 * rows, 3)).astype(np.float32))


def under(environment, camera):
    """A scene of nothing but a sky; what else is in it is far below and small."""
    return Scene(shapes=hidden("quadric"), environment=environment, cameras=[camera])


def test_a_panorama_of_an_environment_is_its_image(device):
    environment = sky()
    scene = under(environment, Camera(projection="panorama"))
    # Four pixels a texel: radiance is linear within a pixel, so its mean is that of its middle.
    images = renders(scene, width=64, spp=16, seeds=8, max_depth=0, device=device)
    assert images.shape[1:3] == (32, 64)
    column, row = np.meshgrid((np.arange(64) + 0.5) / 4, (np.arange(32) + 0.5) / 4)
    assert_same(images, interpolated(environment.image.astype(float), column, row), block=2)


def test_a_part_of_a_panorama_is_that_part_of_the_whole(device):
    scene = under(sky(), Camera(projection="panorama"))
    part = under(scene.environment, Camera(projection="panorama", longitude=(-90, 45), latitude=(-45, 22.5)))
    settings = {"spp": 64, "seeds": 6, "max_depth": 0, "device": device}
    whole = renders(scene, width=64, crop=(16, 12, 40, 24), **settings)
    alone = renders(part, width=24, first_seed=100, **settings)
    assert_same(whole, alone, block=2)


@pytest.mark.parametrize("projection", FISHEYES)
def test_a_fisheye_shows_the_sky_in_a_circle_on_black(device, projection):
    environment = sky()
    camera = Camera(projection=projection, fisheye_fov=240, direction=(0, 1, 0), up=(0, 0, 1))
    images = renders(under(environment, camera), width=40, spp=64, seeds=8, max_depth=0, device=device)
    # The mean of what is seen at 16 x 16 points of each pixel.
    s = (np.arange(640) + 0.5) / 320 - 1
    x, y = np.meshgrid(s, -s)
    r, edge = np.hypot(x, y), np.radians(120)
    angle = edge * r if projection == "fisheye" else 2 * np.arcsin(np.minimum(r, 1) * np.sin(edge / 2))
    # Upwards is +z and ahead +y, so that the right is +x.
    d = np.stack([x / r * np.sin(angle), np.cos(angle), y / r * np.sin(angle)])
    column, row = np.arctan2(d[0], -d[2]) / (2 * np.pi) + 0.5, np.arccos(d[1]) / np.pi
    seen = interpolated(environment.image.astype(float), column * 16, row * 8) * (r < 1)[..., None]
    assert_same(images, seen.reshape(40, 16, 40, 16, 3).mean(axis=(1, 3)))
    assert not images[:, 0, 0].any()
    assert not images[:, 39, 39].any()
    assert images[:, 20, 0].min() > 0


BARS = [
    # The same extent across at two depths, one above the other; and a square at an angle behind the camera.
    quad((-0.55, 0.1, -2), (0.3, 0.1, -2), (0.3, 0.9, -2), (-0.55, 0.9, -2), material=Material(emission=1.0)),
    quad((-0.55, -0.9, -8), (0.3, -0.9, -8), (0.3, -0.1, -8), (-0.55, -0.1, -8), material=Material(emission=1.0)),
    quad((-9, -9, 1), (9, -9, 1), (9, 9, 1), (-9, 9, 1), material=Material(emission=5.0)),
]


def test_an_orthographic_camera_shows_all_depths_in_one_size(device):
    camera = Camera(projection="orthographic", height=2.0)
    images = renders(Scene(shapes=BARS, cameras=[camera]), width=40, spp=64, seeds=6, max_depth=0, device=device)

    def covered(low, high):
        edges = np.linspace(-1, 1, 41)
        return np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0, None) / 0.05

    # Rows count from the top.
    rows = covered(0.1, 0.9)[::-1] + covered(-0.9, -0.1)[::-1]
    assert_same(images, np.outer(rows, covered(-0.55, 0.3))[..., None] * np.ones(3), block=2)


def test_an_orthographic_lens_blurs_alike_everywhere(device):
    # A small lamp out of focus, in the middle and at the edge of the image: discs of one size, all of it white inside.
    spread = []
    for x in (0.0, 1.2):
        size = 0.05
        corners = [(x - size, -size, -6), (x + size, -size, -6), (x + size, size, -6), (x - size, size, -6)]
        lamp = quad(*corners, material=Material(emission=100.0), two_sided=False)
        camera = Camera(projection="orthographic", height=4.0, aperture=0.4, focus=3.0)
        image = renders(Scene(shapes=[lamp], cameras=[camera]), width=64, spp=1024, seeds=3, device=device, max_depth=0)
        image = image.mean(axis=(0, 3))
        s = ((np.arange(64) + 0.5) / 64 - 0.5) * 4
        across, up = np.meshgrid(s, -s)
        total = image.sum()
        assert total * (4 / 64) ** 2 == pytest.approx(100 * (2 * size) ** 2, rel=0.05)
        assert (image * across).sum() / total == pytest.approx(x, abs=0.01)
        spread.append((image * ((across - x) ** 2 + up**2)).sum() / total)
    # The cone through a point in focus at 3 has the lens's radius again at 6.
    np.testing.assert_allclose(spread, 0.4**2 / 2 + 2 * (4 / 64) ** 2 / 12 + 2 * (2 * size) ** 2 / 12, rtol=0.04)


INSIDE = [Sphere(transform=scaled(3.0), material=Material(diffuse=(0.2, 0.5, 0.8)))]


@pytest.mark.parametrize("projection", ["panorama", "fisheye"])
def test_depth_in_all_directions_is_the_distance(device, projection):
    scene = Scene(shapes=INSIDE, cameras=[Camera(projection=projection, fisheye_fov=200)])
    aov = ("depth", "object_id", "albedo")
    image = render(scene, width=24, spp=16, device=device, integrator="depth", aov=aov)
    seen = image["object_id"][..., 0] == 0
    assert seen.all() if projection == "panorama" else 0.7 < seen.mean() < 0.85
    np.testing.assert_allclose(image["depth"][seen], 3.0, rtol=1e-5)
    # Beyond the circle nothing is hit.
    corner = 0 if projection == "panorama" else -1
    assert image["object_id"][0, 0, 0] == corner
    assert image["depth"][0, 0, 0] == pytest.approx(3.0 * (corner + 1), rel=1e-5)
    np.testing.assert_allclose(image["albedo"][0, 0], (corner + 1) * np.array([0.2, 0.5, 0.8]), rtol=1e-5)
    assert image.pixels[0, 0, 0] == pytest.approx(3.0 * (corner + 1), rel=1e-5)


def test_whitted_ray_tracing_has_black_corners_too(device):
    scene = under(sky(), Camera(projection="fisheye"))
    scene.lights.append(AmbientLight(colour=1e-9))
    image = render(scene, width=24, spp=16, device=device, integrator="whitted").pixels
    assert not image[0, 0].any()
    assert image[12, 12].min() > 0.1


FOCUSED = [
    Sphere(transform=moved(0.5, 0.2, -5.0), material=Material(diffuse=0.5)),
    sphere_mesh(4, transform=scaled(9.0)),
]


@pytest.mark.parametrize("projection", ["orthographic", "panorama", "fisheye"])
def test_a_pixel_is_brought_into_focus(device, projection):
    camera = Camera(projection=projection, height=4.0, aperture=0.1)
    settings = {"width": 40, "height": 40, "integrator": "depth"}
    session = Session(Scene(shapes=FOCUSED, cameras=[camera]), focus_on=(21, 19), device=device, **settings)
    # The pixel's middle is 1.5 pixels right of the image's middle, and half a pixel above.
    if projection == "orthographic":
        x, y = 1.5 * 0.1, 0.5 * 0.1
        expected = 5 - np.sqrt(1 - (x - 0.5) ** 2 - (y - 0.2) ** 2)
    else:
        right, above = 1.5 / 20 * np.pi / (1 if projection == "panorama" else 2), 0.5 / 20 * np.pi / 2
        if projection == "panorama":
            d = np.array([np.sin(right) * np.cos(above), np.sin(above), -np.cos(right) * np.cos(above)])
        else:
            angle = np.hypot(right, above)
            d = np.array([right / angle * np.sin(angle), above / angle * np.sin(angle), -np.cos(angle)])
        to = np.array([0.5, 0.2, -5.0])
        b = d @ to
        expected = b - np.sqrt(b * b - to @ to + 1)
    assert expected < 6
    assert session.focus == pytest.approx(expected, rel=1e-5)


def test_beyond_the_circle_of_a_fisheye_is_nothing_to_focus_on(device):
    scene = Scene(shapes=INSIDE, cameras=[Camera(projection="fisheye")])
    with pytest.raises(UsageError, match=r"^focus_on \(0, 0\) shows only the background"):
        Session(scene, width=16, focus_on=(0, 0), integrator="depth", device=device)


def test_the_header_knows_the_matrices_that_there_are():
    for projection, names in (("orthographic", {"worldToCamera", "worldToNDC"}), ("panorama", {"worldToCamera"})):
        session = Session(Scene(shapes=INSIDE), width=8, device="cpu", integrator="depth", projection=projection)
        assert {name for name in session.image().metadata if name.startswith("world")} == names
        assert session.height == (4 if projection == "panorama" else 8)
