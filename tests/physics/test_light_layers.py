"""Layers of light: parts that add up to the image, by scattering events and by lights, and the variance of pixels."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from judging import ALPHA, p_value
from parts import floor, moved, quad, scaled, sky, sphere_mesh
from renders import renders

import lumipath as lp
from lumipath.devices import cpu
from lumipath.errors import CheckpointError, LumipathWarning, UsageError
from lumipath.rendering.checkpoint import Checkpoint
from lumipath.rendering.merging import merge
from lumipath.rendering.session import Session
from lumipath.scene import Camera, DirectionalLight, Environment, Material, PointLight, Scene, Sphere, SpotLight
from lumipath.scenes import builtin

PARTS = ("emission", "direct", "indirect")
EVERY = (*PARTS, "light_groups", "variance")
# More than one tile, and tiles cut off at the edges.
SIZE = {"width": 41, "height": 37, "max_depth": 5}


def lit_scene(only=None):
    """A matt floor, a glass ball and a mirror under lights of every kind, of four groups, one of them without a name.

    All groups but `only` are too weak to see; that they are there has the scenes share their kernels.
    """
    key, fill, lamp, back = (1.0 if only in (name, None) else 1e-18 for name in ("key", "default", "lamp", "back"))
    shapes = [
        floor(4, material=Material(diffuse=0.6)),
        Sphere(transform=moved(-0.6, 0.5, 0) @ scaled(0.5), material=Material(transmissive=0.9, index=1.5)),
        quad((0.5, 0, -1), (2.5, 0, -1), (2.5, 2, -1), (0.5, 2, -1), material=Material(diffuse=0.2, specular=0.7)),
    ]
    glow = Material(emission=np.array((6, 4, 2)) * lamp, group="lamp")
    shapes += [Sphere(transform=moved(0.8, 1.2, 0.4) @ scaled(0.25), material=glow)]
    shapes += [quad((-2, 0.1, -2), (-1, 0.1, -2), (-1, 1, -2), (-2, 1, -2), material=glow)]
    lights = [
        PointLight(position=(-2, 3, 1), colour=6 * key, group="key"),
        SpotLight(position=(1, 3, 2), direction=(-0.3, -1, -0.6), intensity=9 * key, outer_angle=25, group="key"),
        PointLight(position=(2, 0.5, 1), intensity=(lamp, 0.5 * lamp, 0), group="lamp"),
        DirectionalLight(direction=(-1, -2, -1), colour=np.array((0.2, 0.3, 0.4)) * fill),
        # Suns before the sky, one seen through the other.
        DirectionalLight(direction=(0, -0.1, 1), colour=(0, 0.05 * fill, 0), angle=25),
        DirectionalLight(direction=(-0.1, -0.2, 1), colour=0.05 * key, angle=30, group="key"),
        DirectionalLight(direction=(1, -0.5, 0), colour=(0.2 * back, 0, 0), angle=40, group="back"),
    ]
    environment = Environment(image=sky((0.3, 0.4, 0.5)).image, scale=back, group="back")
    camera = Camera.look_at((0, 1.5, 4), (0, 0.5, 0), fov=50, aspect=41 / 37)
    return Scene(shapes=shapes, lights=lights, environment=environment, cameras=[camera], name="lit")


def small_scene():
    """A matt floor under two lights of two groups, whose kernels compile fast."""
    lights = [PointLight(position=(-1, 2, 1), colour=5, group="key"), PointLight(position=(2, 1, 0), colour=1)]
    camera = Camera.look_at((0, 1.5, 4), (0, 0.5, 0), fov=50, aspect=41 / 37)
    floors = [floor(4, material=Material(diffuse=0.6)), quad((0, 0, -1), (2, 0, -1), (2, 2, -1), (0, 2, -1))]
    return Scene(shapes=floors, lights=lights, cameras=[camera], name="small")


@pytest.fixture(scope="module")
def scene():
    return lit_scene()


@pytest.fixture(scope="module")
def small():
    return small_scene()


def session_of(scene, **settings):
    made = Session(scene, **{"aov": EVERY, "spp": 24, **SIZE, **settings})
    made.run()
    return made


@pytest.fixture(scope="module")
def straight(scene):
    """On the CPU, by two threads, without a stop."""
    return session_of(scene, device="cpu", threads=2)


def bits(film):
    return [array.tobytes() for array in film.arrays]


def total(image, names):
    return sum(image[name].astype(np.float64) for name in names)


def groups_of(image):
    return [name for name in image.layer_names if name.startswith("light_")]


# ---- what adds up ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "limit"), [("lit", 0.05), ("many-lobes", None)])
def test_parts_and_groups_add_up_to_the_image(device, name, limit):
    scene = lit_scene() if name == "lit" else builtin(name)
    # A limit holds for suns and sky together.
    image = session_of(scene, device=device, clamp_indirect=limit).image()
    for names in (PARTS, groups_of(image)):
        np.testing.assert_allclose(total(image, names), image.pixels, rtol=2e-6, atol=1e-7)
    assert all((image[part] > 0).any() for part in PARTS)


def test_the_image_is_the_same_with_and_without_layers(scene, straight, small):
    plain = session_of(small, device="cpu", aov=()).image()
    for aov in (EVERY, ("direct",), ("light_groups",), ("variance",)):
        image = session_of(small, device="cpu", aov=aov).image()
        np.testing.assert_array_equal(image.pixels, plain.pixels)
    np.testing.assert_array_equal(session_of(scene, device="cpu", aov=()).image().pixels, straight.image().pixels)


def test_on_a_gpu_the_image_is_that_of_the_megakernel(device, scene):
    plain, layered = (session_of(scene, device=device, aov=aov).image() for aov in ((), EVERY))
    close = np.isclose(layered.pixels, plain.pixels, rtol=1e-3, atol=1e-4).all(axis=-1)
    assert close.mean() > 0.98


def test_a_furnace_in_which_each_part_is_known(device):
    # Half of the light is emitted at the wall that is seen, a quarter at one event before, and so on.
    wall = sphere_mesh(16, transform=scaled(2), material=Material(emission=0.5, diffuse=0.5))
    settings = {"width": 16, "rr_depth": None, "max_depth": 3, "spp": 256, "device": device}
    image = session_of(Scene(shapes=[wall], cameras=[Camera(position=(0, 0, 0))]), **{**settings, "height": 16}).image()
    for part, expected in (("emission", 0.5), ("direct", 0.25), ("indirect", 0.125 + 0.0625)):
        np.testing.assert_allclose(image[part].mean(), expected, rtol=0.01)
    np.testing.assert_allclose(image["emission"], 0.5, rtol=1e-6)


def test_parts_are_those_of_paths_of_that_length(device, scene):
    whole = session_of(scene, device=device).image()
    seen, once = (session_of(scene, device=device, max_depth=depth).image() for depth in (0, 1))
    assert not seen["direct"].any()
    assert not once["indirect"].any()
    # What a path does afterwards does not change what it has gathered; rays at edges may round to the other side.
    for image, part in ((seen, "emission"), (once, "emission"), (once, "direct")):
        close = np.isclose(image[part], whole[part], rtol=1e-4, atol=1e-5).all(axis=-1)
        assert close.mean() > 0.98


def test_emission_has_the_background_whatever_the_integrator(device, scene):
    image = session_of(scene, device=device, integrator="depth", aov=("emission",)).image()
    paths = session_of(scene, device=device, max_depth=0).image()
    close = np.isclose(image["emission"], paths["emission"], rtol=1e-3, atol=1e-4).all(axis=-1)
    assert close.mean() > 0.98
    np.testing.assert_allclose(image["emission"][0, 0], (0.3, 0.4, 0.5), rtol=1e-5)


@pytest.fixture(scope="module")
def group_renders():
    """(16, H, W, 3) for each light group, by the way in which lights are chosen."""
    made = {}

    def find(device, sampling):
        if (device, sampling) not in made:
            settings = {"aov": EVERY, "spp": 16, "light_sampling": sampling}
            session, images = Session(lit_scene(), device=device, **settings, **SIZE), []
            for seed in range(100, 116):
                session.restart(seed)
                images.append(session.run())
            layers = {name: np.stack([image[name] for image in images]) for name in groups_of(images[0])}
            made[device, sampling] = {name: layer.astype(np.float64) for name, layer in layers.items()}
        return made[device, sampling]

    return find


@pytest.mark.parametrize("only", ["default", "key", "lamp", "back"])
def test_a_group_is_the_picture_under_its_lights_alone(device, group_renders, only):
    alone = renders(lit_scene(only), seeds=16, spp=16, rr_depth=4, device=device, **SIZE)
    for sampling in ("power", "tree"):
        layer = group_renders(device, sampling)[f"light_{only}"]
        assert layer.mean() > 0
        assert p_value(layer, alone) > ALPHA


def test_suns_and_sky_that_are_seen_are_in_their_groups(device, scene):
    image = session_of(scene, device=device, max_depth=0, spp=1).image()
    for names in (PARTS, groups_of(image)):
        np.testing.assert_allclose(total(image, names), image.pixels, rtol=2e-6, atol=1e-7)
    radiance = {25: (0, 0.05, 0), 30: (0.05,) * 3}
    green, grey = (np.array(colour) / np.sin(np.radians(angle / 2)) ** 2 for angle, colour in radiance.items())
    # A pixel of the sky where one sun lies before the other; a corner where there is none.
    row, column = np.argwhere((image["light_default"] > 0).any(-1) & (image["light_key"] > 0).any(-1))[0]
    for name, expected in (("light_default", green), ("light_key", grey), ("light_back", (0.3, 0.4, 0.5))):
        np.testing.assert_allclose(image[name][row, column], expected, rtol=1e-5)
    assert not image["light_key"][0, 0].any()


def test_names_of_groups(scene, straight):
    assert scene.light_groups == ("default", "back", "key", "lamp")
    names = ("light_default", "light_back", "light_key", "light_lamp")
    assert straight.image().layer_names == (*PARTS, *names, "variance")
    dark = Scene(shapes=[floor(material=Material(diffuse=0.5, group="dark"))], lights=[PointLight(position=(0, 1, 0))])
    image = session_of(dark, device="cpu", aov=("light_groups",), spp=2).image()
    assert image.layer_names == ("light_default",)
    np.testing.assert_array_equal(image["light_default"], image.pixels)


def test_layers_in_the_order_asked_for_and_in_files(scene, tmp_path):
    image = session_of(scene, device="cpu", aov=("light_groups", "depth", "direct", "variance"), spp=2).image()
    groups = ("light_default", "light_back", "light_key", "light_lamp")
    assert image.layer_names == (*groups, "depth", "direct", "variance")
    image.save(tmp_path / "a.exr")
    again = lp.Image.load(tmp_path / "a.exr")
    for name in image.layer_names:
        np.testing.assert_array_equal(again[name], image[name])
    import OpenImageIO

    names = OpenImageIO.ImageBuf(str(tmp_path / "a.exr")).spec().channelnames
    assert {"light_key.R", "light_key.G", "light_key.B", "direct.R"} <= set(names)


# ---- variance -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", ["path", "ao"])
def test_variance_is_that_of_the_mean_of_the_samples(device, scene, integrator):
    session = Session(scene, integrator=integrator, spp=1, device=device, **SIZE)
    samples = []
    for number in range(12):
        one = Session(scene, integrator=integrator, spp=1, first_sample=number, device=device, **SIZE)
        samples.append(one.run().pixels.astype(np.float64))
    aov = EVERY if integrator == "path" else ("variance",)
    session = Session(scene, integrator=integrator, spp=12, device=device, aov=aov, **SIZE)
    variance = session.run()["variance"]
    expected = np.var(samples, axis=0, ddof=1) / 12
    close = np.isclose(variance, expected, rtol=1e-3, atol=1e-6).all(axis=-1)
    assert close.all() if device == "cpu" else close.mean() > 0.97


def test_variance_is_the_scatter_of_renders(device, scene):
    settings = {"sampler": "independent", "spp": 64, "device": device, **SIZE}
    session, images = Session(scene, aov=("variance",), **settings), []
    for seed in range(96):
        session.restart(seed)
        images.append(session.run())
    scatter = np.var([image.pixels for image in images], axis=0, ddof=1, dtype=np.float64)
    variance = np.mean([image["variance"].mean(axis=(0, 1)) for image in images], axis=0)
    np.testing.assert_allclose(variance, scatter.mean(axis=(0, 1)), rtol=0.1)


def test_the_variance_of_one_sample_and_of_equal_ones_is_0(device, scene):
    assert not session_of(scene, device=device, spp=1).image()["variance"].any()
    sky_alone = Scene(environment=sky(0.7), shapes=[Sphere(transform=moved(0, 0, 99))])
    image = session_of(sky_alone, device=device, aov=("variance",)).image()
    assert image["variance"].max() < 1e-8


# ---- nothing is lost ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 3])
def test_the_number_of_threads_does_not_change_a_bit(scene, straight, threads):
    assert bits(session_of(scene, device="cpu", threads=threads).film) == bits(straight.film)


def test_a_stopped_render_goes_on_to_the_same_bits(scene, straight, tmp_path, eager):
    path, stopped = tmp_path / "a.ckpt", 0
    while True:
        session = Session(scene, device="cpu", threads=2, checkpoint=path, resume=True, aov=EVERY, spp=24, **SIZE)
        for number, _ in enumerate(session, 1):
            if number == 2:
                break
        assert bits(Checkpoint.load(path).film) == bits(session.film)
        if session.film.counts.min() == 24:
            break
        stopped += 1
    assert stopped
    assert bits(session.film) == bits(straight.film)
    image, expected = session.image(), straight.image()
    for name in expected.layer_names:
        np.testing.assert_array_equal(image[name], expected[name])


def test_a_device_that_needs_even_counts_gets_layers_too(scene, straight, tmp_path, monkeypatch):
    path = tmp_path / "a.ckpt"
    few = Session(scene, device="cpu", aov=(*EVERY, "depth"), spp=8, **SIZE)
    few.run()
    # As after an interruption.
    few.film.counts[:16, :16] = 0
    for array in (few.film.total, few.film.lost, few.film.parts, few.film.parts_lost):
        array[:16, :16] = 0
    few.save_checkpoint(path)
    monkeypatch.setattr(cpu.CpuDevice, "even_counts", True)
    other = Session(scene, device="cpu", aov=EVERY, spp=24, **SIZE)
    other.load_checkpoint(path)
    assert (other.film.counts == 8).all()
    other.run()
    for name in PARTS:
        np.testing.assert_allclose(other.image()[name], straight.image()[name], rtol=1e-6, atol=1e-9)


def test_ranges_add_up_with_their_layers(scene, straight, tmp_path):
    paths = []
    for first, spp in ((0, 16), (16, 8)):
        paths.append(tmp_path / f"{first}.ckpt")
        session_of(scene, device="cpu", first_sample=first, spp=spp, checkpoint=paths[-1])
    image, expected = merge(paths).image(), straight.image()
    for name in expected.layer_names:
        np.testing.assert_allclose(image[name], expected[name], rtol=2e-6, atol=1e-9)


def test_layers_that_only_one_part_of_a_sum_has_are_left_out_with_a_word(small, tmp_path):
    for seed, aov in ((1, ("direct", "variance")), (2, ("variance", "light_groups"))):
        session_of(small, device="cpu", seed=seed, spp=2, aov=aov, checkpoint=tmp_path / f"{seed}.ckpt")
    with pytest.warns(LumipathWarning, match=r"not all .* have the layers direct, emission, indirect, light_default, "):
        merged = merge([tmp_path / "1.ckpt", tmp_path / "2.ckpt"])
    assert merged.image().layer_names == ("variance",)


def test_a_checkpoint_without_the_layers_is_refused_and_one_with_more_is_taken(small, tmp_path):
    path = tmp_path / "a.ckpt"
    session_of(small, device="cpu", spp=8, aov=("light_groups", "variance"), checkpoint=path)
    with pytest.raises(CheckpointError, match="was rendered without the layers emission, direct, indirect; leave"):
        Session(small, device="cpu", aov=("direct", "variance"), spp=24, checkpoint=path, resume=True, **SIZE)
    session = session_of(small, device="cpu", aov=("variance",), checkpoint=path, resume=True)
    straight = session_of(small, device="cpu", aov=("variance",))
    np.testing.assert_array_equal(session.image()["variance"], straight.image()["variance"])
    assert Checkpoint.load(path).film.layer_names == ("variance",)


def test_with_noise_and_limits_the_layers_are_those_of_the_same_samples(device, scene):
    session = session_of(scene, device=device, noise=0.08, spp=200)
    assert session.film.counts.min() < session.film.counts.max()
    image = session.image()
    for names in (PARTS, groups_of(image)):
        np.testing.assert_allclose(total(image, names), image.pixels, rtol=2e-6, atol=1e-7)


def test_a_restart_begins_anew(scene, straight):
    session = session_of(scene, device="cpu", seed=5)
    session.restart(0)
    session.run()
    assert bits(session.film) == bits(straight.film)


@pytest.mark.parametrize("aov", [EVERY, ()], ids=["layers", "plain"])
def test_samples_that_are_not_finite_are_in_no_layer(device, aov):
    # Two mirrors that multiply light by 1e12 at each of many events.
    glowing = Material(emission=1.0, specular=1e12)
    room = Scene(
        shapes=[
            quad((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1), material=glowing),
            quad((9, -9, 9), (-9, -9, 9), (-9, 9, 9), (9, 9, 9), material=glowing),
        ],
        cameras=[Camera(position=(0, 0, 0), fov=10)],
    )
    settings = {"width": 8, "height": 8, "spp": 4, "rr_depth": None, "device": device}
    with pytest.warns(LumipathWarning, match="some samples were not finite; they count as black"):
        session = session_of(room, aov=aov, **settings)
    assert session.film.rejected >= 8 * 8 * 4
    image = session.image()
    assert all(np.isfinite(layer).all() for layer in (image.pixels, *image.layers.values()))
    if aov:
        np.testing.assert_allclose(total(image, PARTS), image.pixels, rtol=1e-5)
    # On a GPU a render with layers leaves out light that is not finite, all others the whole sample.
    if device == "cpu" or not aov:
        assert not image.pixels.any()


# ---- plain Python ---------------------------------------------------------------------------------------------------

PROGRAM = """
import json, sys
import lumipath as lp
from lumipath.scenes import builtin

aov = ("emission", "direct", "indirect", "light_groups", "variance")
image = lp.render(builtin("lights"), device="cpu", width=8, height=6, spp=2, max_depth=2, threads=1, aov=aov)
json.dump({name: image[name].tolist() for name in image.layer_names}, sys.stdout)
"""


def test_plain_python_gives_what_the_compiled_kernels_give():
    def run(**environment):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM], env={**os.environ, **environment}, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    compiled, plain = run(), run(LUMIPATH_DEBUG_PYTHON="1")
    for name, layer in compiled.items():
        close = np.isclose(np.array(layer), np.array(plain[name]), rtol=1e-3, atol=1e-4)
        assert close.mean() > 0.95, name


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"integrator": "ao", "aov": ("direct",)}, "aov names direct, which only the integrator path has, not ao"),
        ({"kernel": "wavefront", "aov": ("variance",)}, "aov names variance, which needs whole paths in one kernel"),
    ],
)
def test_what_does_not_go_together(settings, message):
    with pytest.raises(UsageError, match=message):
        lp.RenderSettings(**settings)
