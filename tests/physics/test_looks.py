"""Albedo, normal, depth and ambient occlusion of scenes whose first surfaces are known."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from judging import assert_same
from parts import floor, hidden, moved, quad, scaled, turned
from renders import renders

from lumipath.rendering.session import Session, render
from lumipath.scene import Camera, Material, Scene, Sphere, Square

AHEAD = Camera(position=(0, 0, 4), fov=40)


def look(integrator, device, *shapes, camera=AHEAD, **settings):
    """(H, W, 3): the picture of a quick look."""
    shapes = [*shapes, *hidden("quadric", "glass", "mirror", "one-sided")]
    settings = {"width": 17, "spp": 4, **settings}
    session = Session(Scene(shapes=shapes, cameras=[camera]), device=device, integrator=integrator, **settings)
    return np.asarray(session.run(), np.float64)


def wall(**options):
    return quad((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0), **options)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Material(diffuse=(0.2, 0.4, 0.6)), (0.2, 0.4, 0.6)),
        (Material(diffuse=(0.2, 0.4, 0.6), specular=0.1), (0.3, 0.5, 0.7)),
        (Material(diffuse=(0.2, 0.4, 0.6), specular=0.5), (0.7, 0.9, 1)),
        (Material(reflective=(1, 0.8, 0.3)), (1, 0.8, 0.3)),
        (Material(transmissive=(0.5, 0.1, 0.2), diffuse=0.1), (1, 1, 1)),
        (Material(emission=7.0), (0, 0, 0)),
    ],
    ids=["diffuse", "diffuse and mirror", "at most 1", "mirror", "glass", "lamp"],
)
def test_albedo_is_what_a_surface_gives_back(device, material, expected):
    np.testing.assert_allclose(look("albedo", device, wall(material=material))[8, 8], expected, atol=1e-6)


@pytest.mark.parametrize("integrator", ["albedo", "normal", "depth", "ao"])
def test_where_nothing_is_hit_a_look_is_0(device, integrator):
    assert (look(integrator, device, Sphere(transform=moved(0, 0, 9), material=Material(diffuse=1.0))) == 0).all()


def test_normals_of_a_sphere_are_its_points(device):
    image = look("normal", device, Sphere(), camera=Camera(position=(0, 0, 4000), fov=np.degrees(2 / 4000)), width=33)
    s = (np.arange(33) + 0.5) / 33 * 2 - 1
    x, y = np.meshgrid(s, -s)
    inside = x**2 + y**2 < 0.8
    z = np.sqrt(np.where(inside, 1 - x**2 - y**2, 1))
    np.testing.assert_allclose(image[inside], np.stack([x, y, z], -1)[inside], atol=0.03)


def test_normals_face_the_viewer_and_are_interpolated(device):
    np.testing.assert_allclose(look("normal", device, wall()), np.broadcast_to((0, 0, 1), (17, 17, 3)), atol=1e-6)
    behind = look("normal", device, wall(), camera=Camera(position=(0, 0, -4), direction=(0, 0, 1)))
    np.testing.assert_allclose(behind, np.broadcast_to((0, 0, -1), (17, 17, 3)), atol=1e-6)
    tilted = np.array([0.6, 0, 0.8])
    smooth = quad((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0))
    smooth = type(smooth)(vertices=smooth.vertices, faces=smooth.faces, normals=[tilted] * 4)
    np.testing.assert_allclose(look("normal", device, smooth)[8, 8], tilted, atol=1e-6)


@pytest.mark.parametrize("lens", [{}, {"aperture": 0.5, "focus": 2.0}], ids=["pinhole", "lens"])
def test_depth_is_measured_along_the_axis(device, lens):
    # The same all over a wall across the axis, though its corners are farther away.
    image = look("depth", device, Square(transform=scaled(99)), camera=Camera(position=(0, 0, 4), fov=80), **lens)
    np.testing.assert_allclose(image, 4.0, rtol=1e-5)


def test_depth_of_a_tilted_wall_grows_across_the_picture(device):
    # Of the plane x = z seen from (0, 0, 4) along -z: 4 - z where z = x and x = (4 - z) s.
    camera = Camera(position=(0, 0, 4), fov=40)
    image = look("depth", device, Square(transform=turned("y", -45) @ scaled(99)), camera=camera, spp=256)
    s = ((np.arange(17) + 0.5) / 17 * 2 - 1) * np.tan(np.radians(20))
    expected = 4 / (1 + s)
    np.testing.assert_allclose(image[8, :, 0], expected, rtol=2e-3)


# ---- ambient occlusion ----------------------------------------------------------------------------------------------


def occlusion(device, *shapes, at=(0, 0, 0), **settings):
    """(R, 1, 1, 3): unoccluded fractions at a point that is seen from above, estimated with several seeds."""
    camera = Camera.look_at(np.array(at) + (0, 0.5, 0.1), at, fov=0.01)
    scene = Scene(shapes=[*shapes, *hidden("quadric", "glass", "mirror", "one-sided")], cameras=[camera])
    return renders(scene, device=device, integrator="ao", width=1, spp=256, seeds=12, **settings)


def test_an_open_plane_is_not_occluded(device):
    assert occlusion(device, floor(9)).min() == 1.0


def high_wall(x, height):
    """A wall across the x axis, long enough to be endless, that faces -x."""
    return quad((x, 0, -100), (x, 0, 100), (x, height, 100), (x, height, -100))


@pytest.mark.parametrize(("x", "height"), [(0.5, 100.0), (0.5, 1.0), (1.0, 0.5)])
def test_a_wall_takes_its_form_factor(device, x, height):
    # The view factor of an endless strip at a right angle (Howell, A Catalog of Radiation Configuration Factors, B-7).
    expected = 1 - (1 - x / np.hypot(x, height)) / 2
    image = occlusion(device, floor(9), high_wall(x, height), ao_distance=1e6)
    assert_same(image, expected, block=1)


def test_inside_a_corner_of_three_faces_a_quarter_of_the_sky_is_seen(device):
    walls = (
        quad((0, 0, -9), (0, 0, 9), (0, 9, 9), (0, 9, -9)),
        quad((-9, 0, 0), (9, 0, 0), (9, 9, 0), (-9, 9, 0)),
    )
    image = occlusion(device, floor(9), *walls, at=(1e-3, 0, 1e-3), ao_distance=1e6)
    # At a distance of 1e-3 from both, walls are as good as endless.
    assert_same(image, 0.25, block=1)


def test_occluders_out_of_reach_do_not_count(device):
    assert occlusion(device, floor(9), high_wall(0.5, 1.0), ao_distance=0.499).min() == 1.0
    assert occlusion(device, floor(9), high_wall(0.5, 1.0), ao_distance=0.7).mean() < 0.99


def test_later_samples_are_other_samples(device):
    scene = Scene(shapes=[floor(9), high_wall(0.5, 1.0)], cameras=[Camera.look_at((0, 0.5, 0.1), (0, 0, 0), fov=0.01)])
    settings = {"device": device, "integrator": "ao", "width": 4, "ao_distance": 1e6}
    early, late = (np.asarray(render(scene, spp=8, first_sample=first, **settings), np.float64) for first in (0, 8))
    both = np.asarray(render(scene, spp=16, **settings), np.float64)
    assert (early != late).any()
    np.testing.assert_allclose((early + late) / 2, both, rtol=1e-6)


def test_a_tenth_of_the_extent_is_the_reach_where_none_is_given(device):
    # The box around all reaches from what is hidden 20 metres below to the lid.
    for height, dark in ((3.2, True), (3.5, False)):
        assert (height < 0.1 * np.sqrt(18**2 + 18**2 + (20 + height) ** 2)) == dark
        image = occlusion(device, floor(9), floor(9, y=height))
        assert (image.mean() < 1) == dark


# ---- plain Python ---------------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys
import numpy as np
import lumipath as lp
from lumipath.scenes import builtin

scene = builtin("glass")
scene.lights.append(lp.PointLight(position=(1, 6, 3), colour=20))
found = {}
for integrator in ("whitted", "albedo", "normal", "depth", "ao"):
    image = lp.render(scene, device="cpu", integrator=integrator, width=8, height=6, spp=1, threads=1, max_depth=4)
    found[integrator] = image.pixels.tolist()
json.dump(found, sys.stdout)
"""


def run(**environment):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env={**os.environ, **environment}, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def test_plain_python_gives_what_the_compiled_kernels_give():
    compiled, plain = run(), run(LUMIPATH_DEBUG_PYTHON="1")
    for integrator, image in compiled.items():
        image, other = np.array(image), np.array(plain[integrator])
        assert image.max() > 0
        # A ray at an edge may round to its other side.
        differs = ~np.isclose(image, other, rtol=1e-3, atol=1e-4).all(axis=-1)
        assert differs.sum() <= 1, (integrator, image[differs], other[differs])
