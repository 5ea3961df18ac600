"""Depth of field against the circle of confusion that a thin lens must give."""

from __future__ import annotations

import numpy as np
import pytest
from parts import moved, quad
from renders import renders

from lumipath.accel.two_level import build_trees
from lumipath.devices import cpu
from lumipath.devices.focus import distance_at
from lumipath.errors import UsageError
from lumipath.pack.scene import pack_scene, pack_view
from lumipath.rendering.session import Session, render
from lumipath.scene import Camera, Material, PointLight, Scene, Sphere
from lumipath.settings import RenderSettings

WIDTH = 64
SIZE = 1e-2


def point_at(x, y, distance, size=SIZE):
    """A nearly point-like square lamp that faces the camera at the origin."""
    s = size * distance / 2
    corners = [
        (x - s, y - s, -distance),
        (x + s, y - s, -distance),
        (x + s, y + s, -distance),
        (x - s, y + s, -distance),
    ]
    return quad(*corners, material=Material(emission=1e3), two_sided=False)


def spot(images, half):
    """Energy, centre (2,) and mean square distance from it, on the image plane at distance 1."""
    image = images.mean(axis=(0, 3))
    s = (np.arange(WIDTH) + 0.5) / WIDTH * 2 - 1
    x, y = np.meshgrid(s * half, -s * half)
    energy = image.sum()
    cx, cy = (image * x).sum() / energy, (image * y).sum() / energy
    return energy, (cx, cy), (image * ((x - cx) ** 2 + (y - cy) ** 2)).sum() / energy


@pytest.mark.parametrize(("distance", "focus", "aperture"), [(2.0, 4.0, 0.2), (6.0, 3.0, 0.25), (3.0, 1e6, 0.15)])
def test_a_point_out_of_focus_is_a_disc_of_the_size_of_its_circle_of_confusion(device, distance, focus, aperture):
    fov = 24
    half = np.tan(np.radians(fov / 2))
    scene = Scene(
        shapes=[point_at(0.03 * distance, -0.02 * distance, distance)],
        cameras=[Camera(fov=fov, aperture=aperture, focus=focus)],
    )
    settings = {"width": WIDTH, "max_depth": 1, "device": device, "seeds": 4}
    energy, centre, spread = spot(renders(scene, spp=1024, **settings), half)
    radius = aperture * abs(1 / focus - 1 / distance)
    # A disc of even brightness, a pixel's width and the lamp's own size.
    expected = radius**2 / 2 + 2 * (2 * half / WIDTH) ** 2 / 12 + 2 * SIZE**2 / 12
    assert radius > 5 * 2 * half / WIDTH
    np.testing.assert_allclose(spread, expected, rtol=0.04)
    np.testing.assert_allclose(centre, (0.03, -0.02), atol=2e-3)
    # As much light as through a pinhole.
    solid_angle = SIZE**2
    np.testing.assert_allclose(energy * (2 * half / WIDTH) ** 2, 1e3 * solid_angle, rtol=0.04)


def third_moment(images, centre, half):
    """The mean of (x + i y)^3 about the centre: its angle is three times that of a triangle's corner."""
    image = images.mean(axis=(0, 3))
    s = (np.arange(WIDTH) + 0.5) / WIDTH * 2 - 1
    x, y = np.meshgrid(s * half - centre[0], -s * half - centre[1])
    return (image * (x + 1j * y) ** 3).sum() / image.sum()


@pytest.mark.parametrize(("distance", "focus", "rotation"), [(6.0, 3.0, 0.0), (6.0, 3.0, 50.0), (2.0, 4.0, 0.0)])
def test_blades_give_a_point_out_of_focus_their_shape(device, distance, focus, rotation):
    aperture, half = 0.25, np.tan(np.radians(12))
    camera = Camera(fov=24, aperture=aperture, focus=focus, blades=3, blade_rotation=rotation)
    scene = Scene(shapes=[point_at(0, 0, distance)], cameras=[camera])
    images = renders(scene, width=WIDTH, max_depth=1, device=device, seeds=4, spp=1024)
    energy, centre, spread = spot(images, half)
    radius = aperture * abs(1 / focus - 1 / distance)
    # The polar second moment of a regular polygon; a pixel's width and the lamp's own size.
    expected = radius**2 * (2 + np.cos(2 * np.pi / 3)) / 6 + 2 * (2 * half / WIDTH) ** 2 / 12 + 2 * SIZE**2 / 12
    np.testing.assert_allclose(spread, expected, rtol=0.04)
    np.testing.assert_allclose(centre, (0, 0), atol=2e-3)
    np.testing.assert_allclose(energy * (2 * half / WIDTH) ** 2, 1e3 * SIZE**2, rtol=0.04)
    # A corner on top behind the plane in focus; before it the picture of the lens is upside down.
    corner = 90 + rotation + (180 if distance < focus else 0)
    turned = np.degrees(np.angle(third_moment(images, centre, half) * np.exp(-3j * np.radians(corner)))) / 3
    assert abs(turned) < 2


def test_a_point_in_focus_is_a_point(device):
    half = np.tan(np.radians(12))
    scene = Scene(shapes=[point_at(0.1, 0.05, 4.0)], cameras=[Camera(fov=24, aperture=0.3, focus=4.0)])
    images = renders(scene, width=WIDTH, max_depth=1, device=device, seeds=4, spp=1024)
    _, centre, spread = spot(images, half)
    assert spread < 2 * (2 * half / WIDTH) ** 2
    np.testing.assert_allclose(centre, (0.025, 0.0125), atol=2 * half / WIDTH)


@pytest.mark.parametrize("settings", [{"blades": 6, "blade_rotation": 10.0}, {}])
def test_blades_of_a_pinhole_change_nothing(device, settings):
    scene = Scene(shapes=[point_at(0.1, 0.05, 4.0)], cameras=[Camera(fov=24)])
    image = render(scene, width=8, spp=4, device=device, **settings)
    assert (image.pixels == render(scene, width=8, spp=4, device=device).pixels).all()


ROOM = [
    quad((-9, -1, 9), (9, -1, 9), (9, -1, -9), (-9, -1, -9), material=Material(diffuse=0.5)),
    # In front of the sphere's left half, seen from behind: not there.
    quad((-1, -1, -3), (-1, 1, -3), (0, 1, -3), (0, -1, -3), material=Material(diffuse=0.5), two_sided=False),
    Sphere(transform=moved(0.0, 0.0, -5.0), material=Material(diffuse=0.5)),
]
LOOKING_DOWN = Camera(position=(1, 2, 3), direction=(-1, -2, -4), fov=50, aperture=0.2, blades=5)


@pytest.mark.parametrize("camera", [Camera(fov=50, aperture=0.2), LOOKING_DOWN], ids=["level", "tilted"])
@pytest.mark.parametrize("pixel", [(31, 20), (36, 20), (20, 38)], ids=["sphere", "sphere's edge", "floor"])
def test_a_pixel_is_brought_into_focus(device, camera, pixel):
    scene = Scene(shapes=ROOM, cameras=[camera])
    session = Session(scene, width=64, height=40, focus_on=pixel, crop=(0, 0, 8, 8), device=device)
    # The same ray in float64, against the sphere and the plane of the floor.
    right, up, backward = camera.axes()
    height = np.tan(np.radians(25))
    x, y = (2 * (pixel[0] + 0.5) / 64 - 1) * height * 64 / 40, (1 - 2 * (pixel[1] + 0.5) / 40) * height
    # Its length along the viewing direction is 1, so distances along it are depths.
    d, o = x * right + y * up - backward, np.array(camera.position, float)
    to = o - (0, 0, -5)
    a, b, c = d @ d, to @ d, to @ to - 1
    on_sphere = (-b - np.sqrt(b * b - a * c)) / a if b * b > a * c and b < 0 else np.inf
    on_floor = (-1 - o[1]) / d[1] if d[1] < 0 else np.inf
    assert session.focus == pytest.approx(min(on_sphere, on_floor), rel=1e-5)
    assert min(on_sphere, on_floor) < 20


def test_a_tree_is_built_for_picking_only_where_the_device_has_none_that_the_cpu_walks(monkeypatch):
    built = []
    monkeypatch.setattr(cpu, "build_trees", lambda *boxes, **options: built.append(1) or build_trees(*boxes, **options))
    packed = pack_scene(Scene(shapes=ROOM))
    view = pack_view(Camera(fov=50), RenderSettings(width=64, height=40))
    uploaded = cpu.CpuDevice(1).upload(packed)
    on_cpu = distance_at(packed, uploaded, view, (31, 20), 1)
    assert len(built) == 1
    # Another device's scene has a tree of another kind.
    elsewhere = distance_at(packed, packed.scene, view, (31, 20), 1)
    assert len(built) == 2
    assert on_cpu == elsewhere == pytest.approx(4, abs=1e-2)


def test_the_background_cannot_be_in_focus(device):
    scene = Scene(shapes=ROOM, cameras=[Camera(fov=50)], name="room")
    with pytest.raises(UsageError, match=r"^focus_on \(2, 1\) shows only the background; name a pixel"):
        Session(scene, width=64, height=40, focus_on=(2, 1), device=device)


def test_a_pixel_outside_cannot_be_in_focus():
    with pytest.raises(UsageError, match=r"^focus_on \(64, 0\) lies outside the image of 64 x 40 pixels"):
        Session(Scene(shapes=ROOM), width=64, height=40, focus_on=(64, 0), device="cpu")


def test_picked_and_given_focus_are_the_same_picture(device):
    scene = Scene(shapes=ROOM, cameras=[LOOKING_DOWN], lights=[PointLight(position=(0, 3, 0), colour=(9, 9, 9))])
    picked = Session(scene, width=16, spp=4, focus_on=(7, 5), device=device)
    given = Session(scene, width=16, spp=4, focus=picked.focus, device=device)
    assert (picked.run().pixels == given.run().pixels).all()
    assert picked.image().pixels.mean() > 0
