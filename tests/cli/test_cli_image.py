"""`lumipath image`."""

import errno
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from lumipath.imaging import denoising
from lumipath.imaging.falsecolour import colour_map
from lumipath.rendering.checkpoint import Checkpoint
from lumipath.rendering.image import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))

from test_checkpoint import checkpoint_of, film_of


@pytest.fixture
def files(tmp_path):
    """Two images of noise, a.exr and b.exr."""
    random = np.random.default_rng(1)
    for name in "ab":
        Image(random.uniform(0, 2, (24, 32, 3)), {"samples": 4, "seed": 7}).save(tmp_path / f"{name}.exr")
    return tmp_path


def one_line(err):
    return err.startswith("lumipath: error: ") and err.count("\n") == 1


class TestInfo:
    def test_table(self, lumipath, files):
        code, out, err = lumipath("image", "info", "a.exr")
        assert (code, err) == (0, "")
        rows = dict(line.split(None, 1) for line in out.splitlines())
        assert rows["size"] == "32 x 24 pixels"
        assert rows["G"].startswith("float, 0.0")
        assert rows["seed"] == "7"

    def test_json(self, lumipath, files):
        assert json.loads(lumipath("image", "info", "a.exr", "--json")[1])["metadata"]["samples"] == 4

    def test_checkpoint(self, lumipath, tmp_path):
        checkpoint_of(seed=5, first_sample=8).save(tmp_path / "a.ckpt")
        out = lumipath("image", "info", "a.ckpt")[1]
        assert "samples 8 to 11 of seed 5" in out
        assert json.loads(lumipath("image", "info", "a.ckpt", "--json")[1])["rejected"] == 3

    @pytest.mark.parametrize("name", ["missing.exr", "missing.ckpt", "."])
    def test_missing(self, lumipath, name):
        code, out, err = lumipath("image", "info", name)
        assert (code, out) == (3, "")
        assert one_line(err)


class TestDiff:
    def test_text(self, lumipath, files):
        code, out, err = lumipath("image", "diff", "a.exr", "b.exr")
        assert (code, err) == (0, "")
        rows = dict(line.split(None, 1) for line in out.splitlines())
        assert 0.3 < float(rows["mse"]) < 1.2
        assert rows["psnr"].endswith(" dB")

    @pytest.mark.parametrize("flag", ["-o", "--heat-map"])
    def test_json_and_map(self, lumipath, files, flag):
        pytest.importorskip("flip_evaluator", reason="needs the extra 'flip'")
        code, out, _ = lumipath("image", "diff", "a.exr", "b.exr", "--json", flag, "map.png")
        assert code == 0
        facts = json.loads(out)
        assert list(facts) == ["mse", "relative_mse", "psnr", "flip", "flip_kind", "not_finite"]
        assert facts["flip_kind"] == "HDR"
        assert Image.load(files / "map.png").shape == (24, 32, 3)

    def test_8_bit_files_are_compared_as_they_are(self, lumipath, files):
        Image.load(files / "a.exr").save(files / "a.png")
        facts = json.loads(lumipath("image", "diff", "a.png", "a.exr", "--json")[1])
        assert facts["flip_kind"] == "LDR"
        assert facts["psnr"] > 50

    @pytest.mark.parametrize(("limit", "code"), [("mse=5", 0), ("mse=0.01", 1), ("relative_mse=0", 1)])
    def test_limits(self, lumipath, files, limit, code):
        found, out, err = lumipath("image", "diff", "a.exr", "b.exr", "--fail-above", limit)
        assert found == code
        assert "mse" in out
        assert (one_line(err) and "above" in err) if code else err == ""

    @pytest.mark.parametrize("limit", ["mse", "psnr=3", "mse=x", "mse=-1", "mse=nan"])
    def test_wrong_limits(self, lumipath, files, limit):
        code, out, err = lumipath("image", "diff", "a.exr", "b.exr", "--fail-above", limit)
        assert (code, out) == (2, "")
        assert "it must be NAME=X, NAME one of mse, relative_mse, flip" in err

    def test_other_sizes(self, lumipath, files):
        Image(np.zeros((2, 2, 3))).save(files / "c.exr")
        code, out, err = lumipath("image", "diff", "a.exr", "c.exr")
        assert (code, out) == (3, "")
        assert err == "lumipath: error: the images differ in size: 32 x 24 and 2 x 2\n"


class TestTonemap:
    def test_is_what_save_does(self, lumipath, files):
        assert lumipath("image", "tonemap", "a.exr", "-o", "a.png", "--exposure", 1, "--tonemap", "reinhard")[0] == 0
        expected = Image.load(files / "a.exr").to_uint8(exposure=1, tonemap="reinhard")
        np.testing.assert_array_equal(Image.load(files / "a.png").to_uint8(), expected)

    def test_false_colour(self, lumipath, tmp_path):
        Image(np.full((2, 2, 3), 0.18)).save(tmp_path / "a.exr")
        code = lumipath(
            "image", "tonemap", "a.exr", "-o", "a.png", "--false-colour", "--stops", "-4,4", "--exposure", 2
        )[0]
        assert code == 0
        expected = Image(colour_map(np.full((2, 2), 0.75))).to_uint8()
        np.testing.assert_allclose(Image.load(tmp_path / "a.png").to_uint8(), expected, atol=1)

    @pytest.mark.parametrize(
        ("arguments", "code", "message"),
        [
            (("-o", "b.exr"), 3, "only 8-bit files are tone mapped"),
            (("-o", "b.png", "--false-colour", "--stops", "a"), 2, "--stops is 'a': it must be LOW,HIGH"),
            (("-o", "b.png", "--false-colour", "--stops", "2,1"), 2, "the first must be below the second"),
            (("-o", "b.png", "--tonemap", "film"), 2, "tonemap is 'film'"),
            (("-o", "no/b.png"), 3, "there is no folder"),
            ((), 2, "Missing option"),
        ],
    )
    def test_errors(self, lumipath, files, arguments, code, message):
        found, _, err = lumipath("image", "tonemap", "a.exr", *arguments)
        assert found == code
        assert one_line(err)
        assert message in err


class TestDenoise:
    def test_writes_an_image_that_says_so(self, lumipath, files):
        pytest.importorskip("mitsuba_oidn", reason="needs the extra 'denoise'")
        assert lumipath("image", "denoise", "a.exr", "-o", "b.exr", "--albedo", "a.exr", "--normal", "b.exr")[0] == 0
        assert Image.load(files / "b.exr").metadata["denoiser"].startswith("Open Image Denoise")

    def test_layers_of_the_image_are_used(self, lumipath, files, monkeypatch):
        pytest.importorskip("mitsuba_oidn", reason="needs the extra 'denoise'")
        from test_imaging import write_exr

        side = np.full((16, 16), 0.5)
        layers = {f"albedo__{part}": side for part in "RGB"} | {f"normal__{part}": side for part in "XYZ"}
        write_exr(files / "c.exr", R=side, G=side, B=side, **layers)
        import mitsuba_oidn

        given = {}
        monkeypatch.setattr(mitsuba_oidn, "denoise", lambda pixels, hdr, **guides: given.update(guides) or pixels)
        assert lumipath("image", "denoise", "c.exr", "-o", "d.exr")[0] == 0
        assert given["albedo"].shape == given["normal"].shape == (16, 16, 3)
        assert Image.load(files / "d.exr").layer_names == ("albedo", "normal")
        # Files for looking at have no room for them.
        assert lumipath("image", "denoise", "c.exr", "-o", "d.png")[0] == 0
        assert lumipath("image", "tonemap", "c.exr", "-o", "e.png")[0] == 0

    def test_layers_are_listed(self, lumipath, files):
        Image(np.zeros((2, 2, 3)), layers={"depth": np.ones((2, 2)), "uv": np.ones((2, 2, 2))}).save(files / "c.exr")
        code, out, _ = lumipath("image", "info", "c.exr")
        assert code == 0
        assert "depth, uv" in out
        assert "depth.Z" in out

    def test_normals_need_floats(self, lumipath, files):
        code, _, err = lumipath("image", "denoise", "a.exr", "-o", "b.exr", "--normal", "n.png")
        assert code == 3
        assert "cannot hold normals" in err

    def test_without_the_library(self, lumipath, files, fake, monkeypatch):
        monkeypatch.setattr(denoising, "find_spec", lambda name: None)
        for arguments in (("image", "denoise", "a.exr", "-o", "b.exr"), ("render", "--denoise", "-w", 4)):
            code, _, err = lumipath(*arguments)
            assert (code, fake) == (2, [])
            assert one_line(err)
            assert "pip install 'lumipath[denoise]'" in err


class TestRender:
    def test_denoise(self, lumipath, fake, tmp_path):
        pytest.importorskip("mitsuba_oidn", reason="needs the extra 'denoise'")
        assert lumipath("render", "-w", 16, "-s", 1, "-o", "a.exr", "--denoise")[0] == 0
        assert "denoiser" in Image.load(tmp_path / "a.exr").metadata

    def test_a_failing_denoiser_does_not_lose_the_render(self, lumipath, fake, tmp_path, monkeypatch):
        mitsuba_oidn = pytest.importorskip("mitsuba_oidn", reason="needs the extra 'denoise'")

        def fail(*_, **__):
            raise RuntimeError("no memory")

        monkeypatch.setattr(mitsuba_oidn, "denoise", fail)
        code, _, err = lumipath("render", "-w", 4, "-s", 1, "--denoise")
        assert code == 0
        assert "warning: Open Image Denoise failed: no memory; the image is written with its noise" in err
        assert (tmp_path / "cornell-box.png").exists()

    def test_an_image_that_cannot_be_written_any_more_is_rescued(self, lumipath, fake, tmp_path, monkeypatch):
        (tmp_path / "rescue").mkdir()
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "rescue"))
        replace = Path.replace

        def full(self, target):
            if target.name == "a.png":
                raise OSError(errno.ENOSPC, "No space left on device")
            return replace(self, target)

        monkeypatch.setattr(Path, "replace", full)
        code, _, err = lumipath("render", "-w", 4, "-s", 1, "-o", "a.png")
        assert code == 3
        (rescued,) = (tmp_path / "rescue").glob("*/a.exr")
        assert one_line(err)
        assert err.endswith(f"a.png: cannot be written: No space left on device; the image is in {rescued}\n")
        assert (Image.load(rescued).pixels == 0.5).all()


class TestMerge:
    @pytest.fixture
    def kept(self, tmp_path):
        for name, count, settings in (("a", 4, {}), ("b", 6, {"seed": 1}), ("c", 4, {"max_depth": 2, "seed": 2})):
            checkpoint_of(film_of(count), **settings).save(tmp_path / f"{name}.ckpt")
        return tmp_path

    def test_to_a_checkpoint(self, lumipath, kept):
        assert lumipath("image", "merge", "a.ckpt", "b.ckpt", "-o", "sum.ckpt") == (0, "", "")
        assert Checkpoint.load(kept / "sum.ckpt").film.samples == 10

    def test_to_an_image(self, lumipath, kept):
        assert lumipath("image", "merge", "a.ckpt", "b.ckpt", "-o", "sum.exr")[0] == 0
        image = Image.load(kept / "sum.exr")
        assert image.metadata["samples"] == 10
        expected = (film_of(4).total + film_of(6).total) / 10
        np.testing.assert_allclose(image.pixels, expected, rtol=1e-6)

    @pytest.mark.parametrize(
        ("names", "message"),
        [
            (("a.ckpt", "a.ckpt"), "both hold samples 0 to 3 of seed 0"),
            (("a.ckpt", "c.ckpt"), "max_depth is 2 there and 12 here"),
            (("a.ckpt", "d.ckpt"), "No such file"),
        ],
    )
    def test_refusals(self, lumipath, kept, names, message):
        code, out, err = lumipath("image", "merge", *names, "-o", "sum.ckpt")
        assert (code, out) == (3, "")
        assert one_line(err)
        assert message in err
        assert not (kept / "sum.ckpt").exists()
