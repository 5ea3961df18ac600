"""The GPU and the CPU draw the same random numbers, and so the same pictures up to rounding."""

import attrs
import numpy as np
import pytest

from lumipath import Image, RenderSettings, Session, builtin, render

KERNELS = ["megakernel", "wavefront"]
_cpu: dict[tuple, np.ndarray] = {}


def on_cpu(name, **settings):
    key = (name, *sorted(settings.items()))
    if key not in _cpu:
        _cpu[key] = np.asarray(render(builtin(name), device="cpu", **settings))
    return _cpu[key]


def share_of_differing(image, reference):
    """The share of pixels that are not equal to 1e-3."""
    error = np.abs(image - reference).max(axis=2)
    return (error > 1e-3 * np.maximum(reference.max(axis=2), 1.0)).mean()


def assert_alike(image, reference, differing=0.01):
    """Almost all pixels equal to 1e-3; where rounding sends a path another way, one differs."""
    image, reference = np.asarray(image), np.asarray(reference)
    assert image.shape == reference.shape
    assert share_of_differing(image, reference) <= differing
    np.testing.assert_allclose(image.mean(axis=(0, 1)), reference.mean(axis=(0, 1)), rtol=5e-3)


_SCENES = ("primitives", "textures", "cornell-box-glass", "lights", "knot40k", "forest")


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("scene", [*_SCENES, "materials", "many-lamps"])
def test_scenes(gpu, scene, kernel):
    image = render(builtin(scene), device=gpu, kernel=kernel, width=96, spp=16)
    assert_alike(image, on_cpu(scene, width=96, spp=16), differing=0.02)


@pytest.mark.parametrize("kernel", KERNELS)
def test_glass_in_which_rounding_grows_from_surface_to_surface(gpu, kernel):
    scene = builtin("glass-of-water")
    few = {"width": 96, "spp": 16}
    assert_alike(
        render(scene, device=gpu, kernel=kernel, max_depth=2, **few), on_cpu("glass-of-water", max_depth=2, **few)
    )
    # With more surfaces, as many pixels may differ as where the camera has moved by a ten-millionth on the CPU.
    reference = on_cpu("glass-of-water", **few)
    image = render(scene, device=gpu, kernel=kernel, **few)
    camera = scene.camera(None)
    scene.cameras = [attrs.evolve(camera, position=tuple(np.multiply(camera.position, 1 + 1e-7)))]
    sensitive = share_of_differing(np.asarray(render(scene, device="cpu", **few)), reference)
    assert_alike(image, reference, differing=1.5 * sensitive)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(
    "settings",
    [
        {"width": 61, "height": 37},
        {"width": 96, "crop": (13, 5, 70, 42)},
        {"width": 32, "first_sample": 1000},
        {"width": 1, "height": 1, "spp": 512},
        {"width": 64, "spp": 1},
        {"width": 64, "max_depth": 0},
    ],
    ids=["odd size", "crop", "later samples", "one pixel", "one sample", "emission only"],
)
def test_sizes_and_samples(gpu, kernel, settings):
    settings = {"spp": 16, **settings}
    image = render(builtin("primitives"), device=gpu, kernel=kernel, **settings)
    assert_alike(image, on_cpu("primitives", **settings), differing=0.02)


@pytest.mark.parametrize("settings", [{"width": 61, "height": 37, "spp": 48}, {"width": 512, "spp": 8}])
def test_materials_that_are_sorted_within_blocks(gpu, settings):
    # The first is rendered in many planes of slots, with a last block that is not full.
    image = render(builtin("materials"), device=gpu, kernel="wavefront", **settings)
    assert_alike(image, on_cpu("materials", **settings), differing=0.02)


@pytest.mark.parametrize("integrator", ["whitted", "albedo", "normal", "depth", "ao"])
def test_integrators(gpu, integrator):
    settings = {"width": 80, "spp": 4, "integrator": integrator}
    assert_alike(render(builtin("lights"), device=gpu, **settings), on_cpu("lights", **settings), differing=0.03)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(
    "settings",
    [
        {"projection": "orthographic", "filter": "gaussian"},
        {"projection": "panorama", "aperture": 0.02, "filter": "mitchell"},
        {"projection": "fisheye", "filter": "blackman-harris"},
        {"projection": "fisheye-equisolid", "filter": "mitchell", "crop": (10, 20, 70, 61)},
    ],
    ids=lambda settings: settings["projection"],
)
def test_cameras_and_filters(gpu, kernel, settings):
    settings = {"width": 96, "spp": 16, **settings}
    image = render(builtin("primitives"), device=gpu, kernel=kernel, **settings)
    assert_alike(image, on_cpu("primitives", **settings), differing=0.02)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_render_that_stops_and_goes_on_is_the_same_picture(gpu, tmp_path, kernel):
    settings = RenderSettings(width=64, spp=40, kernel=kernel)
    straight = render(builtin("primitives"), device=gpu, **attrs.asdict(settings))
    file = tmp_path / "render.ckpt"
    session = Session(builtin("primitives"), settings, device=gpu, checkpoint=file)
    for _ in session:
        break
    stopped = session.film.samples
    assert 0 < stopped <= 40
    resumed = Session(builtin("primitives"), settings, device=gpu, checkpoint=file, resume=True)
    assert resumed.resumed == stopped
    assert_alike(resumed.run(), straight, differing=0.0)


def test_an_image_in_the_middle_has_all_of_its_samples(gpu):
    session = Session(builtin("primitives"), device=gpu, width=64, spp=1 << 14)
    for count, _ in enumerate(session):
        image = session.image()
        assert image.metadata["samples"] == session.film.samples
        if count == 3:
            break
    assert isinstance(image, Image)
    assert_alike(image, on_cpu("primitives", width=64, spp=1024), differing=1.0)


def test_every_gpu_together_makes_the_same_picture(gpu):
    image = render(builtin("primitives"), device="cuda:all", width=96, spp=16)
    assert_alike(image, on_cpu("primitives", width=96, spp=16), differing=0.02)
