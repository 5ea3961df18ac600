"""Every render option once: its default, unit, range and meaning.

The Python API, the command line and `-D key=value` all read `RenderSettings`; nothing else declares an option.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any

import attrs
from attrs import field, frozen

from .errors import UsageError

INTEGRATORS = ("path", "whitted", "albedo", "normal", "depth", "ao")
SAMPLERS = ("sobol", "blue-noise", "independent")
HEMISPHERES = ("cosine", "uniform")
FRESNELS = ("exact", "schlick")
LIGHT_SAMPLINGS = ("auto", "uniform", "power", "tree")
PROJECTIONS = ("perspective", "orthographic", "panorama", "fisheye", "fisheye-equisolid")
"""The projections of `lumipath.Camera`."""
FILTER_RADII = {"box": 0.5, "gaussian": 1.5, "blackman-harris": 1.5, "mitchell": 2.0}
"""Pixel filters, and their usual radii in pixels: of pbrt's 4th edition; of Cycles for Blackman and Harris'."""
FILTERS = tuple(FILTER_RADII)
TONEMAPS = ("none", "linear", "agx", "aces", "reinhard")
KERNELS = ("auto", "megakernel", "wavefront")
LAYERS = (
    *("albedo", "normal", "geometric_normal", "depth", "position", "uv", "emission", "direct", "indirect"),
    *("light_groups", "variance", "object_id", "material_id", "samples"),
)
"""Layers that can be rendered beside the image; `rendering/layers.py` says what they are."""

LIGHT_LAYERS = ("direct", "indirect", "light_groups")
"""Layers that only the integrator `path` has."""

PROGRESS_MODES = ("auto", "bar", "json", "none")

MAX_PIXELS = 1 << 28
MAX_SIDE = 1 << 16
MAX_SPP = 1 << 30
_USUAL_SPP = 64

NOT_IN_SAMPLES = ("spp", "time", "noise", "aov", "exposure", "tonemap", "threads", "kernel", "checkpoint_interval")
"""Settings that no sample depends on: renders that differ only in these go on from one another and add up."""


def _fail(name: str, value: object, wanted: str) -> UsageError:
    return UsageError(f"{name} is {value!r}: it must be {wanted}")


def _integer(low: int, high: int) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    def check(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise _fail(attribute.name, value, f"a whole number from {low} to {high}")

    return check


def _real(low: float, high: float) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    def check(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise _fail(attribute.name, value, f"a number from {low:g} to {high:g}")

    return check


def _flag(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if type(value) is not bool:
        raise _fail(attribute.name, value, "true or false")


def _choice(choices: tuple[str, ...]) -> Callable[[Any, attrs.Attribute[Any], Any], None]:
    def check(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
        if value not in choices:
            raise _fail(attribute.name, value, "one of " + ", ".join(choices))

    return check


def _are_pixels(value: Any, count: int) -> bool:
    """Whether a value is a tuple of `count` whole numbers, none of them negative."""
    return isinstance(value, tuple) and len(value) == count and all(type(v) is int and v >= 0 for v in value)


def _crop(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if not _are_pixels(value, 4) or value[0] >= value[2] or value[1] >= value[3]:
        raise _fail(attribute.name, value, "x0,y0,x1,y1 in pixels with x0 < x1 and y0 < y1")


def _pixel(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if not _are_pixels(value, 2):
        raise _fail(attribute.name, value, "x,y in pixels of the full image, from 0,0 at the top left")


def _name_or_index(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, (str, int)):
        raise _fail(attribute.name, value, "a name or a whole number")


def _blades(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if type(value) is not int or not (value == 0 or 3 <= value <= 32):
        raise _fail(attribute.name, value, "0 for a round aperture, or a whole number from 3 to 32")


def _list_to_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _layers(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if not isinstance(value, tuple):
        raise _fail(attribute.name, value, f"a tuple of layers, of {', '.join(LAYERS)}")
    for name in value:
        if name not in LAYERS:
            near = difflib.get_close_matches(str(name), LAYERS, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise UsageError(f"{attribute.name} names {name!r}: the layers are {', '.join(LAYERS)}{hint}")
        if value.count(name) > 1:
            raise UsageError(f"{attribute.name} names {name} twice; name each layer once")


def _optional(check: Callable[..., None]) -> Any:
    return attrs.validators.optional(check)


def _option(
    default: Any, help_text: str, check: Any, unit: str = "", choices: tuple[str, ...] = (), converter: Any = None
) -> Any:
    metadata = {"help": help_text, "unit": unit, "choices": choices}
    return field(default=default, validator=check, metadata=metadata, converter=converter)


@frozen(kw_only=True)
class RenderSettings:
    """How a scene is rendered. Immutable; `attrs.evolve(settings, spp=64)` makes a changed copy.

    Raises:
        UsageError: a value is outside its range; the message names the field.
    """

    spp: int | None = _option(
        None,
        "Samples per pixel at most; 64 by default, and no limit where time or noise is given.",
        _optional(_integer(1, MAX_SPP)),
    )
    max_depth: int = _option(
        12, "Scattering events per path; 0 shows emission only (Mitsuba's max_depth is one more).", _integer(0, 1 << 16)
    )
    time: float | None = _option(None, "Stop after so much rendering.", _optional(_real(1e-3, 1e9)), "seconds")
    noise: float | None = _option(
        None,
        "Stop when the estimated relative error is below this everywhere; samples go where it is not.",
        _optional(_real(1e-3, 1.0)),
    )
    width: int = _option(512, "Image width; the height follows from the camera.", _integer(1, MAX_SIDE), "pixels")
    height: int | None = _option(None, "Image height.", _optional(_integer(1, MAX_SIDE)), "pixels")
    crop: tuple[int, int, int, int] | None = _option(
        None, "Render only the pixels x0 <= x < x1, y0 <= y < y1 of the full image.", _optional(_crop), "pixels"
    )
    camera: str | int | None = _option(
        None, "Camera by name or index; the scene's first by default.", _optional(_name_or_index)
    )
    integrator: str = _option(
        "path",
        "What a pixel shows: path tracing, classic recursive ray tracing, or a quick look at the first surface.",
        _choice(INTEGRATORS),
        choices=INTEGRATORS,
    )
    aov: tuple[str, ...] = _option(
        (),
        f"Layers to render beside the image: {', '.join(LAYERS)}.",
        _layers,
        converter=_list_to_tuple,
    )
    ao_distance: float | None = _option(
        None,
        "How far surfaces occlude each other for ao; a tenth of the scene's extent by default.",
        _optional(_real(1e-6, 1e9)),
        "metres",
    )
    sampler: str = _option("sobol", "Random numbers.", _choice(SAMPLERS), choices=SAMPLERS)
    hemisphere: str = _option(
        "cosine", "How diffuse surfaces draw directions.", _choice(HEMISPHERES), choices=HEMISPHERES
    )
    light_sampling: str = _option(
        "auto",
        "How one light among many is chosen: all alike, by power, or by a tree that knows what is near; "
        "auto is tree where there are many.",
        _choice(LIGHT_SAMPLINGS),
        choices=LIGHT_SAMPLINGS,
    )
    fresnel: str = _option("exact", "Reflectance of smooth dielectrics.", _choice(FRESNELS), choices=FRESNELS)
    rr_depth: int | None = _option(
        4, "Scattering events before Russian roulette may end a path; off: never.", _optional(_integer(0, 1 << 16))
    )
    clamp_indirect: float | None = _option(
        None,
        "Limit what a path brings from its second scattering on; less noise, and too dark where it matters.",
        _optional(_real(1e-6, 1e12)),
        "W/(m^2 sr)",
    )
    regularize: bool = _option(
        False, "Blur mirrors and glass that are seen by way of other surfaces, so that caustics are smooth.", _flag
    )
    seed: int = _option(0, "Another seed gives independent noise.", _integer(0, (1 << 32) - 1))
    first_sample: int = _option(
        0, "Number of the first sample: machines that share a render take different ones.", _integer(0, 1 << 30)
    )
    filter: str = _option("box", "How samples spread over and about a pixel.", _choice(FILTERS), choices=FILTERS)
    filter_radius: float | None = _option(
        None,
        "How far the filter reaches from the middle of a pixel; that of the literature by default.",
        _optional(_real(1e-3, 64.0)),
        "pixels",
    )
    projection: str | None = _option(
        None,
        "How the camera maps directions to pixels; the camera's own by default.",
        _optional(_choice(PROJECTIONS)),
        choices=PROJECTIONS,
    )
    aperture: float | None = _option(
        None, "Lens radius; 0 is a pinhole; the camera's own by default.", _optional(_real(0.0, 1e6)), "metres"
    )
    focus: float | None = _option(
        None, "Distance of the plane in focus; the camera's own by default.", _optional(_real(1e-6, 1e9)), "metres"
    )
    focus_on: tuple[int, int] | None = _option(
        None, "Focus on what the middle of this pixel of the full image shows, in place of focus.", _optional(_pixel)
    )
    blades: int | None = _option(
        None, "Blades of the aperture, 3 to 32; 0 is a round one; the camera's own by default.", _optional(_blades)
    )
    blade_rotation: float | None = _option(
        None,
        "Turns the blades counter-clockwise from a corner on top; the camera's own by default.",
        _optional(_real(-360.0, 360.0)),
        "degrees",
    )
    exposure: float = _option(0.0, "Exposure of 8-bit images.", _real(-64.0, 64.0), "stops")
    tonemap: str = _option(
        "none",
        "Display transform of 8-bit images; linear only clamps, without the sRGB curve.",
        _choice(TONEMAPS),
        choices=TONEMAPS,
    )
    threads: int | None = _option(
        None, "CPU threads; every core that the process may use by default.", _optional(_integer(1, 4096))
    )
    kernel: str = _option(
        "auto",
        "How a GPU is driven: whole paths in one kernel, or one kernel a stage.",
        _choice(KERNELS),
        choices=KERNELS,
    )
    checkpoint_interval: float = _option(60.0, "Time between checkpoints.", _real(0.0, 1e9), "seconds")

    def __attrs_post_init__(self) -> None:
        if self.focus is not None and self.focus_on is not None:
            raise UsageError(f"focus is {self.focus:g} and focus_on is {self.focus_on}: give one of them")
        if self.noise is not None and self.kernel == "wavefront":
            raise UsageError("noise needs whole paths in one kernel: leave kernel away, or make it megakernel")
        for name in self.aov:
            if name in LIGHT_LAYERS and self.integrator != "path":
                raise UsageError(f"aov names {name}, which only the integrator path has, not {self.integrator}")
            if name in (*LIGHT_LAYERS, "emission", "variance") and self.kernel == "wavefront":
                raise UsageError(f"aov names {name}, which needs whole paths in one kernel: leave kernel away")

    @property
    def total_samples(self) -> int | None:
        """Samples per pixel at most: `spp`, or what stands for it where it is not given; None: no limit."""
        if self.spp is not None:
            return self.spp
        return _USUAL_SPP if self.time is None and self.noise is None else None

    @property
    def sample_limit(self) -> int:
        """Samples per pixel at most, as a number."""
        return self.total_samples or MAX_SPP

    def size(self, aspect: float) -> tuple[int, int]:
        """Width and height in pixels of the full image for a camera of this aspect ratio (width / height)."""
        height = self.height if self.height is not None else max(1, int(self.width / aspect + 0.5))
        if self.width * height > MAX_PIXELS:
            raise UsageError(
                f"{self.width} x {height} pixels: at most {MAX_PIXELS} are possible; choose a smaller size"
            )
        return self.width, height

    def crop_of(self, width: int, height: int) -> tuple[int, int, int, int]:
        """The part x0, y0, x1, y1 to render of a full image of this size.

        Raises:
            UsageError: the crop reaches outside the image.
        """
        if self.crop is None:
            return 0, 0, width, height
        if self.crop[2] > width or self.crop[3] > height:
            raise UsageError(f"crop {self.crop} reaches outside the image of {width} x {height} pixels")
        return self.crop

    def check_focus_on(self, width: int, height: int) -> None:
        """Make sure that `focus_on` is a pixel of a full image of this size.

        Raises:
            UsageError: it lies outside.
        """
        if self.focus_on is not None and not (self.focus_on[0] < width and self.focus_on[1] < height):
            raise UsageError(f"focus_on {self.focus_on} lies outside the image of {width} x {height} pixels")
