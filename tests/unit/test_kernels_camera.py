"""Camera rays of every projection against closed formulas."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from kernel_calls import looped

from lumipath.kernels.camera import axial_distance, camera_sample
from lumipath.kernels.sampler import Numbers
from lumipath.lang import Features, Vec3
from lumipath.pack.layout import FISHEYE, LENS, PANORAMA
from lumipath.pack.scene import pack_scene, pack_view, settings_features
from lumipath.scene import Camera, Scene, Sphere
from lumipath.settings import RenderSettings

POSE = {"position": (1.0, 2.0, 3.0), "direction": (-1.0, -0.5, 0.4), "up": (0.1, 1.0, 0.2)}
PACKED = pack_scene(Scene(shapes=[Sphere()])).scene


def _ray(pair, column, row, a, b, c, d):
    scene, view = pair
    s = camera_sample(scene, view, column, row, Numbers(c, d, a, b))
    r = s.ray
    return r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.tmax, s.weight


rays = looped(_ray, outputs=8, scene=True)


def _distance(pair, x, y, z):
    scene, view = pair
    return axial_distance(scene, view, Vec3(x, y, z))


distances = looped(_distance, scene=True)


def scene_and_view(camera, **settings):
    settings = RenderSettings(**settings)
    return PACKED._replace(features=Features(settings_features(settings, camera))), pack_view(camera, settings)


def sampled(camera, count=4000, **settings):
    """Origins (N, 3), directions (N, 3) in the camera's frame, ends and weights; columns and rows with fractions, 0..1.

    The frame is (right, up, ahead) about the position.
    """
    scene, view = scene_and_view(camera, **settings)
    rng = np.random.default_rng(9)
    column, row = (rng.integers(0, n, count).astype(np.int32) for n in (view.width, view.height))
    numbers = rng.random((4, count), np.float32)
    found = rays((scene, view), column, row, *numbers).astype(float)
    right, up, backward = camera.axes()
    frame = np.stack([right, up, -backward], axis=1)
    u, v = (column + numbers[0]) / view.width, (row + numbers[1]) / view.height
    return (found[:3].T - camera.position) @ frame, found[3:6].T @ frame, found[6], found[7], u, v, numbers


def test_a_shift_moves_the_window_over_the_image_plane():
    camera = Camera(**POSE, fov=65, shift=(0.4, -0.25))
    o, d, end, weight, u, v, _ = sampled(camera, width=60, height=40)
    half = np.tan(np.radians(65 / 2))
    # In parts of the longer side, 3 / 2 of the height.
    x = (2 * u - 1) * half * 1.5 + 0.4 * 2 * half * 1.5
    y = (1 - 2 * v) * half - 0.25 * 2 * half * 1.5
    np.testing.assert_allclose(d[:, :2] / d[:, 2:], np.stack([x, y], axis=1), atol=1e-5)
    np.testing.assert_allclose(o, 0, atol=1e-6)
    assert np.isinf(end).all()
    assert (weight == 1).all()


def test_a_shift_shows_what_a_larger_picture_shows_there():
    # The right half of a picture is one of half its width, shifted by a quarter of the whole.
    whole = sampled(Camera(**POSE, fov=50), width=80, height=40)
    camera = Camera(**POSE, fov=50, shift=(0.5, 0.0))
    _, view = scene_and_view(camera, width=40, height=40)
    half = sampled(camera, width=40, height=40)
    assert view.width == 40
    for u, d in ((2 * whole[4] - 1, whole[1]), (half[4], half[1])):
        inside = u > 0
        x = d[inside, 0] / d[inside, 2] / np.tan(np.radians(25))
        np.testing.assert_allclose(x, 2 * u[inside], atol=1e-4)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.1, 0.2)])
def test_orthographic_rays_are_parallel_and_start_on_a_plane(shift):
    camera = Camera(**POSE, projection="orthographic", height=2.5, shift=shift)
    o, d, end, _, u, v, _ = sampled(camera, width=30, height=60)
    np.testing.assert_allclose(d, np.tile([0, 0, 1], (len(d), 1)), atol=1e-6)
    # The longer side is the height.
    x, y = (u - 0.5) * 1.25 + shift[0] * 2.5, (0.5 - v) * 2.5 + shift[1] * 2.5
    np.testing.assert_allclose(o, np.stack([x, y, 0 * x], axis=1), atol=1e-6)
    assert np.isinf(end).all()


ANGLES = [((-180.0, 180.0), (-90.0, 90.0)), ((-30.0, 75.0), (-20.0, 50.0)), ((-360.0, 0.0), (10.0, 90.0))]


@pytest.mark.parametrize(("longitude", "latitude"), ANGLES)
def test_a_panorama_shows_longitudes_and_latitudes(longitude, latitude):
    camera = Camera(**POSE, projection="panorama", longitude=longitude, latitude=latitude)
    o, d, end, _, u, v, _ = sampled(camera, width=70, height=30)
    x = np.radians(longitude[0] + u * (longitude[1] - longitude[0]))
    y = np.radians(latitude[1] - v * (latitude[1] - latitude[0]))
    exact = np.stack([np.sin(x) * np.cos(y), np.sin(y), np.cos(x) * np.cos(y)], axis=1)
    np.testing.assert_allclose(d, exact, atol=2e-6)
    np.testing.assert_allclose(o, 0, atol=1e-6)
    assert np.isinf(end).all()


RADII = {
    "fisheye": lambda angle, edge: angle / edge,
    "fisheye-equisolid": lambda angle, edge: np.sin(angle / 2) / np.sin(edge / 2),
}


@pytest.mark.parametrize("projection", RADII)
@pytest.mark.parametrize("fov", [60.0, 180.0, 270.0, 360.0])
def test_the_radius_in_a_fisheye_is_a_function_of_the_angle(projection, fov):
    camera = Camera(**POSE, projection=projection, fisheye_fov=fov)
    o, d, end, weight, u, v, _ = sampled(camera, width=50, height=40)
    # The circle touches the longer sides.
    x, y = (2 * u - 1) * 50 / 40, 1 - 2 * v
    r = np.hypot(x, y)
    inside = r < 1 - 1e-6
    assert 0.5 < inside.mean() < 0.7
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-6)
    angle = np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
    np.testing.assert_allclose(RADII[projection](angle, np.radians(fov / 2))[inside], r[inside], atol=2e-4)
    # Not turned about the axis, and upright; where something is to tell by.
    told = inside & (np.sin(angle) > 0.01)
    turned = np.angle((d[:, 0] + 1j * d[:, 1]) / (x + 1j * y))
    np.testing.assert_allclose(turned[told], 0, atol=1e-4)
    np.testing.assert_allclose(o, 0, atol=1e-6)
    # Beyond the circle there is nothing.
    outside = r > 1 + 1e-6
    assert np.isinf(end[inside]).all()
    assert (weight[inside] == 1).all()
    assert not end[outside].any()
    assert not weight[outside].any()


def test_equal_areas_of_an_equisolid_fisheye_are_equal_solid_angles():
    camera = Camera(projection="fisheye-equisolid", fisheye_fov=360)
    _, d, _, weight, _, _, _ = sampled(camera, width=40, height=40, count=40_000)
    z = d[weight > 0, 2]
    share = np.histogram(z, 8, (-1, 1))[0] / len(z)
    np.testing.assert_allclose(share, 1 / 8, atol=0.01)


LENSES = [
    Camera(**POSE, projection="orthographic", height=4.0, aperture=0.25, focus=3.0, shift=(0.1, 0.0)),
    Camera(**POSE, fov=70, shift=(0.3, 0.2), aperture=0.25, focus=3.0),
    Camera(**POSE, projection="panorama", aperture=0.25, focus=3.0),
    Camera(**POSE, projection="fisheye", fisheye_fov=300, aperture=0.25, focus=3.0),
    Camera(**POSE, projection="fisheye-equisolid", aperture=0.25, focus=3.0),
]


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.projection)
def test_rays_of_a_lens_meet_those_of_the_pinhole_where_they_are_in_focus(camera):
    pinhole = attrs.evolve(camera, aperture=0.0)
    start, ahead, _, seen, _, _, _ = sampled(pinhole, width=60, height=40)
    o, d, _, weight, _, _, numbers = sampled(camera, width=60, height=40)
    np.testing.assert_array_equal(weight, seen)
    # The point in focus of the pinhole's ray: on a plane, or on a sphere.
    is_planar = camera.projection in ("perspective", "orthographic")
    met = start + ahead * (3.0 / (ahead[:, 2:] if is_planar else 1.0))
    across = np.cross(met - o, d)
    np.testing.assert_allclose(across[seen > 0], 0, atol=2e-5)
    # On the lens, which is square to the viewing direction, or to the ray where all directions are one like another.
    offset = o - start
    axis = np.array([0, 0, 1.0]) if is_planar else ahead
    np.testing.assert_allclose((offset * axis).sum(axis=1)[seen > 0], 0, atol=1e-6)
    radius = np.linalg.norm(offset, axis=1)
    np.testing.assert_allclose(radius[seen > 0], 0.25 * np.sqrt(numbers[2])[seen > 0], atol=1e-5)


def test_a_lens_is_upright_in_every_direction():
    # A point of the lens on top: it must not be turned about the ray.
    for camera in (c for c in LENSES if c.projection in ("panorama", "fisheye")):
        scene, view = scene_and_view(camera, width=41, height=41)
        assert scene.features.mask & (LENS | PANORAMA | FISHEYE)
        top = rays((scene, view), np.int32([20]), np.int32([14]), *np.float32([[0.5], [0.5], [1 - 2**-24], [0.25]]))
        right, up, _ = camera.axes()
        offset = top[:3, 0].astype(float) - camera.position
        assert offset @ right == pytest.approx(0, abs=1e-4)
        assert offset @ up > 0.1


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.projection)
def test_depth_is_measured_as_the_focus_is(camera):
    pair = scene_and_view(camera, width=60, height=40)
    right, up, backward = camera.axes()
    local = np.random.default_rng(2).uniform(-3, 3, (100, 3))
    points = np.array(camera.position) + local @ np.stack([right, up, -backward])
    found = distances(pair, *points.T)
    is_planar = camera.projection in ("perspective", "orthographic")
    exact = local[:, 2] if is_planar else np.linalg.norm(local, axis=1)
    np.testing.assert_allclose(found, exact, atol=5e-6)
