"""Layers of scenes whose first surfaces are known."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from parts import hidden, moved, quad, scaled, turned

from lumipath.rendering.layer_film import LAYER_SAMPLES
from lumipath.rendering.session import Session
from lumipath.scene import Box, Camera, Material, Mesh, Scene, Sphere, Square, Texture
from lumipath.scenes import builtin
from lumipath.settings import LAYERS as ALL_LAYERS
from lumipath.settings import LIGHT_LAYERS

# Those of the first surface; test_light_layers.py is about the others.
LAYERS = tuple(name for name in ALL_LAYERS if name not in (*LIGHT_LAYERS, "variance"))
AHEAD = Camera(position=(0, 0, 4), fov=40)
RED = Material(diffuse=(0.8, 0.2, 0.1), name="red")
BLUE = Material(diffuse=(0.1, 0.3, 0.9), name="blue")


def session_of(device, *shapes, camera=AHEAD, **settings):
    """A session of a small image with all layers; a quick look takes the place of paths, to compile less."""
    # Without a surface normal or a texture in sight, but of one set of kernels.
    shapes = [*shapes, *hidden("quadric", "glass", "mirror", "one-sided", "texture", "smooth")]
    settings = {"width": 17, "spp": 4, "integrator": "depth", "aov": LAYERS, **settings}
    return Session(Scene(shapes=shapes, cameras=[camera]), device=device, **settings)


def layers(device, *shapes, **settings):
    """The image of such a session."""
    return session_of(device, *shapes, **settings).run()


def wall(z=0.0, half=9, **options):
    """A square across the axis that faces +z."""
    return quad((-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z), uv=True, **options)


def facing(z, **options):
    """The same that faces -z: behind a camera that looks along -z."""
    return quad((9, -9, z), (-9, -9, z), (-9, 9, z), (9, 9, z), **options)


def everywhere(values, expected, **tolerance):
    tolerance = {"atol": 1e-5, **tolerance}
    np.testing.assert_allclose(values, np.broadcast_to(expected, values.shape), **tolerance)


# ---- one surface ----------------------------------------------------------------------------------------------------


def test_a_wall(device):
    image = layers(device, wall(material=Material(diffuse=(0.2, 0.4, 0.6), emission=(3, 2, 1))))
    everywhere(image["albedo"], (0.2, 0.4, 0.6))
    everywhere(image["normal"], (0, 0, 1))
    everywhere(image["geometric_normal"], (0, 0, 1))
    everywhere(image["depth"], 4, rtol=1e-5)
    everywhere(image["emission"], (3, 2, 1))
    everywhere(image["object_id"], 0)
    everywhere(image["material_id"], 0)
    everywhere(image["samples"], 4)
    # Points and uv of the wall grow across the picture; single pixels are means of four samples somewhere in them.
    half = 4 * np.tan(np.radians(20))
    x = ((np.arange(17) + 0.5) / 17 * 2 - 1) * half
    np.testing.assert_allclose(image["position"][8, :, 0], x, atol=half / 17)
    np.testing.assert_allclose(image["position"][:, 8, 1], -x, atol=half / 17)
    np.testing.assert_allclose(image["position"][..., 2], 0, atol=1e-5)
    np.testing.assert_allclose(image["uv"], image["position"][..., :2] / 18 + 0.5, atol=1e-5)


def test_a_sphere(device):
    camera = Camera(position=(0, 0, 4000), fov=np.degrees(2 / 4000))
    image = layers(device, Sphere(material=RED), camera=camera, width=33, spp=64)
    s = (np.arange(33) + 0.5) / 33 * 2 - 1
    x, y = np.meshgrid(s, -s)
    inside = x**2 + y**2 < 0.8
    p = np.stack([x, y, np.sqrt(np.where(inside, 1 - x**2 - y**2, 1))], -1)[inside]
    for name in ("normal", "geometric_normal", "position"):
        np.testing.assert_allclose(image[name][inside], p, atol=5e-3)
    np.testing.assert_allclose(image["depth"][inside][:, 0], 4000 - p[:, 2], atol=5e-3)
    # u around z from +x towards +y, v from -z to +z; where u is not about to jump, or about a pole.
    smooth = (np.hypot(p[:, 0], p[:, 1]) > 0.3) & (np.abs(p[:, 1]) > 0.2)
    u, v = np.arctan2(p[:, 1], p[:, 0]) / (2 * np.pi) % 1, np.arccos(-p[:, 2]) / np.pi
    np.testing.assert_allclose(image["uv"][inside][smooth], np.stack([u, v], -1)[smooth], atol=0.01)


def test_a_box_shows_the_normals_of_its_sides(device):
    camera = Camera.look_at((3, 4, 5), (0, 0, 0), fov=20)
    image = layers(device, Box(material=RED), camera=camera, width=33, spp=16)
    on_box = (image["object_id"][..., 0] == 0) & (image["albedo"][..., 0] > 0.799)
    points, normals = image["position"][on_box], image["geometric_normal"][on_box]
    # Pixels across an edge show two sides.
    one_side = np.isclose(normals.max(axis=1), 1, atol=1e-5)
    assert one_side.mean() > 0.7
    axes = normals[one_side].argmax(axis=1)
    assert set(axes.tolist()) == {0, 1, 2}
    np.testing.assert_allclose(points[one_side][np.arange(len(axes)), axes], 0.5, atol=1e-5)


def test_shading_normals_are_interpolated_and_geometric_ones_are_not(device):
    tilted = np.array([0.6, 0, 0.8])
    flat = wall()
    image = layers(device, Mesh(vertices=flat.vertices, faces=flat.faces, normals=[tilted] * 4))
    everywhere(image["normal"][8, 8], tilted)
    everywhere(image["geometric_normal"], (0, 0, 1))


def test_albedo_has_textures(device):
    chequers = Texture(image=np.array([[(0.9, 0.9, 0.9), (0.1, 0.1, 0.1)]]).repeat(2, axis=0), wrap="clamp")
    image = layers(device, wall(half=2, material=Material(diffuse=chequers)), camera=Camera(position=(0, 0, 4)))
    everywhere(image["albedo"][:, :3], 0.9)
    everywhere(image["albedo"][:, -3:], 0.1)


def test_where_nothing_is_hit_everything_is_0_and_nothing(device):
    image = layers(device, Sphere(transform=moved(0, 0, 9)))
    for name in LAYERS:
        everywhere(image[name], {"object_id": -1, "material_id": -1, "samples": 4}.get(name, 0), atol=0)


def test_pixels_that_are_partly_background(device):
    # The edge of the wall halves the middle column of pixels.
    left = quad((-9, -9, 0), (0, -9, 0), (0, 9, 0), (-9, 9, 0), material=RED)
    image = layers(device, left, spp=64)
    everywhere(image["albedo"][:, 8], np.array(RED.diffuse) / 2, rtol=0.1)
    everywhere(image["normal"][:, 8], (0, 0, 0.5), rtol=0.1)
    # Depth and position are those of what is there.
    everywhere(image["depth"][:, :9], 4, rtol=1e-5)
    assert (image["position"][:, 8, 0] < 0).all()
    assert (image["depth"][:, 9:] == 0).all()


def test_numbers_are_those_of_shapes_and_materials(device):
    def ball(x, material):
        return Sphere(transform=moved(x, 0, 0) @ scaled(0.3), material=material, name=f"ball at {x}")

    nothing = Mesh(vertices=np.zeros((0, 3)), faces=np.zeros((0, 3), np.int32), name="nothing")
    behind = wall(-3, material=BLUE, name="wall")
    image = layers(device, ball(-0.8, RED), nothing, behind, ball(0.8, BLUE), ball(0, RED), width=33)
    assert image["object_id"].dtype == image["material_id"].dtype == np.int32
    objects, materials = image["object_id"][16, :, 0], image["material_id"][16, :, 0]
    # From left to right, at the height of the balls.
    order = [int(n) for k, n in enumerate(objects) if k == 0 or n != objects[k - 1]]
    assert order == [2, 0, 2, 4, 2, 3, 2]
    names = json.loads(image.metadata["object_names"])
    assert names[:5] == ["ball at -0.8", "nothing", "wall", "ball at 0.8", "ball at 0"]
    named = np.array(json.loads(image.metadata["material_names"]))[materials]
    np.testing.assert_array_equal(named, np.where(np.isin(objects, [0, 4]), "red", "blue"))


# ---- mirrors and glass ----------------------------------------------------------------------------------------------


def test_a_mirror_shows_the_wall_in_it(device):
    mirror = wall(material=Material(specular=(1, 0.5, 0.25)))
    image = layers(device, mirror, facing(9, material=RED))
    everywhere(image["albedo"], np.array(RED.diffuse) * (1, 0.5, 0.25))
    everywhere(image["normal"], (0, 0, -1))
    # The other layers are of the mirror itself.
    everywhere(image["geometric_normal"], (0, 0, 1))
    everywhere(image["depth"], 4, rtol=1e-5)
    everywhere(image["object_id"], 0)


def test_a_mirror_of_nothing_is_black_as_nothing_is(device):
    everywhere(layers(device, wall(material=Material(specular=1.0)))["albedo"], 0)


def test_a_surface_that_is_partly_mirror_adds_both(device):
    matt = Material(diffuse=(0.3, 0.2, 0.1), specular=0.4)
    image = layers(device, wall(material=matt), facing(9, material=RED), spp=1)
    everywhere(image["albedo"], np.array(matt.diffuse) + 0.4 * np.array(RED.diffuse))
    everywhere(image["normal"], (0, 0, (0.2 - 0.4) / 0.6))


def test_mirrors_without_end_are_white_in_the_end(device):
    tinted, camera = Material(specular=0.5), Camera(position=(0, 0, 4), fov=0.5)
    image = layers(device, wall(material=tinted), facing(9, material=tinted), camera=camera)
    everywhere(image["albedo"], 0.5**8, rtol=1e-4)


def test_glass_shows_what_is_behind_it_through_its_colour(device):
    # Of the same index as air, so that nothing is reflected or refracted; nearly parallel rays cross 2 metres of it.
    clear = Material(transmissive=(0.9, 0.5, 0.2), index=1.0)
    pane = Box(transform=moved(0, 0, -2) @ scaled(9, 9, 2), material=clear)
    camera = Camera(position=(0, 0, 100), fov=0.5)
    image = layers(device, pane, wall(-5, material=RED), camera=camera)
    everywhere(image["albedo"], np.array(RED.diffuse) * np.array(clear.transmissive) ** 2, rtol=1e-3)
    everywhere(image["normal"], (0, 0, 1))
    everywhere(image["depth"], 101, rtol=1e-5)


def test_glass_blends_what_it_reflects_with_what_it_lets_through(device):
    pane = Box(transform=scaled(9, 9, 1), material=Material(transmissive=1.0, index=1.5))
    camera = Camera(position=(0, 0, 100), fov=0.5)
    image = layers(device, pane, wall(-5, material=RED), camera=camera, spp=64)
    # All reflections within a pane, from two sides of reflectance 0.04.
    through = (1 - 0.04) / (1 + 0.04)
    mean = image["albedo"].mean(axis=(0, 1))
    np.testing.assert_allclose(mean, through * np.array(RED.diffuse), atol=5 * np.sqrt(0.07 / (17 * 17 * 64)))


def test_albedo_is_at_most_1(device):
    everywhere(layers(device, wall(material=Material(diffuse=1.5)))["albedo"], 1)


# ---- sampling -------------------------------------------------------------------------------------------------------

TURNED = (Square(transform=turned("y", 40) @ scaled(2), material=RED), wall(-2, material=BLUE))


@pytest.mark.parametrize("settings", [{}, {"blades": 5}], ids=["round", "blades"])
def test_a_lens_blurs_means_but_not_numbers(device, settings):
    sharp = layers(device, *TURNED, spp=64)
    blurred = layers(device, *TURNED, spp=64, aperture=0.5, focus=2.0, **settings)
    np.testing.assert_array_equal(blurred["object_id"], sharp["object_id"])

    def mixed(image):
        return ((image["albedo"][..., 0] > 0.11) & (image["albedo"][..., 0] < 0.79)).sum()

    assert mixed(blurred) > 2 * mixed(sharp)


def test_a_crop_is_that_part_of_the_whole(device):
    whole, part = layers(device, *TURNED), layers(device, *TURNED, crop=(3, 5, 12, 16))
    for name in LAYERS:
        np.testing.assert_array_equal(part[name], whole[name][5:16, 3:12])


def test_samples_are_at_most_those_that_layers_need(device):
    image = layers(device, *TURNED, spp=LAYER_SAMPLES + 5)
    assert image.metadata["layer_samples"] == LAYER_SAMPLES
    everywhere(image["samples"], LAYER_SAMPLES + 5)
    for name in set(LAYERS) - {"samples"}:
        np.testing.assert_array_equal(image[name], layers(device, *TURNED, spp=LAYER_SAMPLES)[name])


def test_some_layers_are_those_of_all(device):
    every = layers(device, *TURNED)
    for names in (("uv",), ("object_id",), ("depth", "albedo"), ("samples",)):
        image = layers(device, *TURNED, aov=names)
        assert image.layer_names == names
        for name in names:
            np.testing.assert_array_equal(image[name], every[name])


def test_other_samples_and_other_seeds_give_other_edges(device):
    edges = [layers(device, *TURNED, **settings)["albedo"] for settings in ({}, {"seed": 1}, {"first_sample": 4})]
    assert (edges[0] != edges[1]).any()
    assert (edges[0] != edges[2]).any()
    both = layers(device, *TURNED, spp=8)["albedo"]
    np.testing.assert_allclose((edges[0] + edges[2]) / 2, both, atol=1e-6)


def test_first_samples_count_for_quick_looks_too(device):
    early, late, both = (
        layers(device, *TURNED, aov=(), **settings).pixels for settings in ({}, {"first_sample": 4}, {"spp": 8})
    )
    assert (early != late).any()
    np.testing.assert_allclose((early + late) / 2, both, rtol=1e-5)


def test_an_interrupted_pass_goes_on(device):
    session = session_of(device, *TURNED, width=64, spp=64)
    for _ in session:
        session.image()
        break
    image, straight = session.run(), layers(device, *TURNED, width=64, spp=64)
    for name in LAYERS:
        np.testing.assert_allclose(image[name], straight[name], rtol=1e-5, atol=1e-6)


def test_a_restart_makes_layers_anew(device):
    session = session_of(device, *TURNED)
    session.run()
    session.restart(7)
    np.testing.assert_allclose(session.run()["albedo"], layers(device, *TURNED, seed=7)["albedo"], atol=1e-6)


def test_the_image_is_the_same_with_and_without_layers():
    scene = builtin("cornell-box")
    settings = {"device": "cpu", "width": 24, "spp": 4}
    plain, layered = (Session(scene, aov=aov, **settings).run() for aov in ((), LAYERS))
    assert plain.pixels.tobytes() == layered.pixels.tobytes()


def test_points_lead_back_to_their_pixels_by_the_matrices(device):
    camera = Camera.look_at((1, 2, 4), (0, 0, 0), up=(0.2, 1, 0), fov=50)
    left, top, right, bottom = crop = (2, 3, 25, 21)
    image = layers(device, *TURNED, camera=camera, width=32, height=24, crop=crop, spp=1)
    rows, columns = np.nonzero(image["object_id"][..., 0] >= 0)
    points = np.concatenate([image["position"][rows, columns], np.ones((len(rows), 1))], axis=1)
    seen = points @ np.reshape(image.metadata["worldToCamera"], (4, 4))
    np.testing.assert_allclose(seen[:, 2], image["depth"][rows, columns, 0], rtol=1e-4)
    x, y, _, w = (points @ np.reshape(image.metadata["worldToNDC"], (4, 4))).T
    hit = image["depth"][rows, columns, 0] > 0
    assert np.abs(x / w * (right - left) - columns - 0.5)[hit].max() < 0.501
    assert np.abs(y / w * (bottom - top) - rows - 0.5)[hit].max() < 0.501


# ---- plain Python ---------------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys
import lumipath as lp
from lumipath.scenes import builtin

LAYERS = sys.argv[1].split(",")
image = lp.render(builtin("glass"), device="cpu", integrator="depth", width=8, height=6, spp=2, threads=1, aov=LAYERS)
json.dump({name: image[name].tolist() for name in LAYERS}, sys.stdout)
"""


def run(**environment):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, ",".join(LAYERS)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def test_plain_python_gives_what_the_compiled_kernels_give():
    compiled, plain = run(), run(LUMIPATH_DEBUG_PYTHON="1")
    for name, layer in compiled.items():
        layer, other = np.array(layer), np.array(plain[name])
        # A ray at an edge, or between reflection and refraction, may round to its other side.
        differs = ~np.isclose(layer, other, rtol=1e-3, atol=1e-4).all(axis=-1)
        assert differs.sum() <= 2, (name, layer[differs], other[differs])
