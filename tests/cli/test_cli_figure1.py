"""`lumipath bench figure1` with a Session that has no kernels: a quarter of a second a sample."""

import json
import sys

import fake_session
import pytest

import lumipath as lp
from lumipath.errors import RenderError

SMALL = ("bench", "figure1", "--scene", "cornell-box", "--size", "8x4", "--device", "cpu")
SHARED = {"width": 8, "height": 4, "max_depth": 3, "rr_depth": None, "seed": 0}


def read(folder, name="figure1.json"):
    return json.loads((folder / name).read_text())


@pytest.fixture
def without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)


def failing_after(monkeypatch, renders, error):
    """Every render but the first ones fails."""

    class Failing(fake_session.Session):
        def __iter__(self):
            if len(fake_session.MADE) > renders:
                raise error
            yield from super().__iter__()

    monkeypatch.setattr(sys.modules["lumipath.rendering.session"], "Session", Failing)


class TestNumbers:
    def test_a_point_is_the_ratio_of_two_renders_with_equal_settings(self, lumipath, fake, tmp_path):
        code, _, _ = lumipath(*SMALL, "--samples", "4", "--threads", 3, "--seed", 5)
        assert code == 0
        device, against = fake
        assert device.settings == against.settings
        for name, value in (SHARED | {"spp": 4, "threads": 3, "seed": 5}).items():
            assert getattr(device.settings, name) == value
        (point,) = read(tmp_path)["points"]
        assert (point["scene"], point["triangles"], point["spp"]) == ("cornell-box", 32, 4)
        assert (point["speed_up"], point["relative_difference"], point["cpu_extrapolated"]) == (1, 0, False)
        for timing in (point["device"], point["against"]):
            assert (timing["seconds"], timing["samples"], timing["extrapolated"]) == (1.0, 4, False)
            assert timing["mpaths_per_s"] == pytest.approx(8 * 4 * 4 / 1e6)
            assert timing["mean_rgb"] == [0.5, 0.5, 0.5]
            assert (timing["build_s"], timing["compile_s"]) == (0.1, 0.2)

    def test_a_cpu_beyond_the_limit_is_stopped_and_extrapolated(self, lumipath, fake, tmp_path):
        lumipath(*SMALL, "--samples", "4,8,32", "--cpu-limit", 1)
        points = read(tmp_path)["points"]
        assert [point["against"]["samples"] for point in points] == [4, 4, 4]
        assert [point["against"]["seconds"] for point in points] == [1, 2, 8]
        assert [point["cpu_extrapolated"] for point in points] == [False, True, True]
        assert len({point["against"]["mpaths_per_s"] for point in points}) == 1

    def test_the_warm_up_does_not_count_and_short_renders_are_repeated(self, lumipath, fake):
        lumipath(*SMALL, "--samples", "1,2")
        # One sample takes a quarter of a second.
        assert [len(session.restarts) for session in fake] == [3, 3, 1, 1]

    def test_machine_and_settings_are_written(self, lumipath, fake, tmp_path):
        lumipath(*SMALL, "--samples", "1", "--threads", 2)
        facts = read(tmp_path)
        assert (facts["figure"], facts["lumipath"], facts["complete"]) == ("figure1", lp.__version__, True)
        assert facts["machine"]["threads"] == 2
        assert facts["machine"]["cpu"]
        assert SHARED.items() <= facts["settings"].items()
        assert facts["settings"]["cpu_limit_s"] == 30

    def test_the_scenes_are_four_by_default(self, lumipath, fake):
        lumipath("bench", "figure1", "--samples", "1", "--device", "cpu")
        names = [session.scene.name for session in fake]
        wanted = ["cornell-box", "cornell-box-specular", "cornell-box-transmissive", "knot40k"]
        assert names == [name for name in wanted for _ in range(2)]


class TestOutput:
    def test_table(self, lumipath, fake):
        _, out, err = lumipath(*SMALL, "--samples", "8,4,4", "--cpu-limit", 1)
        rows = [line.split() for line in out.splitlines() if line.strip().startswith("cornell-box")]
        assert rows[0] == ["cornell-box", "4", "1", "1", "0.000128", "0.000128", "1", "0", "%"]
        assert rows[1][1:4] == ["8", "2*", "2*"]
        assert "* extrapolated" in out
        assert "lumipath: cornell-box, 8 spp: 2* s against 2* s, speed-up 1\n" in err
        assert err.endswith("lumipath: wrote figure1.json, figure1.png, figure1.svg\n")

    def test_json(self, lumipath, fake, tmp_path):
        _, out, _ = lumipath(*SMALL, "--samples", "4", "--json")
        assert json.loads(out) == read(tmp_path)

    def test_a_folder_gets_numbers_and_both_plots(self, lumipath, fake, tmp_path):
        (tmp_path / "figures").mkdir()
        lumipath(*SMALL, "--samples", "1,2", "-o", "figures")
        assert {path.name for path in (tmp_path / "figures").iterdir()} == {
            "figure1.json",
            "figure1.png",
            "figure1.svg",
        }
        assert lp.Image.load(tmp_path / "figures" / "figure1.png").width > 500

    @pytest.mark.parametrize(("output", "files"), [("x.svg", {"x.svg", "x.json"}), ("x.json", {"x.json"})])
    def test_a_file_gets_what_it_is(self, lumipath, fake, tmp_path, output, files):
        lumipath(*SMALL, "--samples", "1", "-o", output)
        assert {path.name for path in tmp_path.iterdir()} == files

    def test_marks_of_extrapolated_points_are_hollow(self, lumipath, fake, tmp_path):
        lumipath(*SMALL, "--samples", "2,4,8,16", "--cpu-limit", 1, "-o", "x.svg")
        plot = (tmp_path / "x.svg").read_text()
        # The first of the colours; hollow marks are filled with white.
        marks = [line for line in plot.splitlines() if "<use" in line and "stroke: #0072b2" in line]
        assert sum("fill: #ffffff" in line for line in marks) == 2
        assert sum("fill: #0072b2" in line for line in marks) == 3  # two points, and the legend

    @pytest.mark.parametrize(
        ("arguments", "code", "message"),
        [
            (("-o", "x.pdf"), 3, "use one of .png, .svg, .json"),
            (("-o", "missing"), 3, "there is no folder"),
            (("--samples", "4,x"), 2, "--samples is '4,x'"),
            (("--samples", "0"), 2, "--samples is '0'"),
            (("--samples", ""), 2, "--samples is ''"),
            (("--scene", "cornel-box"), 3, "did you mean cornell-box"),
            (("--size", "8"), 2, "--size is '8'"),
            (("--cpu-limit", "-1"), 2, "--cpu-limit"),
        ],
    )
    def test_what_is_wrong_is_said_before_anything_is_measured(self, lumipath, fake, arguments, code, message):
        found, out, err = lumipath(*SMALL, *arguments)
        assert (found, out, fake) == (code, "", [])
        assert message in err
        assert err.count("\n") == 1

    def test_without_the_device_nothing_is_measured_or_written(self, lumipath, fake, tmp_path):
        code, out, err = lumipath("bench", "figure1")
        assert (code, out, list(tmp_path.iterdir())) == (4, "", [])
        assert err == "lumipath: error: unknown device 'cuda:0': use auto or cpu\n"


class TestWithoutMatplotlib:
    def test_numbers_are_written_with_a_warning_beforehand(self, lumipath, fake, without_matplotlib, tmp_path):
        code, out, err = lumipath(*SMALL, "--samples", "1")
        assert code == 0
        assert "cornell-box" in out
        assert err.startswith("lumipath: warning: matplotlib is not installed")
        assert "pip install 'lumipath[bench]'" in err
        assert [path.name for path in tmp_path.iterdir()] == ["figure1.json"]

    def test_a_plot_that_is_asked_for_is_an_error_beforehand(self, lumipath, fake, without_matplotlib, tmp_path):
        code, _, err = lumipath(*SMALL, "-o", "x.png")
        assert (code, fake, list(tmp_path.iterdir())) == (2, [], [])
        assert err == "lumipath: error: plots need matplotlib; install it with: pip install 'lumipath[bench]'\n"

    def test_numbers_alone_need_none(self, lumipath, fake, without_matplotlib):
        assert "warning" not in lumipath(*SMALL, "--samples", "1", "-o", "x.json")[2]


class TestStopping:
    def test_an_interrupt_keeps_the_points_that_are_done(self, lumipath, fake, tmp_path, monkeypatch):
        failing_after(monkeypatch, 3, KeyboardInterrupt())
        code, out, err = lumipath(*SMALL, "--samples", "1,2,4")
        assert code == 130
        facts = read(tmp_path)
        assert ([point["spp"] for point in facts["points"]], facts["complete"]) == ([1], False)
        assert (tmp_path / "figure1.svg").exists()
        assert "cornell-box" in out
        assert "lumipath: not complete: wrote figure1.json" in err

    def test_an_error_keeps_them_as_well(self, lumipath, fake, tmp_path, monkeypatch):
        failing_after(monkeypatch, 2, RenderError("it broke"))
        code, _, err = lumipath(*SMALL, "--samples", "1,2,4")
        assert (code, read(tmp_path)["complete"]) == (1, False)
        assert err.endswith("lumipath: error: it broke\n")

    def test_an_interrupt_before_the_first_point_writes_nothing(self, lumipath, fake, tmp_path, monkeypatch):
        failing_after(monkeypatch, 1, KeyboardInterrupt())
        code, _, err = lumipath(*SMALL, "--samples", "1,2")
        assert (code, list(tmp_path.iterdir())) == (130, [])
        assert err.endswith("lumipath: error: interrupted; nothing was written\n")
