"""`lumipath render --aov`: layers beside the image."""

import json
import signal

import pytest

from lumipath.rendering.image import Image


def test_layers_are_written_and_listed(lumipath, fake, tmp_path):
    assert lumipath("render", "-w", 8, "-s", 1, "--aov", "albedo, depth,object_id", "-o", "a.exr")[0] == 0
    assert fake[0].settings.aov == ("albedo", "depth", "object_id")
    assert Image.load(tmp_path / "a.exr").layer_names == ("albedo", "depth", "object_id")
    code, out, _ = lumipath("image", "info", "a.exr", "--json")
    assert code == 0
    assert json.loads(out)["layers"] == ["albedo", "depth", "object_id"]


def test_an_archive_for_numpy(lumipath, fake, tmp_path):
    assert lumipath("render", "-w", 8, "-s", 1, "-D", "aov=uv", "-o", "a.npz")[0] == 0
    assert Image.load(tmp_path / "a.npz")["uv"].shape == (8, 8, 2)


def test_the_default_file_can_hold_them(lumipath, fake, tmp_path):
    assert lumipath("render", "-w", 8, "-s", 1, "--aov", "uv")[0] == 0
    assert Image.load(tmp_path / "cornell-box.exr").layer_names == ("uv",)


@pytest.mark.parametrize("text", ["", ","])
def test_no_layers(lumipath, fake, tmp_path, text):
    assert lumipath("render", "-w", 8, "-s", 1, "--aov", text)[0] == 0
    assert Image.load(tmp_path / "cornell-box.png").layer_names == ()


def test_a_configuration_names_them_in_a_list(lumipath, fake, tmp_path):
    (tmp_path / "a.json").write_text('{"aov": ["normal"], "width": 8, "spp": 1}')
    assert lumipath("render", "-j", "a.json")[0] == 0
    assert fake[0].settings.aov == ("normal",)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--aov", "albdo"), "aov names 'albdo': the layers are albedo, normal, "),
        (("--aov", "uv,uv"), "aov names uv twice"),
        (("--aov", "uv", "-o", "a.png"), "a.png: layers fit only into .exr and .npz files"),
        (("--aov", "uv", "-o", "a.hdr"), "a.hdr: layers fit only into .exr and .npz files"),
    ],
)
def test_errors_come_before_the_render(lumipath, fake, tmp_path, arguments, message):
    code, _, err = lumipath("render", *arguments)
    assert (code, fake) == (2, [])
    assert err.count("\n") == 1
    assert message in err
    assert list(tmp_path.iterdir()) == []


class TestDenoise:
    @pytest.fixture
    def guides(self, monkeypatch):
        """The layers that the denoiser was given."""
        mitsuba_oidn = pytest.importorskip("mitsuba_oidn", reason="needs the extra 'denoise'")
        given = []
        monkeypatch.setattr(
            mitsuba_oidn, "denoise", lambda pixels, hdr, **guides: given.append(sorted(guides)) or pixels
        )
        return given

    def test_its_guides_are_rendered_and_not_written(self, lumipath, fake, tmp_path, guides):
        for name in ("a.png", "a.exr"):
            assert lumipath("render", "-w", 8, "-s", 1, "--denoise", "-o", name)[0] == 0
            assert Image.load(tmp_path / name).layer_names == ()
        assert fake[0].settings.aov == ("albedo", "normal")
        assert guides == [["albedo", "normal"]] * 2

    def test_layers_that_were_asked_for_are_written(self, lumipath, fake, tmp_path, guides):
        assert lumipath("render", "-w", 8, "-s", 1, "--denoise", "--aov", "normal,depth", "-o", "a.exr")[0] == 0
        assert fake[0].settings.aov == ("normal", "depth", "albedo")
        assert sorted(Image.load(tmp_path / "a.exr").layer_names) == ["depth", "normal"]
        assert guides == [["albedo", "normal"]]


def test_an_interrupted_render_keeps_its_layers(start, tmp_path):
    process = start("render", "-w", "4", "-s", "9", "--aov", "uv", fault="hang")
    for line in process.stderr:
        if "FAKE: rendering" in line:
            break
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert Image.load(tmp_path / "cornell-box.exr").layer_names == ("uv",)
