"""Layers of an image in memory and in files, their registry, and how much memory they may take."""

import json
import zipfile

import numpy as np
import pytest

from lumipath.errors import ImageError, UsageError
from lumipath.pack.geometry import flatten, shape_numbers
from lumipath.pack.layout import LayerColumns
from lumipath.pack.materials import MaterialTable
from lumipath.rendering import memory
from lumipath.rendering.image import SUFFIXES, Image
from lumipath.rendering.layer_film import LAYER_SAMPLES, LayerFilm
from lumipath.rendering.layers import REGISTRY, Made
from lumipath.scene import Box, Camera, Cone, Scene, Sphere
from lumipath.settings import LAYERS, RenderSettings

HEIGHT, WIDTH = 3, 4


def layer(name, seed=1):
    """Random values of the right shape and kind for a layer."""
    random, shape = np.random.default_rng(seed), (HEIGHT, WIDTH, len(REGISTRY[name].channels))
    if REGISTRY[name].is_whole:
        return random.integers(-1, 1 << 24, shape).astype(np.int32)
    return random.normal(0, 100, shape).astype(np.float32)


@pytest.fixture
def image():
    """An image with every layer, in an order of its own."""
    pixels = np.random.default_rng(7).uniform(0, 5, (HEIGHT, WIDTH, 3))
    matrix = tuple(float(k) / 2 for k in range(16))
    metadata = {"samples": 4.0, "seed": 3, "object_names": '["floor"]', "worldToCamera": matrix}
    return Image(pixels, metadata, {name: layer(name, k) for k, name in enumerate(reversed(REGISTRY))})


class TestRegistry:
    def test_settings_and_registry_name_the_same_layers(self):
        # One name stands for as many layers as a scene has groups.
        assert tuple(REGISTRY) == tuple(name for name in LAYERS if name != "light_groups")

    def test_the_kernel_fills_what_is_a_mean(self):
        means = {name for name, entry in REGISTRY.items() if entry.made in (Made.SAMPLES, Made.HITS)}
        assert set(LayerColumns._fields) == means

    def test_channels_are_those_of_the_conventions(self):
        names = [name for entry in REGISTRY.values() for name in entry.channel_names]
        assert len(set(names)) == len(names)
        assert {"albedo.R", "normal.X", "depth.Z", "position.X", "uv.U", "object_id.I", "material_id.I"} <= set(names)

    def test_shapes_are_numbered_as_they_are_packed(self):
        scene = Scene(shapes=[Sphere(), Box(), Cone(), Box(), Sphere()])
        geometry = flatten(scene, MaterialTable())
        assert shape_numbers(scene).tolist() == [1] * 12 + [3] * 12 + [0, 2, 4]
        assert len(shape_numbers(scene)) == len(geometry.faces) + len(geometry.quadrics)
        assert shape_numbers(Scene()).tolist() == []


class TestSetting:
    @pytest.mark.parametrize("given", [("depth", "uv"), ["depth", "uv"]])
    def test_names(self, given):
        assert RenderSettings(aov=given).aov == ("depth", "uv")

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            (("albdo",), "aov names 'albdo': the layers are albedo, .*, samples; did you mean albedo"),
            (("depth", 3), "aov names 3: the layers are"),
            (("depth", "uv", "depth"), "aov names depth twice"),
            ("depth", "aov is 'depth': it must be a tuple of layers, of albedo, "),
            (None, "aov is None"),
        ],
    )
    def test_errors(self, given, message):
        with pytest.raises(UsageError, match=message):
            RenderSettings(aov=given)


class TestImage:
    def test_layers_by_name(self, image):
        assert image.layer_names == tuple(reversed(REGISTRY))
        assert image["depth"].shape == (HEIGHT, WIDTH, 1)
        assert image["normal"].dtype == np.float32
        assert image["object_id"].dtype == np.int32
        assert "layers='samples, " in repr(image)
        assert "worldToCamera" not in repr(image)

    def test_kinds_and_shapes_of_what_is_given(self):
        made = Image(np.zeros((2, 3, 3)), layers={"mask": np.ones((2, 3), np.uint8), "x": np.ones((2, 3, 2))})
        assert (made["mask"].shape, made["mask"].dtype) == ((2, 3, 1), np.int32)
        assert (made["x"].shape, made["x"].dtype) == ((2, 3, 2), np.float32)

    @pytest.mark.parametrize("shape", [(3, 2), (2, 3, 1, 1), (6,), (2, 3, 0)])
    def test_other_shapes(self, shape):
        with pytest.raises(ImageError, match=r"layer x has the shape .*, the image 2 x 3 pixels"):
            Image(np.zeros((2, 3, 3)), layers={"x": np.zeros(shape)})

    def test_unknown_layers(self, image):
        with pytest.raises(UsageError, match=r"no layer 'dept': it has samples, .*albedo"):
            image["dept"]
        with pytest.raises(UsageError, match=r"no layer 'depth': it has none; render it with aov="):
            Image(np.zeros((2, 3, 3)))["depth"]

    def test_some_of_them(self, image):
        assert image.select_layers("uv", "depth", "light").layer_names == ("uv", "depth")
        assert image.select_layers().layer_names == ()
        assert image.select_layers().metadata == image.metadata

    def test_a_notebook_shows_the_image_and_every_layer(self, image):
        assert image._repr_png_().startswith(b"\x89PNG")
        page = image._repr_html_()
        assert page.count("data:image/png;base64,") == 1 + len(image.layers)
        for name in image.layer_names:
            assert f"<br>{name}</span>" in page
        assert "samples 4" in page
        assert "worldToCamera" not in page


class TestShow:
    def test_the_image_with_exposure_and_tone_map(self, image):
        np.testing.assert_array_equal(image.show(1.5, "agx").pixels, image.to_uint8(1.5, "agx"))
        assert image.show()._repr_png_() == image._repr_png_()

    def test_light_has_exposure(self):
        grey = np.full((2, 3, 3), 0.125)
        image = Image(grey, layers={"direct": grey, "light_key": grey, "variance": grey**2, "albedo": grey})
        for name in ("direct", "light_key", "variance"):
            assert (image.show(exposure=2, layer=name).pixels == 188).all()
        assert (image.show(exposure=2, layer="albedo").pixels == image.show(layer="direct").pixels).all()

    def test_normals(self):
        image = Image(np.zeros((1, 2, 3)), layers={"normal": [[(0, 0, 1), (-1, 0, 0)]]})
        assert image.show(layer="normal").pixels.tolist() == [[[128, 128, 255], [0, 128, 128]]]

    def test_distances_and_counts_are_shares_of_the_greatest(self):
        image = Image(
            np.zeros((1, 3, 3)), layers={"depth": np.array([[0, 5.0, 10]]), "samples": np.array([[32, 64, 64]])}
        )
        assert image.show(layer="depth").pixels[0, :, 0].tolist() == [0, 128, 255]
        assert image.show(layer="samples").pixels[0, :, 2].tolist() == [128, 255, 255]

    def test_places_and_uv(self):
        image = Image(np.zeros((1, 2, 3)), layers={"position": [[(-1, 0, 1), (1, 1, 1)]], "uv": [[(0, 0), (1, 0.5)]]})
        assert image.show(layer="position").pixels[0].tolist() == [[0, 128, 255], [255, 255, 255]]
        assert image.show(layer="uv").pixels[0].tolist() == [[0, 0, 0], [255, 128, 0]]

    def test_numbers_have_colours_of_their_own_and_nothing_is_black(self):
        image = Image(np.zeros((1, 9, 3)), layers={"object_id": np.arange(-1, 8)[None]})
        shown = image.show(layer="object_id").pixels[0]
        assert not shown[0].any()
        assert len({tuple(colour) for colour in shown.tolist()}) == 9

    def test_values_that_are_not_finite(self):
        image = Image(
            np.zeros((1, 2, 3)), layers={"depth": np.array([[np.inf, 2.0]]), "mine": np.full((1, 2, 4), np.nan)}
        )
        assert image.show(layer="depth").pixels[0, :, 0].tolist() == [0, 255]
        assert not image.show(layer="mine").pixels.any()

    def test_small_pictures_are_small(self):
        image = Image(np.zeros((300, 1000, 3)))
        assert image.show().smaller(160).pixels.shape[1] <= 160
        assert image.show().smaller(2000).pixels.shape == (300, 1000, 3)

    def test_errors(self, image):
        with pytest.raises(UsageError, match="no layer 'dept'"):
            image.show(layer="dept")
        with pytest.raises(UsageError, match="tonemap is 'acse'"):
            image.show(layer="depth", tonemap="acse")

    def test_names_are_escaped(self):
        image = Image(np.zeros((1, 1, 3)), {"scene": "<b>"}, {"a<b": np.zeros((1, 1))})
        assert "<b>" not in image._repr_html_()


class TestFiles:
    @pytest.mark.parametrize("suffix", [".exr", ".npz"])
    def test_round_trip(self, tmp_path, image, suffix):
        image["position"][0, 0] = (np.nan, np.inf, -1e30)
        image.save(tmp_path / f"a{suffix}")
        again = Image.load(tmp_path / f"a{suffix}")
        np.testing.assert_array_equal(again.pixels, image.pixels)
        assert set(again.layer_names) == set(image.layer_names)
        for name in REGISTRY:
            assert again[name].dtype == image[name].dtype
            np.testing.assert_array_equal(again[name], image[name])
        assert again.metadata == image.metadata

    def test_exr_has_one_part_of_named_float_channels(self, tmp_path, image):
        import OpenImageIO

        image.save(tmp_path / "a.exr")
        source = OpenImageIO.ImageInput.open(str(tmp_path / "a.exr"))
        names = [name for entry in REGISTRY.values() for name in entry.channel_names]
        assert set(source.spec().channelnames) == {"R", "G", "B", *names}
        assert source.spec().format == OpenImageIO.FLOAT
        assert not source.seek_subimage(1, 0)
        matrix = next(entry for entry in source.spec().extra_attribs if entry.name == "worldToCamera")
        assert str(matrix.type) == "matrix"
        source.close()

    def test_layers_of_other_programs(self, tmp_path):
        from test_imaging import write_exr

        side = np.arange(12.0).reshape(HEIGHT, WIDTH)
        given = {f"Combined__{part}": side + k for k, part in enumerate("BGR")} | {"mask__Y": side, "Z": side}
        write_exr(tmp_path / "a.exr", R=side, G=side, B=side, **given)
        image = Image.load(tmp_path / "a.exr")
        assert sorted(image.layer_names) == ["Combined", "mask"]
        assert image["Combined"][0, 0].tolist() == [2, 1, 0]
        image.save(tmp_path / "b.exr")
        np.testing.assert_array_equal(Image.load(tmp_path / "b.exr")["Combined"], image["Combined"])

    def test_npz_is_for_numpy(self, tmp_path, image):
        image.save(tmp_path / "a.npz")
        with np.load(tmp_path / "a.npz") as archive:
            assert sorted(archive.files) == sorted(["image", "metadata", *REGISTRY])
            np.testing.assert_array_equal(archive["image"], image.pixels)
            np.testing.assert_array_equal(archive["object_id"], image["object_id"])
            assert json.loads(str(archive["metadata"]))["seed"] == 3

    def test_metadata_of_numpy(self, tmp_path):
        given = {"seed": np.int64(3), "matrix": np.arange(16.0), "gone": None}
        Image(np.zeros((2, 2, 3)), given).save(tmp_path / "a.npz")
        assert Image.load(tmp_path / "a.npz").metadata == {"seed": 3, "matrix": tuple(range(16))}

    @pytest.mark.parametrize("suffix", [suffix for suffix in SUFFIXES if suffix not in (".exr", ".npz")])
    def test_other_formats_say_which_hold_layers(self, tmp_path, image, suffix):
        target = tmp_path / f"a{suffix}"
        target.write_bytes(b"earlier")
        with pytest.raises(
            ImageError, match=r"the layers samples, .* fit only into \.exr and \.npz files; .*select_la"
        ):
            image.save(target)
        assert target.read_bytes() == b"earlier"
        image.select_layers().save(target)
        assert Image.load(target).width == WIDTH

    def test_a_layer_may_have_any_name_in_npz_but_two(self, tmp_path):
        odd = {"file": np.ones((1, 1)), "args": np.ones((1, 1))}
        Image(np.zeros((1, 1, 3)), layers=odd).save(tmp_path / "a.npz")
        assert Image.load(tmp_path / "a.npz").layer_names == ("file", "args")
        with pytest.raises(ImageError, match="cannot be called image"):
            Image(np.zeros((1, 1, 3)), layers={"image": np.ones((1, 1))}).save(tmp_path / "b.npz")
        assert not (tmp_path / "b.npz").exists()

    def test_damaged_archives(self, tmp_path, image):
        np.savez(tmp_path / "other.npz", x=np.ones(3))
        np.savez(tmp_path / "objects.npz", image=np.array([{}]))
        np.savez(tmp_path / "texts.npz", image=np.ones((2, 2, 3)), name=np.array("text"))
        image.save(tmp_path / "whole.npz")
        content = bytearray((tmp_path / "whole.npz").read_bytes())
        (tmp_path / "short.npz").write_bytes(content[:-30])
        with zipfile.ZipFile(tmp_path / "whole.npz") as archive:
            at = archive.getinfo("depth.npy").header_offset + 200
        content[at] ^= 255
        (tmp_path / "changed.npz").write_bytes(content)
        with (tmp_path / "array.npz").open("wb") as file:
            np.save(file, np.ones((2, 2, 3)))
        for name in ("other", "objects", "texts", "short", "changed", "array"):
            with pytest.raises(ImageError, match=r"\.npz: cannot be read: ") as caught:
                Image.load(tmp_path / f"{name}.npz")
            assert "\n" not in str(caught.value)

    def test_archives_of_other_arrays(self, tmp_path):
        np.savez(tmp_path / "a.npz", image=np.zeros((2, 2)))
        with pytest.raises(ImageError, match="height x width x 3"):
            Image.load(tmp_path / "a.npz")


class TestLayerFilm:
    def test_memory_is_asked_for_before_it_is_taken(self, monkeypatch):
        monkeypatch.setattr(memory, "available_memory", lambda: 1_000_000)
        with pytest.raises(
            UsageError, match="1000 x 1000 pixels need 52000000 bytes for the layers normal, and 1000000"
        ):
            LayerFilm(["normal"], 1000, 1000, 4)
        assert LayerFilm(["normal"], 100, 100, 4).arrays.sums.shape == (100, 100, 3)

    def test_the_count_of_samples_alone_needs_no_rays(self):
        film = LayerFilm(["samples"], 3, 2, 99)
        assert film.is_complete
        counts = np.array([[1, 2, 3], [4, 5, (1 << 32) - 1]], np.uint32)
        assert film.layers(counts, None, None)["samples"][..., 0].tolist() == [[1, 2, 3], [4, 5, (1 << 31) - 1]]

    def test_samples(self):
        assert [LayerFilm(["depth"], 2, 2, spp).samples for spp in (1, 64, 4096)] == [1, 64, LAYER_SAMPLES]


def test_matrices_of_a_camera():
    camera = Camera(position=(1, 2, 3), direction=(1, 0, 0), fov=90)
    to_camera = camera.world_to_camera()
    # Two metres ahead, one to the right, half a metre up.
    np.testing.assert_allclose(to_camera @ (3, 2.5, 4, 1), (1, 0.5, 2, 1), atol=1e-12)
    for window, expected in (((0, 0, 40, 20), (0.625, 0.375)), ((20, 0, 40, 10), (0.25, 0.75))):
        x, y, z, w = camera.camera_to_ndc(40, 20, window) @ (1, 0.5, 2, 1)
        np.testing.assert_allclose((x / w, y / w, z / w), (*expected, 0.5), atol=1e-12)
