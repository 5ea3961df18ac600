"""Comparison, false colour, denoising, and facts about image files."""

import math
import os
import subprocess
import sys
from pathlib import Path

import attrs
import numpy as np
import pytest

import lumipath
from lumipath.errors import CheckpointError, ImageError, RenderError, UsageError
from lumipath.formats.srgb import encode_srgb
from lumipath.imaging import comparison, denoising
from lumipath.imaging.comparison import compare
from lumipath.imaging.denoising import denoise
from lumipath.imaging.falsecolour import colour_map, false_colour
from lumipath.imaging.files import open_image
from lumipath.imaging.statistics import describe
from lumipath.rendering.image import Image

SOURCES = str(Path(lumipath.__path__[0]).parent)


@pytest.fixture
def picture():
    return Image(np.random.default_rng(5).uniform(0.1, 2, (40, 56, 3)))


def noisy(image, amount, seed=1):
    noise = np.random.default_rng(seed).normal(0, amount, image.shape)
    return Image(np.maximum(image.pixels + noise, 0))


def write_exr(path, **channels):
    """An EXR file of single channels, whose names may have dots for double underscores."""
    import OpenImageIO

    names = [name.replace("__", ".") for name in channels]
    data = np.stack(list(channels.values()), axis=2).astype(np.float32)
    spec = OpenImageIO.ImageSpec(data.shape[1], data.shape[0], data.shape[2], OpenImageIO.FLOAT)
    spec.channelnames = names
    out = OpenImageIO.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(data)
    out.close()


class TestErrors:
    def test_by_hand(self):
        image, reference = Image(np.full((2, 2, 3), 0.5)), Image(np.full((2, 2, 3), 0.25))
        result = compare(image, reference)
        assert result.mse == pytest.approx(0.0625)
        assert result.relative_mse == pytest.approx(0.0625 / (0.0625 + 0.01))
        shown = float(encode_srgb(0.5) - encode_srgb(0.25))
        assert result.psnr == pytest.approx(-20 * math.log10(shown), rel=1e-5)

    def test_equal_images(self, picture):
        result = compare(picture, picture)
        assert (result.mse, result.relative_mse, result.psnr) == (0, 0, math.inf)
        assert result.as_dict()["psnr"] is None

    def test_pixels_that_are_not_finite_are_left_out_and_counted(self, picture):
        image = Image(picture.pixels.copy())
        image.pixels[3, 4, 1], image.pixels[5, 6] = np.nan, np.inf
        result = compare(image, picture)
        assert (result.mse, result.not_finite) == (0, 2)

    def test_only_bad_pixels(self):
        bad = Image(np.full((2, 2, 3), np.nan))
        with pytest.raises(ImageError, match="no pixel that is finite in both"):
            compare(bad, bad)

    def test_other_sizes(self, picture):
        with pytest.raises(ImageError, match="differ in size: 56 x 40 and 2 x 2"):
            compare(picture, Image(np.zeros((2, 2, 3))))


class TestFlip:
    @pytest.fixture(autouse=True)
    def _library(self):
        pytest.importorskip("flip_evaluator", reason="needs the extra 'flip'")

    @pytest.mark.parametrize("hdr", [False, True])
    def test_grows_with_the_noise(self, picture, hdr):
        errors = [compare(noisy(picture, amount), picture, hdr=hdr).flip for amount in (0.0, 0.02, 0.1, 0.4)]
        assert errors[0] < 1e-6
        assert errors == sorted(errors)
        assert errors[-1] < 1

    def test_ldr_is_blind_where_the_picture_is_white(self):
        image, reference = Image(np.full((16, 16, 3), 8.0)), Image(np.full((16, 16, 3), 4.0))
        assert compare(image, reference, hdr=False).flip < 1e-6
        assert compare(image, reference).flip > 0.1

    def test_its_map_shows_where(self, picture):
        image = Image(picture.pixels.copy())
        image.pixels[10:14, 40:44] = 5
        result = compare(image, picture)
        assert result.flip_map.shape == (40, 56)
        row, column = np.unravel_index(result.flip_map.argmax(), result.flip_map.shape)
        assert 10 <= row < 14
        assert 40 <= column < 44
        assert result.heat_map().shape == (40, 56, 3)
        assert result.flip == pytest.approx(result.flip_map.mean(), rel=1e-5)

    # The library ends the process where it finds no exposure: each in a process of its own.
    @pytest.mark.parametrize("scale", ["0.0", "1e-38", "1e-13", "1e30"])
    def test_dark_and_bright_references_do_not_end_the_process(self, scale):
        code = (
            "import numpy as np; from lumipath import Image, compare\n"
            f"reference = Image(np.full((8, 8, 3), {scale}))\n"
            "print(compare(Image(np.ones((8, 8, 3))), reference).flip >= 0)\n"
        )
        environment = {**os.environ, "PYTHONPATH": SOURCES}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, env=environment)
        assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr

    def test_without_the_library(self, picture, monkeypatch):
        monkeypatch.setattr(comparison, "find_spec", lambda name: None)
        result = compare(picture, picture)
        assert result.flip is None
        with pytest.raises(UsageError, match=r"pip install 'lumipath\[flip\]'"):
            result.heat_map()


class TestFalseColour:
    def test_map_ends_and_bad_values(self):
        shown = colour_map(np.array([[0.0, 1.0, -3.0, 7.0, np.nan, np.inf]]))
        # The ends of viridis, as published.
        np.testing.assert_allclose(encode_srgb(shown[0, :2]), [[0.267, 0.005, 0.329], [0.993, 0.906, 0.144]], atol=5e-3)
        np.testing.assert_array_equal(shown[0, 2:4], shown[0, :2])
        assert shown[0, 4:].tolist() == [[1, 0, 1]] * 2

    def test_brightness_grows_with_the_value(self):
        shown = colour_map(np.linspace(0, 1, 50)[None])[0] @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(shown) > 0).all()

    def test_stops_about_middle_grey(self):
        light = np.float32(0.18) * 2.0 ** np.array([[-2.0, 0.0, 2.0, 9.0]])
        image = Image(light[:, :, None].repeat(3, axis=2))
        expected = colour_map(np.array([[0.0, 0.5, 1.0, 1.0]]))
        np.testing.assert_allclose(false_colour(image, -2, 2).pixels, expected, atol=5e-3)

    def test_bad_pixels_and_black(self):
        image = Image(np.array([[[np.nan, 1, 1], [np.inf, 0, 0], [0, 0, 0], [-1, -1, -1]]]))
        shown = false_colour(image).pixels[0]
        assert shown[:2].tolist() == [[1, 0, 1]] * 2
        np.testing.assert_array_equal(shown[2:], colour_map(np.zeros((1, 2)))[0])

    def test_wrong_range(self, picture):
        with pytest.raises(UsageError, match="from 3 to 3 stops"):
            false_colour(picture, 3, 3)


class TestDenoising:
    @pytest.fixture(autouse=True)
    def _library(self):
        pytest.importorskip("mitsuba_oidn", reason="needs the extra 'denoise'")

    @pytest.fixture
    def steps(self):
        """Four grey fields, of which one is far above 1."""
        pixels = np.repeat(np.repeat([[0.1, 0.4], [0.9, 6.0]], 32, axis=0), 32, axis=1)
        return Image(pixels[:, :, None].repeat(3, axis=2), {"samples": 4})

    def test_noise_goes_and_the_picture_stays(self, steps):
        image = Image(steps.pixels * np.random.default_rng(2).gamma(4, 0.25, steps.shape), steps.metadata)
        result = denoise(image)
        before, after = (compare(i, steps).relative_mse for i in (image, result))
        assert after < before / 20
        assert result.pixels.mean() == pytest.approx(steps.pixels.mean(), rel=0.05)
        assert result.metadata["samples"] == 4
        assert result.metadata["denoiser"].startswith("Open Image Denoise ")

    def test_albedo_keeps_what_colour_alone_loses(self):
        random = np.random.default_rng(3)
        albedo = np.kron(random.choice([0.3, 0.6], (32, 32)), np.ones((3, 3)))[:, :, None] * np.ones(3)
        truth, normal = Image(albedo), np.zeros(albedo.shape) + [0, 0, 1]
        image = Image(albedo * random.gamma(1, 1, albedo.shape))
        alone, guided = denoise(image), denoise(image, albedo=albedo, normal=normal)
        assert compare(guided, truth).mse < compare(alone, truth).mse / 3

    def test_layers_of_the_image_are_the_guides(self, steps, monkeypatch):
        import mitsuba_oidn

        given = []
        monkeypatch.setattr(mitsuba_oidn, "denoise", lambda pixels, hdr, **guides: given.append(guides) or pixels)
        guide, other = np.full(steps.shape, 0.5, np.float32), np.full(steps.shape, 0.25, np.float32)
        image = attrs.evolve(steps, layers={"albedo": guide, "normal": other})
        assert denoise(image).layer_names == ("albedo", "normal")
        denoise(image, albedo=other)
        denoise(attrs.evolve(steps, layers={"normal": other}))
        assert [sorted(guides) for guides in given] == [["albedo", "normal"]] * 2 + [[]]
        np.testing.assert_array_equal([guides["albedo"][0, 0, 0] for guides in given[:2]], [0.5, 0.25])

    def test_bad_pixels_do_not_spread(self, steps):
        image = Image(steps.pixels.copy())
        image.pixels[5, 5], image.pixels[50, 50, 0], image.pixels[9, 40] = np.nan, np.inf, -3
        assert np.isfinite(denoise(image).pixels).all()

    def test_the_image_itself_is_not_changed(self, steps):
        before = steps.pixels.copy()
        denoise(steps)
        np.testing.assert_array_equal(steps.pixels, before)

    def test_other_sizes(self, steps):
        with pytest.raises(ImageError, match=r"albedo has the shape \(2, 2, 3\)"):
            denoise(steps, albedo=np.zeros((2, 2, 3)))

    def test_normals_alone(self, steps):
        with pytest.raises(UsageError, match="only together with albedo"):
            denoise(steps, normal=steps.pixels)

    def test_its_errors_are_one_line(self, steps, monkeypatch):
        import mitsuba_oidn

        def fail(*_, **__):
            raise RuntimeError("out of\nmemory")

        monkeypatch.setattr(mitsuba_oidn, "denoise", fail)
        with pytest.raises(RenderError, match="Open Image Denoise failed: out of memory"):
            denoise(steps)


def test_without_the_denoiser(picture, monkeypatch):
    monkeypatch.setattr(denoising, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"pip install 'lumipath\[denoise\]'"):
        denoise(picture)


class TestFiles:
    @pytest.fixture
    def kept(self, tmp_path):
        from test_checkpoint import checkpoint_of

        checkpoint = checkpoint_of(seed=3)
        checkpoint.save(tmp_path / "a.ckpt")
        return tmp_path / "a.ckpt", checkpoint

    def test_a_checkpoint_is_an_image(self, kept):
        path, checkpoint = kept
        np.testing.assert_array_equal(open_image(path).pixels, checkpoint.image().pixels)

    def test_what_is_neither(self, tmp_path):
        (tmp_path / "a.txt").write_text("text")
        with pytest.raises(CheckpointError, match=r"no checkpoint, or a damaged one.*; images end in \.png, "):
            open_image(tmp_path / "a.txt")

    def test_layers(self, tmp_path):
        side = np.arange(6.0).reshape(2, 3)
        layers = {"albedo__R": side, "albedo__G": side + 1, "albedo__B": side + 2}
        write_exr(tmp_path / "a.exr", R=side, G=side, B=side, **layers)
        image = open_image(tmp_path / "a.exr")
        assert image.layer_names == ("albedo",)
        np.testing.assert_array_equal(image["albedo"], np.stack([side, side + 1, side + 2], axis=2))

    def test_facts_of_an_exr(self, tmp_path, picture):
        image = attrs.evolve(picture, metadata={"samples": 8, "seed": 4})
        image.pixels[0, 0, 1] = np.nan
        image.save(tmp_path / "a.exr")
        facts = describe(tmp_path / "a.exr")
        assert (facts["width"], facts["height"], facts["format"]) == (56, 40, "exr")
        assert facts["metadata"] == {"samples": 8, "seed": 4}
        green = facts["channels"][1]
        assert (green["name"], green["type"], green["not_finite"]) == ("G", "float", 1)
        assert green["mean"] == pytest.approx(np.nanmean(image.pixels[:, :, 1], dtype=np.float64))
        assert green["max"] == np.nanmax(image.pixels[:, :, 1])

    def test_facts_of_other_files(self, tmp_path, picture):
        for suffix, kind in ((".png", "uint8"), (".npy", "float"), (".npz", "float"), (".hdr", "float")):
            picture.save(tmp_path / f"a{suffix}")
            facts = describe(tmp_path / f"a{suffix}")
            assert [channel["type"] for channel in facts["channels"]] == [kind] * 3
            assert facts["channels"][0]["max"] <= 2.1

    @pytest.mark.parametrize(("suffix", "kind"), [(".exr", "float"), (".npz", "int")])
    def test_layers_are_among_the_facts(self, tmp_path, picture, suffix, kind):
        layers = {"depth": np.full((40, 56), 2.5), "object_id": np.full((40, 56), 3)}
        attrs.evolve(picture, layers=layers).save(tmp_path / f"a{suffix}")
        facts = describe(tmp_path / f"a{suffix}")
        assert facts["layers"] == ["depth", "object_id"]
        found = {channel["name"]: (channel["type"], channel["mean"]) for channel in facts["channels"]}
        assert sorted(found) == ["B", "G", "R", "depth.Z", "object_id.I"]
        assert (found["depth.Z"], found["object_id.I"]) == (("float", 2.5), (kind, 3))

    def test_facts_of_a_checkpoint(self, kept):
        path, checkpoint = kept
        facts = describe(path)
        assert facts["format"] == "checkpoint"
        assert facts["ranges"] == [{"seed": 3, "first": 0, "stop": 4, "whole": True}]
        assert facts["samples_of_a_pixel"] == [4, 4]
        assert facts["scene_digest"] == checkpoint.identity.scene

    def test_an_image_without_a_finite_value(self, tmp_path):
        Image(np.full((2, 2, 3), np.nan)).save(tmp_path / "a.exr")
        channel = describe(tmp_path / "a.exr")["channels"][0]
        assert (channel["min"], channel["max"], channel["not_finite"]) == (0, 0, 4)

    @pytest.mark.parametrize("name", ["a.exr", "a.npy", "a.png"])
    def test_missing(self, tmp_path, name):
        with pytest.raises(ImageError, match="no such file"):
            describe(tmp_path / name)
