"""`--config`: settings from a JSON file."""

import json

import attrs
import pytest

from lumipath.cli._config import OLD_NAMES, WITHOUT_EFFECT
from lumipath.settings import RenderSettings

SETTINGS = {
    "spp": 3,
    "max_depth": 5,
    "width": 8,
    "height": 6,
    "crop": [0, 0, 4, 3],
    "camera": 0,
    "sampler": "independent",
    "hemisphere": "uniform",
    "fresnel": "schlick",
    "rr_depth": None,
    "seed": 9,
    "aperture": 0.1,
    "focus": 2,
    "blades": 6,
    "blade_rotation": 15,
    "exposure": 1.5,
    "tonemap": "agx",
    "threads": 1,
    "kernel": "megakernel",
}


@pytest.fixture
def config(tmp_path):
    """Write params.json: a text as it is, anything else as JSON."""

    def write(content):
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / "params.json").write_text(text, encoding="utf-8")

    return write


@pytest.fixture
def render(lumipath, fake, config):
    """Render with this configuration and these flags: (settings, stderr)."""

    def run(content, *flags):
        config(content)
        code, out, err = lumipath("render", "-q", "-j", "params.json", *flags)
        assert (code, out) == (0, "")
        return fake[-1].settings, err

    return run


@pytest.fixture
def refused(lumipath, fake, config):
    """Render with this configuration, which must be a usage error before anything happens: the message."""

    def run(content, *flags):
        config(content)
        code, out, err = lumipath("render", "--config", "params.json", *flags)
        assert (code, out, fake) == (2, "", [])
        assert err.count("\n") == 1
        return err.removeprefix("lumipath: error: ").rstrip("\n")

    return run


class TestSettings:
    def test_settings_by_their_own_names(self, render):
        wanted = RenderSettings(**(SETTINGS | {"crop": (0, 0, 4, 3)}))
        assert render(SETTINGS) == (wanted, "")

    def test_every_name_of_a_setting_is_known(self, render):
        assert render(attrs.asdict(RenderSettings())) == (RenderSettings(), "")

    def test_a_pixel_to_focus_on(self, render):
        assert render({"focus_on": [3, 4]})[0].focus_on == (3, 4)

    def test_keys_of_the_student_tracer(self, render):
        old = {"threads": 2, "size": 64, "recursion_depth": 7, "supersamples": 9, "anti_alias": False}
        assert render(old) == (RenderSettings(threads=2, width=64, max_depth=7, spp=9), "")

    def test_hyphens_are_underscores(self, render):
        assert render({"max-depth": 2, "rr-depth": 1})[0] == RenderSettings(max_depth=2, rr_depth=1)

    @pytest.mark.parametrize("word", [None, "off", "None", "auto"])
    def test_not_set(self, render, word):
        assert render({"rr_depth": word, "threads": word})[0] == RenderSettings(rr_depth=None, threads=None)

    def test_a_camera_may_be_called_auto(self, render):
        assert render({"camera": "0"})[0].camera == "0"

    def test_an_empty_object_and_a_byte_order_mark(self, render):
        assert render("\ufeff{}") == (RenderSettings(), "")

    def test_the_same_value_under_two_names_is_fine(self, render):
        assert render({"size": 64, "width": 64})[0].width == 64


class TestFlags:
    def test_flags_beat_the_file(self, render):
        content = {"size": 64, "supersamples": 9, "seed": 5}
        wanted = RenderSettings(width=16, spp=2, max_depth=1, seed=5)
        assert render(content, "-w", 16, "-s", 2, "-D", "max_depth=1")[0] == wanted

    def test_a_flag_can_unset(self, render):
        assert render({"threads": 3}, "--threads", "auto")[0].threads is None

    def test_either_way_to_focus_takes_the_place_of_the_other(self, render):
        assert render({"focus": 2.0}, "--focus-on", "3,4")[0] == RenderSettings(focus_on=(3, 4))
        assert render({"focus_on": [3, 4]}, "--focus", 2)[0] == RenderSettings(focus=2.0)


class TestWarnings:
    def test_keys_without_effect(self, render):
        settings, err = render(dict.fromkeys(WITHOUT_EFFECT, 1))
        assert settings == RenderSettings()
        assert err == f"lumipath: warning: params.json: without effect: {', '.join(WITHOUT_EFFECT)}\n"

    def test_unknown_keys_are_named(self, render):
        settings, err = render({"spp": 2, "sup_samples": 8, "Zzz": [1, {}]})
        assert settings == RenderSettings(spp=2)
        assert err == (
            "lumipath: warning: params.json: unknown and ignored: 'sup_samples' (did you mean supersamples?), 'Zzz'\n"
        )

    def test_anti_alias_does_not_change_the_integrator(self, render):
        settings, err = render({"anti_alias": True})
        assert settings == RenderSettings()
        assert err.startswith("lumipath: warning: params.json: anti_alias does not switch to Whitted ray tracing")
        assert err.count("\n") == 1


class TestErrors:
    @pytest.mark.parametrize("name", OLD_NAMES)
    def test_messages_name_the_key_that_was_written(self, refused, name):
        assert refused({name: -1}).startswith(f"params.json: {name} is -1: it must be a whole number from ")

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            ({"supersamples": "many"}, "supersamples is 'many': it must be a whole number"),
            ({"spp": "64"}, "spp is '64': it must be a whole number"),
            ({"spp": 1.5}, "spp is 1.5"),
            ({"width": None}, "width is None"),
            ({"spp": True}, "spp is True"),
            ({"size": [64]}, "size is (64,)"),
            ({"threads": 0}, "threads is 0"),
            ({"rr-depth": -1}, "rr-depth is -1"),
            ({"aperture": "wide"}, "aperture is 'wide': it must be a number"),
            ({"focus": 1e99}, "focus is 1e+99"),
            ({"crop": [0, 0, 4]}, "crop is (0, 0, 4): it must be x0,y0,x1,y1"),
            ({"crop": "0,0,4,4"}, "crop is '0,0,4,4': it must be x0,y0,x1,y1"),
            ({"crop": [0, 0, 4, {}]}, "crop is (0, 0, 4, {})"),
            ({"focus_on": [1, -1]}, "focus_on is (1, -1): it must be x,y in pixels"),
            ({"blades": 2}, "blades is 2: it must be 0 for a round aperture"),
            ({"camera": {}}, "camera is {}: it must be a name or a whole number"),
            ({"sampler": "halton"}, "sampler is 'halton': it must be one of sobol, blue-noise, independent"),
            ({"anti_alias": 1}, "anti_alias is 1: it must be true or false"),
            ({"size": 8, "width": 9}, "size and width are the same setting; keep one of them"),
            ({"focus": 1, "focus_on": [1, 1]}, "focus is 1 and focus_on is (1, 1): give one of them"),
            ("[]", 'a configuration must be one JSON object, such as {"spp": 64}'),
            ('"spp"', "a configuration must be one JSON object"),
            ('{"spp": 2, "spp": 3}', "no valid JSON: the key 'spp' is there twice; keep one"),
            ('{"focus": NaN}', "no valid JSON: NaN is no number of JSON"),
            ("[" * 100_000, "no valid JSON: nested too deeply"),
            ('{"spp": ' + "9" * 10_000 + "}", "no valid JSON: "),
        ],
    )
    def test_wrong_values_name_file_and_key(self, refused, content, message):
        assert refused(content).startswith(f"params.json: {message}")

    @pytest.mark.parametrize(
        ("content", "place"),
        [
            ("", "1:1"),
            ('{"spp": 2,}', "1:11"),
            ('{\n  "spp": 2\n  "seed": 3\n}', "3:3"),
            ("{} x", "1:4"),
            ("{'a': 1}", "1:2"),
        ],
    )
    def test_broken_json_has_line_and_column(self, refused, content, place):
        message = refused(content)
        # Where a comma too many is reported depends on the version of Python.
        assert message.startswith((f"params.json:{place}: no valid JSON: ", "params.json:1:10: no valid JSON: "))

    def test_no_text(self, lumipath, fake, tmp_path):
        (tmp_path / "params.json").write_bytes(b"{\xff}")
        code, _, err = lumipath("render", "-j", "params.json")
        assert (code, err) == (
            2,
            "lumipath: error: params.json: no text in UTF-8; a configuration is a JSON file\n",
        )

    @pytest.mark.parametrize(
        ("name", "message"), [("none.json", "cannot read 'none.json': No such"), (".", ". is a folder")]
    )
    def test_no_file(self, lumipath, fake, name, message):
        code, _, err = lumipath("render", "-j", name)
        assert (code, fake) == (2, [])
        assert err.startswith(f"lumipath: error: {message}")
        assert err.count("\n") == 1
