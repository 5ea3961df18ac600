import attrs
import pytest

from lumipath.errors import UsageError
from lumipath.settings import MAX_SIDE, MAX_SPP, RenderSettings


def test_defaults_are_valid():
    assert RenderSettings().sample_limit == RenderSettings().total_samples == 64


def test_the_limit_of_samples_follows_what_else_stops_the_render():
    assert RenderSettings(spp=7).total_samples == RenderSettings(spp=7, time=9.0).total_samples == 7
    assert RenderSettings(time=9.0).total_samples is None
    assert RenderSettings(time=9.0).sample_limit == MAX_SPP
    assert RenderSettings(noise=0.1).total_samples is None
    assert RenderSettings(noise=0.1, spp=7).total_samples == 7


def test_noise_and_the_wavefront_exclude_each_other():
    with pytest.raises(UsageError, match="noise needs whole paths in one kernel"):
        RenderSettings(noise=0.1, kernel="wavefront")


@pytest.mark.parametrize("attribute", attrs.fields(RenderSettings), ids=lambda attribute: attribute.name)
def test_every_field_says_what_it_means(attribute):
    assert attribute.metadata["help"].endswith(".")
    assert set(attribute.metadata) == {"help", "unit", "choices"}
    if attribute.metadata["choices"]:
        assert attribute.default in (None, *attribute.metadata["choices"])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("spp", 0),
        ("spp", -1),
        ("spp", 1.5),
        ("spp", True),
        ("spp", "4"),
        ("time", 0.0),
        ("time", True),
        ("noise", 0.0),
        ("noise", 1.5),
        ("max_depth", -1),
        ("width", 0),
        ("width", MAX_SIDE + 1),
        ("height", 0),
        ("crop", (0, 0, 0, 4)),
        ("crop", (0, 4, 4, 4)),
        ("crop", (-1, 0, 4, 4)),
        ("crop", (0, 0, 4)),
        ("sampler", "halton"),
        ("hemisphere", ""),
        ("fresnel", "none"),
        ("integrator", "whittd"),
        ("ao_distance", 0.0),
        ("rr_depth", -1),
        ("seed", -1),
        ("seed", 1 << 32),
        ("aperture", -0.1),
        ("aperture", float("nan")),
        ("focus", 0.0),
        ("focus", float("inf")),
        ("focus_on", (1,)),
        ("focus_on", (1, -1)),
        ("focus_on", (True, 1)),
        ("focus_on", (1.0, 1.0)),
        ("focus_on", [1, 1]),
        ("blades", 1),
        ("blades", 33),
        ("blades", 6.0),
        ("blade_rotation", 361),
        ("camera", 1.5),
        ("exposure", float("nan")),
        ("exposure", 100.0),
        ("tonemap", "film"),
        ("threads", 0),
    ],
)
def test_wrong_values_name_the_field(name, value):
    with pytest.raises(UsageError, match=f"^{name} is .*: it must be ") as caught:
        RenderSettings(**{name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name", ["height", "crop", "camera", "rr_depth", "aperture", "focus", "focus_on", "blades", "threads"]
)
def test_optional_fields_may_be_none(name):
    assert getattr(RenderSettings(**{name: None}), name) is None


def test_is_immutable():
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        RenderSettings().spp = 3


@pytest.mark.parametrize(
    ("width", "height", "aspect", "size"),
    [(512, None, 1.0, (512, 512)), (512, None, 1.6, (512, 320)), (640, 480, 1.0, (640, 480)), (1, None, 5.0, (1, 1))],
)
def test_size(width, height, aspect, size):
    assert RenderSettings(width=width, height=height).size(aspect) == size


def test_too_many_pixels():
    with pytest.raises(UsageError, match="choose a smaller size"):
        RenderSettings(width=MAX_SIDE, height=MAX_SIDE).size(1.0)


def test_a_pixel_to_focus_on_lies_in_the_image():
    settings = RenderSettings(focus_on=(7, 3))
    settings.check_focus_on(8, 4)
    for size in ((7, 4), (8, 3)):
        with pytest.raises(UsageError, match=r"^focus_on \(7, 3\) lies outside the image of \d x \d pixels$"):
            settings.check_focus_on(*size)


def test_there_is_one_way_to_focus():
    with pytest.raises(UsageError, match=r"^focus is 2 and focus_on is \(1, 1\): give one of them$"):
        RenderSettings(focus=2.0, focus_on=(1, 1))
