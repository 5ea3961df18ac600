import json
import signal
import subprocess
import sys

import numpy as np
import pytest

from lumipath.rendering.image import Image
from lumipath.settings import RenderSettings


def files_in(folder):
    return sorted(path.name for path in folder.iterdir())


def save_face(path, size, value=0.0):
    Image(np.full((size, size, 3), value)).save(path)


def write_faces(folder):
    """Six faces of 4 x 4 pixels in the folder `sky`, each filled with its number."""
    (folder / "sky").mkdir()
    for number, face in enumerate(("posx", "negx", "posy", "negy", "posz", "negz")):
        save_face(folder / "sky" / f"{face}.exr", 4, number)


class TestOutput:
    def test_default_name_is_that_of_the_scene(self, lumipath, fake, tmp_path):
        code, out, err = lumipath("render", "bench-cornell", "-s", 2, "-w", 8)
        assert (code, out) == (0, "")
        assert files_in(tmp_path) == ["bench-cornell.png"]
        assert err == (
            "lumipath: 2 spp in 0.50 s, 0.000256 Mpaths/s on cpu (Fake, 1 thread): wrote bench-cornell.png\n"
        )

    def test_default_scene(self, lumipath, fake, tmp_path):
        assert lumipath("render", "-w", 8)[0] == 0
        assert fake[0].scene.name == "cornell-box"
        assert files_in(tmp_path) == ["cornell-box.png"]

    def test_exposure_and_tonemap_reach_the_file(self, lumipath, fake, tmp_path):
        lumipath("render", "-w", 4, "-o", "a.png", "--exposure", -1, "--tonemap", "linear")
        assert (Image.load(tmp_path / "a.png").to_uint8() == 64).all()

    def test_float_formats_are_not_touched_by_them(self, lumipath, fake, tmp_path):
        lumipath("render", "-w", 4, "-o", "a.npy", "--exposure", -1)
        assert (np.load(tmp_path / "a.npy") == 0.5).all()

    @pytest.mark.parametrize("target", ["no/a.png", "a.bmp", "."])
    def test_is_checked_before_anything_is_rendered(self, lumipath, fake, target):
        code, out, err = lumipath("render", "-o", target)
        assert (code, out, fake) == (3, "", [])
        assert err.startswith("lumipath: error: ")
        assert err.count("\n") == 1


class TestSettings:
    def test_every_flag(self, lumipath, fake):
        code, _, _ = lumipath(
            *("render", "cornell-box", "-s", 3, "-r", 5, "--size", "8x6", "--crop", "0,0,4,3", "--camera", 0),
            *("--sampler", "independent", "--hemisphere", "uniform", "--fresnel", "schlick", "--rr-depth", "off"),
            *(
                "--seed",
                9,
                "--aperture",
                0.1,
                "--focus",
                2,
                "--blades",
                6,
                "--blade-rotation",
                15,
                "--exposure",
                1.5,
                "--tonemap",
                "agx",
                "--threads",
                1,
            ),
            *("--device", "cpu"),
        )
        assert code == 0
        assert fake[0].settings == RenderSettings(
            spp=3,
            max_depth=5,
            width=8,
            height=6,
            crop=(0, 0, 4, 3),
            camera="0",
            sampler="independent",
            hemisphere="uniform",
            fresnel="schlick",
            rr_depth=None,
            seed=9,
            aperture=0.1,
            focus=2.0,
            blades=6,
            blade_rotation=15.0,
            exposure=1.5,
            tonemap="agx",
            threads=1,
        )

    def test_definitions(self, lumipath, fake):
        lumipath("render", "-D", "spp=3", "-D", "rr-depth=off", "-D", "width=4", "-D", "focus=1.5")
        assert fake[0].settings == RenderSettings(spp=3, rr_depth=None, width=4, focus=1.5)

    def test_defaults(self, lumipath, fake):
        lumipath("render")
        assert fake[0].settings == RenderSettings()

    def test_the_same_value_twice_is_fine(self, lumipath, fake):
        assert lumipath("render", "-s", 3, "-D", "spp=3", "--size", "8x8", "-w", 8)[0] == 0

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (("-s", 3, "-D", "spp=4"), "spp is given twice, as --spp 3 and -D spp 4; keep one"),
            (("-s", 3, "-s", 4), "spp is given twice"),
            (("-w", 3, "--size", "4x4"), "width is given twice"),
            (("-s", "many"), "--spp is 'many': it must be a whole number"),
            (("-s", "0"), "spp is 0: it must be"),
            (("--aperture", "wide"), "--aperture is 'wide': it must be a number"),
            (("--crop", "1,2"), "crop is (1, 2): it must be x0,y0,x1,y1"),
            (("--focus-on", "1"), "focus_on is (1,): it must be x,y in pixels of the full image"),
            (("--focus-on", "1;2"), "--focus-on is '1;2': it must be whole numbers with commas"),
            (("--focus-on", "1,2", "--focus", 3), "focus is 3 and focus_on is (1, 2): give one of them"),
            (("--blades", 2), "blades is 2: it must be 0 for a round aperture, or a whole number from 3 to 32"),
            (("--crop", "a"), "--crop is 'a': it must be whole numbers with commas"),
            (("--size", "640"), "--size is '640': it must be WIDTHxHEIGHT"),
            (("--size", "x"), "--size is 'x'"),
            (("-D", "spq=3"), "no setting 'spq'; did you mean spp?"),
            (("-D", "zzz=3"), "no setting 'zzz'; there are spp, max_depth,"),
            (("-D", "spp"), "it must be key=value"),
            (("--tonemap", "film"), "tonemap is 'film': it must be one of none, linear, agx, aces, reinhard"),
            (("--progress", "dots"), "--progress is 'dots': it must be one of auto, bar, json, none"),
            (("-c", "a.png", "--environment", "b.exr"), "give one of them"),
            (("--environment", "sky:elevation=low"), "'elevation=low' must be a number"),
            (("--environment", "sky:height=3"), "'height=3' is none of elevation=NUMBER"),
            (("--environment", "sky:turbidity=20"), "sky: turbidity is 20.0: it must be a number from 1 to 10"),
            (("--light-sampling", "best"), "one of auto, uniform, power, tree"),
            (("--nope",), "No such option: --nope"),
            (("-s",), "'-s' requires an argument"),
            (("one", "two"), "unexpected extra argument"),
        ],
    )
    def test_usage_errors_are_one_line(self, lumipath, fake, arguments, message):
        code, out, err = lumipath("render", *arguments)
        assert (code, out) == (2, "")
        assert err.startswith("lumipath: error: ")
        assert message in err
        assert err.count("\n") == 1


class TestScene:
    @pytest.mark.parametrize(
        ("scene", "message"),
        [("cornel-box", "did you mean cornell-box"), ("missing.ray", "missing.ray"), ("./cornell-box", "cornell-box")],
    )
    def test_missing(self, lumipath, fake, scene, message):
        code, _, err = lumipath("render", scene)
        assert code == 3
        assert message in err
        assert err.count("\n") == 1

    def test_a_sky_by_its_fields(self, lumipath, fake):
        arguments = ("--environment", "sky:elevation=12,turbidity=4,albedo=0.1,sun=off,scale=2")
        assert lumipath("render", "bench-cornell", *arguments)[0] == 0
        sky = fake[0].scene.environment
        assert (sky.elevation, sky.turbidity, sky.sun, sky.scale) == (12, 4, False, 2)
        assert sky.albedo == pytest.approx((0.1,) * 3)
        assert lumipath("render", "bench-cornell", "--environment", "sky")[0] == 0
        assert fake[-1].scene.environment.elevation == 45

    def test_missing_environment(self, lumipath, fake):
        code, _, err = lumipath("render", "--environment", "missing.exr")
        assert code == 3
        assert "missing.exr" in err

    def test_environment_takes_the_place_of_the_scenes(self, lumipath, fake, tmp_path):
        Image(np.full((2, 4, 3), 0.25)).save(tmp_path / "sky.exr")
        assert lumipath("render", "glass", "-w", 4, "--environment", "sky.exr")[0] == 0
        assert (fake[0].scene.environment.image == 0.25).all()

    @pytest.mark.parametrize("flag", ["-c", "--cubemap"])
    def test_one_face_of_a_cubemap_brings_the_others(self, lumipath, fake, tmp_path, flag):
        write_faces(tmp_path)
        assert lumipath("render", "glass", "-w", 4, flag, "sky/negz.exr")[0] == 0
        image = fake[0].scene.environment.image
        assert image.shape == (8, 16, 3)
        # Straight ahead and straight up, by the numbers of the faces.
        assert image[4, 8].tolist() == [5, 5, 5]
        assert (image[0] == 2).all()

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda sky: (sky / "posy.exr").unlink(), "its folder has no posy; a cubemap needs all of posx, negx"),
            (lambda sky: (sky / "old_posy.png").touch(), "has a face twice: old_posy.png, posy.exr; keep one cubemap"),
            (lambda sky: save_face(sky / "posy.exr", 2), "2 x 2 pixels, but posx.exr has 4 x 4; all faces must have"),
            (lambda sky: (sky / "posy.exr").write_bytes(b"?"), "posy.exr"),
            (lambda sky: (sky / "negz.exr").rename(sky / "front.exr"), "No such file"),
        ],
        ids=["missing", "doubled", "sizes", "no image", "no file"],
    )
    def test_a_wrong_cubemap_is_one_line_before_anything_is_rendered(self, lumipath, fake, tmp_path, change, message):
        write_faces(tmp_path)
        change(tmp_path / "sky")
        code, out, err = lumipath("render", "glass", "-w", 4, "-c", "sky/negz.exr")
        assert (code, out, fake) == (3, "", [])
        assert err.startswith("lumipath: error: ")
        assert message in err
        assert err.count("\n") == 1

    @pytest.mark.parametrize("name", ["sky", "sky/readme.png"])
    def test_a_cubemap_is_named_by_a_face(self, lumipath, fake, tmp_path, name):
        write_faces(tmp_path)
        (tmp_path / "sky" / "readme.png").touch()
        code, _, err = lumipath("render", "glass", "-c", name)
        assert (code, fake) == (3, [])
        assert "name a file in it" in err or "must contain pos or neg" in err

    def test_no_device(self, lumipath, fake):
        code, _, err = lumipath("render", "--device", "cuda")
        assert code == 4
        assert err == "lumipath: error: unknown device 'cuda': use auto or cpu\n"


class TestTimeAndNoise:
    def test_time_alone_is_no_matter_of_samples(self, lumipath, fake):
        _, _, err = lumipath("render", "-w", 4, "--time", 25)
        assert fake[0].settings == RenderSettings(width=4, time=25.0)
        assert err.startswith("lumipath: 100 spp in 25.00 s")

    def test_noise_reaches_the_session_and_the_last_line(self, lumipath, fake):
        _, _, err = lumipath("render", "-w", 4, "--noise", 0.05, "-s", 64)
        assert fake[0].settings == RenderSettings(width=4, noise=0.05, spp=64)
        assert err.startswith("lumipath: 64 spp (32 to 96), noise 0.045 in 16.00 s")

    def test_noise_is_not_for_the_wavefront(self, lumipath, fake):
        code, _, err = lumipath("render", "-w", 4, "--noise", 0.05, "--kernel", "wavefront")
        assert (code, fake) == (2, [])
        assert err == (
            "lumipath: error: noise needs whole paths in one kernel: leave kernel away, or make it megakernel\n"
        )

    def test_json_has_both_limits(self, lumipath, fake):
        _, _, err = lumipath("render", "-w", 4, "--time", 1, "--progress", "json")
        first = json.loads(err.splitlines()[0])
        assert (first["total"], first["time"], first["fraction"]) == (None, 1.0, 0.25)


class TestCheckpoint:
    def test_reaches_the_session(self, lumipath, fake, tmp_path):
        assert lumipath("render", "-w", 4, "--checkpoint", "a.ckpt", "--checkpoint-interval", 5)[0] == 0
        assert (str(fake[0].checkpoint), fake[0].resume) == ("a.ckpt", False)
        assert fake[0].settings.checkpoint_interval == 5

    def test_resume_says_where_it_goes_on(self, lumipath, fake, tmp_path):
        (tmp_path / "a.ckpt").touch()
        _, _, err = lumipath("render", "-w", 4, "--checkpoint", "a.ckpt", "--resume")
        assert err.startswith("lumipath: going on from a.ckpt at 2 spp\n")

    def test_resume_without_a_file_begins_anew_and_says_so(self, lumipath, fake):
        code, _, err = lumipath("render", "-w", 4, "--checkpoint", "a.ckpt", "--resume")
        assert code == 0
        assert err.startswith("lumipath: there is no a.ckpt yet: beginning anew\n")

    def test_resume_needs_a_checkpoint(self, lumipath, fake):
        code, _, err = lumipath("render", "-w", 4, "--resume")
        assert (code, fake) == (2, [])
        assert err == "lumipath: error: --resume needs --checkpoint FILE: the file to go on from\n"

    def test_an_earlier_checkpoint_is_not_lost(self, lumipath, fake, tmp_path):
        (tmp_path / "a.ckpt").write_bytes(b"earlier")
        code, _, err = lumipath("render", "-w", 4, "--checkpoint", "a.ckpt")
        assert (code, fake) == (2, [])
        assert "a.ckpt is there already: add --resume to go on from it" in err
        assert (tmp_path / "a.ckpt").read_bytes() == b"earlier"


class TestProgress:
    def test_json_is_one_object_a_line(self, lumipath, fake, monkeypatch):
        monkeypatch.setenv("FAKE_COMPILE", "3")
        _, out, err = lumipath("render", "-s", 2, "-w", 4, "--progress", "json")
        events = [json.loads(line) for line in err.splitlines()]
        assert [event["event"] for event in events] == ["message", "message", "progress", "progress", "done"]
        assert out == ""
        assert events[2]["fraction"] == 0.5
        assert events[-1]["output"] == "cornell-box.png"

    def test_none_says_only_the_end(self, lumipath, fake):
        assert lumipath("render", "-s", 2, "-w", 4, "--progress", "none")[2].count("\n") == 1

    def test_quiet_says_nothing(self, lumipath, fake):
        assert lumipath("render", "-s", 2, "-w", 4, "-q") == (0, "", "")

    def test_verbose_says_more(self, lumipath, fake):
        err = lumipath("render", "-s", 2, "-w", 4, "-v")[2]
        assert "compiling took 0.2 s" in err
        assert "RenderSettings(spp=2" in err

    def test_the_distance_of_a_picked_focus_is_said(self, lumipath, fake):
        assert "lumipath: in focus: 4.5 m, at pixel 1,2\n" in lumipath("render", "-w", 4, "--focus-on", "1,2")[2]

    def test_long_compilation_is_mentioned(self, lumipath, fake, monkeypatch):
        monkeypatch.setenv("FAKE_COMPILE", "3")
        assert "lumipath: compiling took 3.0 s\n" in lumipath("render", "-w", 4)[2]

    @pytest.mark.parametrize("mode", ["bar", "json", "none"])
    def test_compilation_is_announced_when_it_begins(self, lumipath, fake, monkeypatch, mode):
        monkeypatch.setenv("FAKE_COMPILE", "0.1")
        first = lumipath("render", "-w", 4, "--progress", mode)[2].splitlines()[0]
        assert "compiling kernels for what this scene uses" in first

    def test_kernels_from_the_disk_are_not_worth_a_word(self, lumipath, fake):
        assert "compiling" not in lumipath("render", "-w", 4)[2]

    def test_no_colours_without_a_terminal(self, lumipath, fake):
        assert "\x1b" not in lumipath("render", "-w", 4, "--progress", "bar")[2]


class TestStops:
    @pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
    def test_a_signal_writes_what_there_is(self, start, tmp_path, number, code):
        process = start("render", "-s", "9", "-w", "4", fault="hang")
        assert process.stderr.readline() == "FAKE: rendering\n"
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
        assert (process.returncode, out) == (code, "")
        assert err.startswith("lumipath: interrupted: 1 of 9 spp in ")
        assert err.endswith("wrote cornell-box.png\n")
        assert err.count("\n") == 1
        assert files_in(tmp_path) == ["cornell-box.png"]

    def test_before_the_first_sample_nothing_is_written(self, start, tmp_path):
        process = start("render", "-w", "4", fault="interrupt-first")
        _, err = process.communicate(timeout=30)
        assert process.returncode == 130
        assert err == "lumipath: error: interrupted before the first sample; nothing was written\n"
        assert files_in(tmp_path) == []

    def test_a_closed_stderr_does_not_stop_a_render(self, start, tmp_path):
        process = start("render", "-s", "50", "-w", "4", "--progress", "json")
        process.stderr.close()
        assert process.wait(timeout=30) == 0
        assert files_in(tmp_path) == ["cornell-box.png"]


class TestFaults:
    def test_an_unexpected_error_is_one_line(self, lumipath, fake, monkeypatch):
        monkeypatch.setenv("FAKE_FAULT", "error")
        code, out, err = lumipath("render", "-w", 4)
        assert (code, out) == (1, "")
        assert err == (
            "lumipath: error: unexpected ZeroDivisionError: a bug of two lines; run render with -v for the traceback\n"
        )

    def test_verbose_shows_its_traceback(self, lumipath, fake, monkeypatch):
        monkeypatch.setenv("FAKE_FAULT", "error")
        code, _, err = lumipath("render", "-w", 4, "-v")
        assert code == 1
        assert "Traceback (most recent call last)" in err

    def test_warnings_are_one_line(self, lumipath, fake, monkeypatch):
        monkeypatch.setenv("FAKE_FAULT", "warning")
        code, _, err = lumipath("render", "-s", 1, "-w", 4, "-q")
        assert (code, err) == (0, "lumipath: warning: something was replaced\n")


def test_python_m_lumipath(tmp_path):
    done = subprocess.run([sys.executable, "-m", "lumipath", "render", "nope.ray"], capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stderr.startswith("lumipath: error: ")
    assert done.stderr.count("\n") == 1
