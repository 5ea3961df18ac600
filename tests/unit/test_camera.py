"""What a camera accepts, and what it says about itself."""

import numpy as np
import pytest

from lumipath import settings
from lumipath.errors import SceneError
from lumipath.rendering.checkpoint import Identity
from lumipath.scene import Camera, Scene
from lumipath.scene.camera import PROJECTIONS
from lumipath.settings import RenderSettings


@pytest.mark.parametrize(
    ("field", "value", "wanted"),
    [
        ("blades", 2, "0 for a round aperture, or from 3 to 32"),
        ("blades", 33, "0 for a round aperture"),
        ("blades", -3, "0 for a round aperture"),
        ("blades", 6.0, "0 for a round aperture"),
        ("blades", True, "0 for a round aperture"),
        ("blade_rotation", 361, "a number from -360 to 360"),
        ("blade_rotation", float("nan"), "a number from -360 to 360"),
        ("aperture", -1, "a number from 0 to 1e+06"),
        ("focus", 0, "a number from 1e-06 to 1e+09"),
        ("projection", "cylinder", "one of perspective, orthographic, panorama, fisheye, fisheye-equisolid"),
        ("projection", None, "one of perspective"),
        ("height", 0, "a number from 1e-09 to 1e+09"),
        ("height", "2", "a number from"),
        ("fisheye_fov", 361, "a number from 0.001 to 360"),
        ("fisheye_fov", 0, "a number from 0.001 to 360"),
    ],
)
def test_wrong_values_name_the_field(field, value, wanted):
    with pytest.raises(SceneError) as caught:
        Camera(**{field: value})
    assert str(caught.value).startswith(f"camera: {field} is {value!r}: it must be {wanted}")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"longitude": (90, -90)}, r"longitude is \(90.0, -90.0\): it must rise, by 360 at most, within -360 to 360"),
        ({"longitude": (-200, 200)}, "longitude is"),
        ({"latitude": (0, 0)}, r"latitude is \(0.0, 0.0\): it must rise, within -90 to 90"),
        ({"latitude": (-90, 91)}, "latitude is"),
        ({"latitude": (-90, 0, 90)}, "latitude must have the shape 2, not 3"),
        ({"shift": (0, 11)}, r"shift is \(0.0, 11.0\): each part must be from -10 to 10"),
        ({"shift": 0.5}, "shift must have the shape 2, not 1"),
        ({"shift": (0, float("nan"))}, r"shift\[1\] is nan: it must be finite"),
        ({"shift": "ab"}, "shift must be numbers"),
    ],
)
def test_wrong_pairs_name_the_field(values, message):
    with pytest.raises(SceneError, match=f"^camera: {message}"):
        Camera(**values)


@pytest.mark.parametrize("blades", [0, 3, 32])
def test_blades(blades):
    assert Camera(blades=blades, blade_rotation=-12.5).blades == blades


def test_scenes_and_settings_name_the_same_projections():
    assert settings.PROJECTIONS == PROJECTIONS


def test_an_orthographic_camera_shows_by_default_what_a_perspective_one_shows_at_its_focus():
    camera = Camera.look_at((0, 0, 5), (0, 0, 1), fov=60, projection="orthographic")
    assert camera.extent == pytest.approx(2 * 4 * np.tan(np.radians(30)))
    assert Camera(height=3, projection="orthographic").extent == 3


@pytest.mark.parametrize(
    ("camera", "size"),
    [
        (Camera(aspect=1.5), (300, 200)),
        (Camera(aspect=1.5, projection="orthographic"), (300, 200)),
        (Camera(aspect=1.5, projection="panorama"), (300, 150)),
        (Camera(projection="panorama", longitude=(-90, 90), latitude=(-30, 60)), (300, 150)),
        (Camera(projection="panorama", longitude=(0, 360), latitude=(-90, 0)), (300, 75)),
        (Camera(aspect=1.5, projection="fisheye"), (300, 300)),
    ],
)
def test_the_height_of_an_image_follows_from_the_projection(camera, size):
    assert RenderSettings(width=300).size(camera.image_aspect) == size


def to_ndc(camera, points, width, height, window):
    """Where the matrices of the header bring world points: column and row of the window, and depth."""
    matrix = camera.camera_to_ndc(width, height, window) @ camera.world_to_camera()
    h = matrix @ np.concatenate([points, np.ones((len(points), 1))], axis=1).T
    return h[0] / h[3], h[1] / h[3], h[2:]


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, -0.2)])
def test_matrices_bring_points_to_their_pixels(projection, shift):
    options = {"projection": projection, "shift": shift, "fov": 50, "height": 3.0}
    camera = Camera(position=(1, 2, 3), direction=(-1, -0.5, -2), **options)
    width, height, window = 60, 40, (10, 5, 50, 30)
    right, up, backward = camera.axes()
    x, y, depth = np.random.default_rng(1).uniform((-1, -1, 1), (1, 1, 5), (20, 3)).T
    points = np.array(camera.position) + x[:, None] * right + y[:, None] * up - depth[:, None] * backward
    u, v, rest = to_ndc(camera, points, width, height, window)
    # The image plane by hand: its half height, and the shift in parts of the longer side, which is across.
    half, scale = (np.tan(np.radians(25)), depth) if projection == "perspective" else (1.5, 1.0)
    unit = 2 * half * width / height
    column = ((x / scale - shift[0] * unit) / (half * width / height) + 1) / 2 * width
    row = (1 - (y / scale - shift[1] * unit) / half) / 2 * height
    np.testing.assert_allclose(u * 40 + 10, column, rtol=1e-9)
    np.testing.assert_allclose(v * 25 + 5, row, rtol=1e-9)
    np.testing.assert_allclose(rest, [np.ones(20), depth] if projection == "perspective" else [depth, np.ones(20)])


@pytest.mark.parametrize("projection", ["panorama", "fisheye", "fisheye-equisolid"])
def test_no_matrix_makes_a_curved_image(projection):
    assert Camera(projection=projection).camera_to_ndc(8, 8, (0, 0, 8, 8)) is None


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ({"projection": "orthographic"}, {"projection": "orthographic", "height": Camera().extent}, True),
        ({"projection": "orthographic"}, {"projection": "orthographic", "height": 2.0}, False),
        ({"projection": "fisheye"}, {"projection": "fisheye", "fov": 20.0}, True),
        ({"projection": "fisheye"}, {"projection": "fisheye", "fisheye_fov": 200}, False),
        ({"projection": "fisheye"}, {"projection": "fisheye-equisolid"}, False),
        ({"projection": "panorama"}, {"projection": "panorama", "shift": (0.1, 0)}, True),
        ({"projection": "panorama"}, {"projection": "panorama", "latitude": (0, 90)}, False),
        ({}, {"shift": (0.1, 0)}, False),
        ({}, {"longitude": (0, 90), "height": 7}, True),
    ],
)
def test_cameras_that_show_the_same_belong_to_the_same_picture(one, other, same):
    here, there = (
        Identity.of(Scene(cameras=[Camera(**values)]), RenderSettings(width=8, height=8)) for values in (one, other)
    )
    assert (here.differences(there) == []) == same


def test_a_projection_may_be_given_by_the_camera_or_by_the_settings():
    camera = Camera(focus=3.0, fov=40, aspect=2.0)
    by_settings = Identity.of(Scene(cameras=[camera]), RenderSettings(projection="orthographic", focus=3.0, height=8))
    made = Camera(projection="orthographic", focus=3.0, fov=40, aspect=2.0)
    assert by_settings == Identity.of(Scene(cameras=[made]), RenderSettings(height=8))
    # Another focus makes nothing larger.
    moved = Identity.of(Scene(cameras=[camera]), RenderSettings(projection="orthographic", focus=9.0, height=8))
    assert moved.settings["camera"] == by_settings.settings["camera"]
