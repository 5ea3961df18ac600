"""Images under pixel filters: even surfaces stay even, edges are its integral, crops are parts of the whole."""

from __future__ import annotations

import numpy as np
import pytest
from filter_shapes import SHAPES, cumulated
from judging import assert_same
from parts import quad, sky
from renders import renders

from lumipath.rendering.session import Session, render
from lumipath.scene import AmbientLight, Camera, Material, Scene, Sphere

FURNACE = Scene(shapes=[Sphere(material=Material(diffuse=0.5, emission=0.5))], cameras=[Camera(fov=60)], name="furnace")
SIZE = 16
# Where the corner of the lamp lies in the image, in pixels from the left and from the top.
ACROSS, DOWN = 6.3, 9.6


def corner_of_a_lamp(emission=1.0, **camera):
    """A lamp that fills the image to the right of ACROSS and above DOWN; one pixel is 1 m."""
    x, y = ACROSS - SIZE / 2, SIZE / 2 - DOWN
    corners = ((x, y, -3), (99, y, -3), (99, 99, -3), (x, 99, -3))
    lamp = quad(*corners, material=Material(emission=emission))
    return Scene(shapes=[lamp], cameras=[Camera(projection="orthographic", height=SIZE, **camera)], name="lamp")


def blurred(name, radius=None):
    """(SIZE, SIZE, 1): the lamp's image: the integral of the filter over what lies within the lamp."""
    distance, total = cumulated(name, radius)
    middles = np.arange(SIZE) + 0.5
    across = 1 - np.interp(ACROSS - middles, distance, total)
    down = np.interp(DOWN - middles, distance, total)
    return np.outer(down, across)[..., None]


def deviation(images, exact):
    """How far, at most, the mean of a pixel is off, in standard errors.

    At the end of a filter a pixel may be hit once in thousands of samples, and have no scatter: 3e-4 is added.
    """
    values = images[..., :1]
    error = np.sqrt(values.var(axis=0, ddof=1) / len(values) + 3e-4**2)
    return float((np.abs(values.mean(axis=0) - exact) / error).max())


# Of 256 pixels, with 15 degrees of freedom: once in some thousand seeds.
MOST = 7.0
CASES = [*((name, None) for name in SHAPES), ("box", 1.5), ("gaussian", 3.0), ("mitchell", 3.0)]


@pytest.mark.parametrize(("name", "radius"), CASES)
def test_an_edge_is_the_integral_of_the_filter(device, name, radius):
    settings = {"width": SIZE, "height": SIZE, "spp": 256, "max_depth": 0, "device": device}
    images = renders(corner_of_a_lamp(), filter=name, filter_radius=radius, **settings)
    assert deviation(images, blurred(name, radius)) < MOST
    if name == "mitchell":
        # Below 0 on the dark side, above 1 on the bright one.
        assert images.mean(axis=0).min() < -0.005
        assert images.mean(axis=0).max() > 1.005


def test_the_judge_tells_a_gaussian_from_a_window(device):
    settings = {"width": SIZE, "height": SIZE, "spp": 256, "max_depth": 0, "device": device}
    images = renders(corner_of_a_lamp(), filter="gaussian", **settings)
    assert deviation(images, blurred("blackman-harris")) > 2 * MOST


@pytest.mark.parametrize("name", ["gaussian", "mitchell"])
def test_what_is_even_stays_even(device, name):
    # Under a sky of 1, with nothing between.
    scene = Scene(shapes=[Sphere(transform=np.diag([1e-3, 1e-3, 1e-3, 1.0]))], environment=sky(), cameras=[Camera()])
    scene.cameras[0] = Camera(position=(0, 0, -5))
    image = render(scene, width=8, spp=32, filter=name, device=device)
    np.testing.assert_allclose(image.pixels, 1, rtol=1e-5)


@pytest.mark.parametrize("rr_depth", [None, 1])
def test_negative_samples_go_as_far_as_positive_ones(device, rr_depth):
    # Inside a sphere that emits 0.5 and reflects 0.5 all is 1. If paths of negative weight ended early, or always
    # survived roulette, it would be another number.
    settings = {"filter": "mitchell", "max_depth": 40, "rr_depth": rr_depth, "device": device}
    images = renders(FURNACE, width=8, spp=256, **settings)
    assert_same(images, 1.0)


def test_whitted_ray_tracing_weighs_its_samples(device):
    scene = corner_of_a_lamp()
    scene.lights.append(AmbientLight(colour=1e-9))
    settings = {"width": SIZE, "height": SIZE, "spp": 256, "device": device, "integrator": "whitted"}
    assert deviation(renders(scene, filter="mitchell", **settings), blurred("mitchell")) < MOST


@pytest.mark.parametrize("name", ["gaussian", "mitchell"])
def test_a_crop_is_a_part_of_the_whole(device, name):
    settings = {"width": SIZE, "height": SIZE, "spp": 16, "max_depth": 0, "filter": name, "device": device}
    whole = render(corner_of_a_lamp(), **settings).pixels
    # Its edge goes through the blurred one.
    part = render(corner_of_a_lamp(), crop=(6, 3, 11, 10), **settings).pixels
    np.testing.assert_allclose(part, whole[3:10, 6:11], rtol=1e-6, atol=1e-7)


def test_adaptive_sampling_measures_signed_samples(device):
    scene = corner_of_a_lamp()
    settings = {"width": SIZE, "height": SIZE, "max_depth": 0, "filter": "mitchell", "device": device}
    session = Session(scene, noise=0.02, spp=4096, **settings)
    pixels = np.asarray(session.run(), np.float64)
    assert session.film.rejected == 0
    # What the film says of its error is what the exact image says.
    error = np.sqrt(((pixels - blurred("mitchell")) ** 2).mean()) / np.abs(pixels).mean()
    estimate = session.image().metadata["noise"]
    assert estimate < 0.02
    assert error < 1.5 * estimate


def test_layers_are_means_over_the_positive_part(device):
    scene = corner_of_a_lamp()
    settings = {"width": SIZE, "height": SIZE, "spp": 64, "filter": "mitchell", "device": device}
    wall = Material(diffuse=(0.9, 0.5, 0.1))
    far = quad((-99, -99, -7), (99, -99, -7), (99, 99, -7), (-99, 99, -7), material=wall)
    scene.shapes.append(far)
    image = render(scene, aov=("albedo", "depth", "object_id"), integrator="depth", **settings)
    # Two surfaces: a black lamp at 3 m, a wall at 7 m.
    x = np.linspace(-2, 2, 4001)
    positive = np.cumsum(np.maximum(SHAPES["mitchell"](x), 0))
    positive /= positive[-1]
    middles = np.arange(SIZE) + 0.5
    across = 1 - np.interp(ACROSS - middles, x, positive)
    lamp = np.outer(np.interp(DOWN - middles, x, positive), across)[..., None]
    np.testing.assert_allclose(image["albedo"], (1 - lamp) * wall.diffuse, atol=0.06)
    np.testing.assert_allclose(image["depth"], 7 - 4 * lamp, atol=0.25)
    assert image["albedo"].min() >= 0
    assert (image["albedo"] <= np.float32(wall.diffuse) * 1.00001).all()
    assert image["depth"].min() >= 3 * 0.9999
    assert image["depth"].max() <= 7 * 1.0001
    # Numbers are of the middles of pixels.
    is_lamp = np.outer(middles < DOWN, middles > ACROSS)
    np.testing.assert_array_equal(image["object_id"][..., 0] == 0, is_lamp)


def test_a_filter_blurs_what_the_lens_has_not(device):
    # Both at once: the lens' blur of an edge far out of focus, and the filter's, add up.
    scene = corner_of_a_lamp(aperture=1.0, focus=1e6)
    settings = {"width": SIZE, "height": SIZE, "spp": 1024, "max_depth": 0, "device": device, "seeds": 4}
    row = renders(scene, filter="gaussian", **settings).mean(axis=(0, 3))[2]
    x, total = cumulated("gaussian")
    middle, mass = (x[1:] + x[:-1]) / 2, np.diff(total)
    # At an infinite focus the lens moves every ray by its own offset: a disc of radius 1 m, 1 pixel.
    width = np.sqrt((middle**2 * mass).sum() + 1 / 4)
    step = np.diff(row)
    place = np.arange(1, SIZE)
    assert step.sum() == pytest.approx(1, abs=0.01)
    mean = (step * place).sum() / step.sum()
    assert mean == pytest.approx(ACROSS, abs=0.03)
    # Differences of pixels are means over one pixel more.
    assert np.sqrt((step * (place - mean) ** 2).sum()) == pytest.approx(np.sqrt(width**2 + 1 / 12), rel=0.03)
