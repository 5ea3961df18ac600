import json
import subprocess
import sys

import pytest

from lumipath.scenes import names

HEAVY = ("numpy", "numba", "rich", "OpenImageIO", "trimesh", "lark", "matplotlib")


class TestTop:
    @pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",)])
    def test_help_lists_the_verbs(self, lumipath, arguments):
        code, out, err = lumipath(*arguments)
        assert (code, err) == (0, "")
        for verb in ("render", "info", "scenes", "devices", "bench"):
            assert f"\n  {verb} " in out

    def test_help_loads_nothing_heavy(self):
        code = (
            "import sys\nfrom lumipath.cli import main\nmain(['--help'])\n"
            f"sys.exit(', '.join(name for name in {HEAVY} if name in sys.modules) or 0)"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
        assert (done.returncode, done.stderr) == (0, "")

    def test_version(self, lumipath):
        code, out, _ = lumipath("--version")
        assert code == 0
        assert out.startswith("lumipath ")

    def test_unknown_verb(self, lumipath):
        code, _, err = lumipath("rendr")
        assert code == 2
        assert err == "lumipath: error: No such command 'rendr'. Did you mean 'render'?; see lumipath --help\n"

    @pytest.mark.parametrize(
        "verb",
        [
            "render",
            "info",
            "scenes",
            "devices",
            "bench",
            "bench throughput",
            "bench build",
            "bench profile",
            "bench figure1",
        ],
    )
    def test_every_verb_has_help(self, lumipath, verb):
        assert lumipath(*verb.split(), "-h")[0] == 0
        code, out, _ = lumipath(*verb.split(), "--help")
        assert code == 0
        assert f"Usage: lumipath {verb}" in out

    def test_render_help_comes_from_the_settings(self, lumipath):
        out = " ".join(lumipath("render", "--help")[1].split())
        assert "-s, --spp N Samples per pixel at most; 64 by default" in out
        assert "-r, --max-depth N Scattering events per path;" in out
        assert "[default 12]" in out
        assert "--sampler sobol|blue-noise|independent Random numbers. [default sobol]" in out
        assert "--rr-depth N|off" in out

    def test_a_reader_that_goes_away_is_no_error(self):
        code = "import sys; from lumipath.cli import main; sys.exit(main(['scenes']))"
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(timeout=30) == 0
        process.stderr.close()


class TestScenes:
    def test_table(self, lumipath):
        code, out, err = lumipath("scenes")
        assert (code, err) == (0, "")
        assert [line.split()[0] for line in out.splitlines()] == list(names())

    def test_json(self, lumipath):
        assert json.loads(lumipath("scenes", "--json")[1]) == names()


class TestInfo:
    def test_table(self, lumipath):
        code, out, err = lumipath("info", "primitives")
        assert (code, err) == (0, "")
        rows = dict(line.split(None, 1) for line in out.splitlines())
        assert rows["shapes"] == "Mesh 3, Cone 5, Sphere 2"
        assert rows["lights"] == "DirectionalLight 1"
        assert rows["environment"] == "sky, 128 x 64 pixels"
        assert rows["bounds"].startswith("(-8, ")
        assert rows["memory"].startswith("about ")

    def test_json(self, lumipath):
        facts = json.loads(lumipath("info", "textures", "--json")[1])
        assert facts["name"] == "textures"
        assert facts["textures"] == 3
        assert facts["materials"] == 7
        assert facts["lights"] == {"emissive shapes": 1}
        assert facts["triangles"] == 1075
        assert len(facts["bounds"]["min"]) == 3

    def test_scene_is_needed(self, lumipath):
        code, _, err = lumipath("info")
        assert code == 2
        assert "Missing argument 'SCENE'" in err

    def test_missing_scene(self, lumipath):
        assert lumipath("info", "missing.ray")[0] == 3


class TestDevices:
    def test_table(self, lumipath):
        code, out, err = lumipath("devices")
        assert (code, err) == (0, "")
        assert out.startswith("device ")
        assert "python" in out

    def test_json(self, lumipath):
        facts = json.loads(lumipath("devices", "--json")[1])
        cpu = facts["devices"][0]
        assert cpu["device"] == "cpu"
        assert cpu["threads"] >= 1
        assert cpu["simd_bits"] in (None, 128, 256, 512)
        assert set(facts["software"]) == {"python", "numba", "llvmlite", "numpy"}


class TestThroughput:
    def test_json(self, lumipath, fake):
        code, out, err = lumipath("bench", "throughput", "bench-cornell", "--size", "8x4", "-s", 4, "--json")
        assert (code, err) == (0, "")
        facts = json.loads(out)
        assert list(facts) == ["mpaths_per_s", "median", "mean_rgb", "device", "build_s", "compile_s"]
        assert facts["mpaths_per_s"] == pytest.approx([8 * 4 * 4 / 1.0 / 1e6] * 3)
        assert facts["mean_rgb"] == [0.5, 0.5, 0.5]

    def test_repeats_differ_by_seed_only_and_have_no_roulette(self, lumipath, fake):
        lumipath("bench", "throughput", "bench-cornell", "-s", 4, "-w", 4, "--repeat", 2, "--threads", 1)
        (session,) = fake
        assert [settings.seed for settings in session.restarts] == [0, 1]
        for settings in session.restarts:
            assert (settings.spp, settings.max_depth, settings.rr_depth, settings.threads) == (4, 5, None, 1)

    def test_depth_can_be_chosen(self, lumipath, fake):
        lumipath("bench", "throughput", "bench-cornell", "-s", 1, "-w", 4, "--max-depth", 2)
        assert fake[-1].settings.max_depth == 2

    def test_text(self, lumipath, fake):
        out = lumipath("bench", "throughput", "bench-cornell", "-s", 2, "-w", 4)[1]
        assert "Mpaths/s (median of " in out
        assert "Fake, 1 thread" in out

    def test_no_repeats(self, lumipath, fake):
        code, _, err = lumipath("bench", "throughput", "bench-cornell", "--repeat", 0)
        assert code == 2
        assert "--repeat" in err
