import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lumipath.errors import ImageError, UsageError
from lumipath.rendering.image import SUFFIXES, Image, check_writable

METADATA = {"samples": 64, "seed": (1 << 32) - 1, "seconds": 1.5, "version": "0.1.0", "scene": "a box", "device": "cpu"}


@pytest.fixture
def pixels():
    return np.random.default_rng(7).uniform(0, 1, (6, 9, 3)).astype(np.float32)


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


class TestImage:
    def test_shape_and_sides(self, pixels):
        image = Image(pixels)
        assert (image.width, image.height, image.shape) == (9, 6, (6, 9, 3))

    def test_is_an_array(self, pixels):
        image = Image(pixels)
        assert np.array_equal(np.asarray(image), pixels)
        assert np.asarray(image).base is not None or np.shares_memory(np.asarray(image), image.pixels)
        assert np.asarray(image, np.float64).dtype == np.float64

    @pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (0, 4, 3), ()])
    def test_refuses_other_shapes(self, shape):
        with pytest.raises(ImageError, match="height x width x 3"):
            Image(np.zeros(shape))

    def test_shows_itself_in_a_notebook(self, pixels):
        assert Image(pixels)._repr_png_().startswith(b"\x89PNG")

    def test_repr_is_short(self, pixels):
        assert repr(Image(pixels, {"samples": 4})) == "Image(9 x 6, samples=4)"


class TestBytes:
    def test_linear_rounds_half_up(self):
        values = np.array([0, 0.5 / 255, 0.49 / 255, 0.5, 1, 7, -1, np.nan, 100 / 255], np.float32)
        image = Image(values[None, :, None].repeat(3, axis=2))
        assert image.to_uint8(tonemap="linear")[0, :, 0].tolist() == [0, 1, 0, 128, 255, 255, 0, 0, 100]

    def test_default_is_srgb(self):
        assert (Image(np.full((1, 1, 3), 0.5)).to_uint8() == 188).all()

    def test_exposure(self):
        assert (Image(np.full((1, 1, 3), 0.125)).to_uint8(exposure=2) == 188).all()


class TestRoundTrip:
    @pytest.mark.parametrize("suffix", [".exr", ".npy"])
    def test_float_formats_keep_everything(self, tmp_path, pixels, suffix):
        pixels[0, 0] = (np.nan, np.inf, -5)
        pixels[0, 1] = (1e-30, 1e30, 70000)
        Image(pixels).save(tmp_path / f"a{suffix}")
        assert np.array_equal(Image.load(tmp_path / f"a{suffix}").pixels, pixels, equal_nan=True)

    def test_npy_is_a_plain_array(self, tmp_path, pixels):
        Image(pixels).save(tmp_path / "a.npy")
        array = np.load(tmp_path / "a.npy")
        assert array.dtype == np.float32
        assert np.array_equal(array, pixels)

    def test_hdr_is_near(self, tmp_path, pixels):
        Image(20 * pixels).save(tmp_path / "a.hdr")
        np.testing.assert_allclose(Image.load(tmp_path / "a.hdr").pixels, 20 * pixels, atol=32 / 256)

    def test_hdr_has_no_nan(self, tmp_path, pixels):
        pixels[0, 0, 0] = np.nan
        Image(pixels).save(tmp_path / "a.hdr")
        assert (Image.load(tmp_path / "a.hdr").pixels[0, 0] == 0).all()

    def test_png_bytes_are_those_of_to_uint8(self, tmp_path, pixels):
        image = Image(pixels)
        image.save(tmp_path / "a.png", exposure=-1, tonemap="agx")
        again = Image.load(tmp_path / "a.png")
        assert np.array_equal(again.to_uint8(), image.to_uint8(exposure=-1, tonemap="agx"))

    @pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".JPG"])
    def test_jpeg_is_near(self, tmp_path, suffix):
        ramp = np.linspace(0, 1, 64, dtype=np.float32)[None, :, None] * np.ones((64, 1, 3), np.float32)
        Image(ramp).save(tmp_path / f"a{suffix}")
        np.testing.assert_allclose(Image.load(tmp_path / f"a{suffix}").pixels, ramp, atol=0.02)

    def test_same_image_same_png(self, tmp_path, pixels):
        Image(pixels, {"seconds": 1.0}).save(tmp_path / "a.png")
        Image(pixels, {"seconds": 2.0}).save(tmp_path / "b.png")
        assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()

    @pytest.mark.parametrize("tonemap", ["none", "agx"])
    def test_normals_are_shown_halved_and_moved_and_kept_in_exr(self, tmp_path, tonemap):
        normals = Image(np.float32([[(-1, 0, 1), (0.6, -0.6, 0)]]), {"integrator": "normal"})
        np.testing.assert_array_equal(normals.to_uint8(3.0, tonemap), [[(0, 128, 255), (204, 51, 128)]])
        normals.save(tmp_path / "a.exr")
        again = Image.load(tmp_path / "a.exr")
        np.testing.assert_array_equal(again.pixels, normals.pixels)
        np.testing.assert_array_equal(again.to_uint8(), normals.to_uint8())

    def test_exr_header(self, tmp_path, pixels):
        Image(pixels, METADATA).save(tmp_path / "a.exr")
        assert Image.load(tmp_path / "a.exr").metadata == METADATA

    def test_exr_header_keeps_matrices(self, tmp_path, pixels):
        Image(pixels, {"worldToCamera": np.arange(16.0).reshape(4, 4)}).save(tmp_path / "a.exr")
        assert Image.load(tmp_path / "a.exr").metadata["worldToCamera"] == tuple(range(16))

    def test_exr_channels_are_float_rgb(self, tmp_path, pixels):
        import OpenImageIO

        Image(pixels).save(tmp_path / "a.exr")
        spec = OpenImageIO.ImageInput.open(str(tmp_path / "a.exr")).spec()
        assert tuple(spec.channelnames) == ("R", "G", "B")
        assert spec.format == OpenImageIO.FLOAT


class TestSaving:
    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_leaves_only_the_file(self, tmp_path, pixels, suffix):
        Image(pixels).save(tmp_path / f"a{suffix}")
        assert names_in(tmp_path) == [f"a{suffix}"]

    def test_permissions_follow_the_umask(self, tmp_path, pixels):
        before = os.umask(0o027)
        try:
            Image(pixels).save(tmp_path / "a.png")
        finally:
            os.umask(before)
        assert (tmp_path / "a.png").stat().st_mode & 0o777 == 0o640

    def test_writes_through_a_link(self, tmp_path, pixels):
        (tmp_path / "real").mkdir()
        (tmp_path / "link.png").symlink_to(tmp_path / "real" / "a.png")
        Image(pixels).save(tmp_path / "link.png")
        assert (tmp_path / "link.png").is_symlink()
        assert (tmp_path / "real" / "a.png").exists()

    def test_a_failure_keeps_the_earlier_file(self, tmp_path, pixels, monkeypatch):
        (tmp_path / "a.png").write_bytes(b"earlier")

        def full(self, target):
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(Path, "replace", full)
        with pytest.raises(ImageError, match=r"a\.png: cannot be written: No space left"):
            Image(pixels).save(tmp_path / "a.png")
        assert (tmp_path / "a.png").read_bytes() == b"earlier"
        assert names_in(tmp_path) == ["a.png"]

    @pytest.mark.parametrize("suffix", SUFFIXES)
    def test_a_full_disk_is_one_error_and_no_litter(self, tmp_path, suffix):
        # A limit on the size of files stands for the full disk; it needs a process of its own.
        code = (
            "import resource, signal, sys, numpy as np\n"
            "from lumipath.rendering.image import Image\n"
            "from lumipath.errors import ImageError\n"
            "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
            "try:\n"
            "    Image(np.random.default_rng(1).random((300, 300, 3))).save(sys.argv[1])\n"
            "except ImageError as error:\n"
            "    print(error)\n"
        )
        target = tmp_path / f"a{suffix}"
        target.write_bytes(b"earlier")
        done = subprocess.run([sys.executable, "-c", code, target], capture_output=True, text=True, timeout=60)
        assert done.stdout.startswith(f"{target}: cannot be written: "), done.stderr
        assert done.stdout.count("\n") == 1
        assert target.read_bytes() == b"earlier"
        assert names_in(tmp_path) == [target.name]

    def test_unknown_tonemap_writes_nothing(self, tmp_path, pixels):
        with pytest.raises(UsageError):
            Image(pixels).save(tmp_path / "a.exr", tonemap="film")
        assert names_in(tmp_path) == []


class TestUnwritable:
    @pytest.fixture(params=["check_writable", "save"])
    def attempt(self, request, pixels):
        return check_writable if request.param == "check_writable" else Image(pixels).save

    def test_missing_folder(self, tmp_path, attempt):
        with pytest.raises(ImageError, match=r"there is no folder .*mkdir -p"):
            attempt(tmp_path / "no" / "a.png")

    def test_folder_is_a_file(self, tmp_path, attempt):
        (tmp_path / "file").touch()
        with pytest.raises(ImageError, match="is a file, not a folder"):
            attempt(tmp_path / "file" / "a.png")

    def test_directory(self, tmp_path, attempt):
        with pytest.raises(ImageError, match="is a directory; add a file name"):
            attempt(tmp_path)

    @pytest.mark.parametrize("name", ["a.tiff", "a", ".png"])
    def test_unknown_suffix(self, tmp_path, attempt, name):
        with pytest.raises(ImageError, match=r"use one of \.png, \.jpg, \.jpeg, \.exr, \.hdr, \.npy"):
            attempt(tmp_path / name)

    @pytest.mark.parametrize("name", ["x" * 300 + ".png", "a\0b.png"])
    def test_impossible_names(self, tmp_path, attempt, name):
        with pytest.raises(ImageError, match="cannot be written"):
            attempt(tmp_path / name)

    def test_not_a_regular_file(self, tmp_path, attempt):
        os.mkfifo(tmp_path / "pipe.png")
        with pytest.raises(ImageError, match="not a regular file"):
            attempt(tmp_path / "pipe.png")

    def test_read_only_file(self, tmp_path, attempt, monkeypatch):
        (tmp_path / "a.png").touch()
        monkeypatch.setattr(os, "access", lambda path, mode: False)
        with pytest.raises(ImageError, match="is read-only"):
            attempt(tmp_path / "a.png")

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
    def test_read_only_folder(self, tmp_path, attempt):
        (tmp_path / "locked").mkdir(mode=0o500)
        with pytest.raises(ImageError, match="no permission to write"):
            attempt(tmp_path / "locked" / "a.png")


def test_check_writable_leaves_nothing(tmp_path):
    check_writable(tmp_path / "a.png")
    assert names_in(tmp_path) == []


def test_check_writable_keeps_an_earlier_file(tmp_path):
    (tmp_path / "a.png").write_bytes(b"earlier")
    check_writable(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == b"earlier"


class TestLoading:
    def test_missing(self, tmp_path):
        with pytest.raises(ImageError, match="no such file"):
            Image.load(tmp_path / "a.png")

    def test_directory(self, tmp_path):
        (tmp_path / "a.png").mkdir()
        with pytest.raises(ImageError, match="is a directory"):
            Image.load(tmp_path / "a.png")

    @pytest.mark.parametrize("suffix", SUFFIXES)
    @pytest.mark.parametrize("content", [b"", b"not an image at all"])
    def test_damaged(self, tmp_path, suffix, content):
        path = tmp_path / f"a{suffix}"
        path.write_bytes(content)
        with pytest.raises(ImageError, match="cannot be read") as caught:
            Image.load(path)
        assert "\n" not in str(caught.value)

    def test_truncated_exr(self, tmp_path, pixels):
        Image(pixels).save(tmp_path / "a.exr")
        (tmp_path / "a.exr").write_bytes((tmp_path / "a.exr").read_bytes()[:-50])
        with pytest.raises(ImageError, match="cannot be read"):
            Image.load(tmp_path / "a.exr")

    def test_npy_of_another_shape(self, tmp_path):
        np.save(tmp_path / "a.npy", np.zeros((4, 4)))
        with pytest.raises(ImageError, match="height x width x 3"):
            Image.load(tmp_path / "a.npy")

    def test_npy_with_objects(self, tmp_path):
        np.save(tmp_path / "a.npy", np.array([{}]), allow_pickle=True)
        with pytest.raises(ImageError, match="cannot be read"):
            Image.load(tmp_path / "a.npy")

    def test_other_channels(self, tmp_path):
        import OpenImageIO

        data = np.arange(4, dtype=np.float32)[None, None, :].repeat(2, axis=0).repeat(2, axis=1).copy()
        spec = OpenImageIO.ImageSpec(2, 2, 4, OpenImageIO.FLOAT)
        spec.channelnames = ("A", "B", "G", "R")
        out = OpenImageIO.ImageOutput.create(str(tmp_path / "a.exr"))
        assert out.open(str(tmp_path / "a.exr"), spec)
        assert out.write_image(data)
        out.close()
        assert Image.load(tmp_path / "a.exr").pixels[0, 0].tolist() == [3, 2, 1]
