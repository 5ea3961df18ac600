"""`lumipath image`: what is done with pictures after rendering."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import ImageError, UsageError
from ._settings import from_flags, settings_from, with_setting_flags
from ._terminal import show, show_error, show_json, table

if TYPE_CHECKING:
    from ..imaging.comparison import Comparison

app = typer.Typer(
    help="Look at, compare, convert, denoise and merge images.", rich_markup_mode=None, no_args_is_help=True
)

# Those of which less is better.
_ERRORS = ("mse", "relative_mse", "flip")

ImageArgument = Annotated[Path, typer.Argument(metavar="IMAGE", help="An image file or a checkpoint.")]
OutputOption = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="PNG, JPEG, EXR, HDR, NPY or NPZ.")]


@app.callback()
def image() -> None:
    """Look at, compare, convert, denoise and merge images."""


@app.command()
def info(image: ImageArgument, as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False) -> None:
    """Size, channels, statistics and metadata of IMAGE."""
    from ..imaging.statistics import describe

    facts = describe(image)
    if as_json:
        show_json(facts)
    else:
        show(table(_rows(facts)))


def _rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [("file", facts["file"]), ("format", facts["format"])]
    rows.append(("size", f"{facts['width']} x {facts['height']} pixels"))
    rows += [("layers", ", ".join(facts["layers"]))] if facts.get("layers") else []
    for channel in facts["channels"]:
        bad = f", {channel['not_finite']:,} not finite" if channel["not_finite"] else ""
        numbers = f"{channel['min']:.4g} to {channel['max']:.4g}, mean {channel['mean']:.4g}"
        rows.append((channel["name"], f"{channel['type']}, {numbers}{bad}"))
    rows += [(name, str(value)) for name, value in facts["metadata"].items()]
    for part in facts.get("ranges", []):
        rows.append(("holds", f"samples {part['first']} to {part['stop'] - 1} of seed {part['seed']}"))
    return rows


@app.command()
def diff(
    image: ImageArgument,
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="What IMAGE should look like.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", "--heat-map", metavar="FILE", help="A heat map of FLIP errors.")
    ] = None,
    fail_above: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=X", help="Exit with 1 if mse, relative_mse or flip is above X; may be repeated."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False,
) -> None:
    """How much IMAGE differs from REFERENCE."""
    from ..imaging.comparison import FLIP_HINT, compare
    from ..imaging.files import open_image
    from ..rendering.image import check_writable

    limits = [_limit(text) for text in fail_above or []]
    if output is not None:
        check_writable(output)
    # An 8-bit file has no other exposures to look at.
    result = compare(open_image(image), open_image(reference), hdr=not (_is_8_bit(image) or _is_8_bit(reference)))
    if output is not None:
        result.heat_map().save(output)
    if as_json:
        show_json(result.as_dict())
    else:
        flip = FLIP_HINT if result.flip is None else f"{result.flip:.6f} ({result.flip_kind}-FLIP)"
        rows = [("mse", f"{result.mse:.6g}"), ("relative_mse", f"{result.relative_mse:.6g}")]
        rows += [("psnr", f"{result.psnr:.2f} dB"), ("flip", flip)]
        rows += [("not_finite", f"{result.not_finite:,} pixels")] if result.not_finite else []
        show(table(rows))
    _judge(result, limits)


def _is_8_bit(path: Path) -> bool:
    return path.suffix.lower() in (".png", ".jpg", ".jpeg")


def _limit(text: str) -> tuple[str, float]:
    name, equals, number = text.partition("=")
    try:
        limit = float(number)
    except ValueError:
        limit = float("nan")
    if name not in _ERRORS or not equals or not limit >= 0:
        raise UsageError(f"--fail-above is {text!r}: it must be NAME=X, NAME one of {', '.join(_ERRORS)}, X a number")
    return name, limit


def _judge(result: Comparison, limits: list[tuple[str, float]]) -> None:
    from ..imaging.comparison import FLIP_HINT

    above = []
    for name, limit in limits:
        value = getattr(result, name)
        if value is None:
            raise UsageError(FLIP_HINT)
        above += [f"{name} is {value:.6g}, above {limit:g}"] if value > limit else []
    if above:
        show_error("; ".join(above))
        raise typer.Exit(1)


@app.command()
@with_setting_flags("exposure", "tonemap")
def tonemap(
    image: ImageArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="PNG or JPEG.")],
    false_colour: Annotated[
        bool, typer.Option("--false-colour", help="Show luminance as colours, in stops about middle grey.")
    ] = False,
    stops: Annotated[
        str, typer.Option(metavar="LOW,HIGH", help="Range of the false colours. [stops, default -8,8]")
    ] = "-8,8",
    **flags: Any,
) -> None:
    """Make an 8-bit picture of IMAGE."""
    from ..imaging.falsecolour import false_colour as coloured
    from ..imaging.files import open_image
    from ..rendering.image import check_writable

    settings = settings_from(from_flags(flags))
    if not _is_8_bit(output):
        raise ImageError(f"{output}: only 8-bit files are tone mapped; use .png or .jpg")
    check_writable(output)
    picture = open_image(image)
    if not false_colour:
        picture.select_layers().save(output, exposure=settings.exposure, tonemap=settings.tonemap)
        return
    low, high = _stops(stops)
    # Exposure moves the scale; the colours themselves must not be mapped again.
    coloured(picture, low - settings.exposure, high - settings.exposure).save(output)


def _stops(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--stops is {text!r}: it must be LOW,HIGH, such as -8,8") from None
    return low, high


@app.command()
@with_setting_flags("exposure", "tonemap")
def denoise(
    image: ImageArgument,
    output: OutputOption,
    albedo: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Albedo; the layer of IMAGE by default, if it has one.")
    ] = None,
    normal: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Normals, EXR or NPY; the layer of IMAGE by default.")
    ] = None,
    **flags: Any,
) -> None:
    """Remove the noise of IMAGE with Open Image Denoise."""
    from ..imaging.denoising import denoise as denoised
    from ..imaging.denoising import require_denoiser
    from ..imaging.files import open_image
    from ..rendering.image import LAYER_SUFFIXES, check_writable

    settings = settings_from(from_flags(flags))
    require_denoiser()
    check_writable(output)
    if normal is not None and _is_8_bit(normal):
        raise ImageError(f"{normal}: an 8-bit file cannot hold normals; use EXR or NPY")
    given = {"albedo": albedo, "normal": normal}
    guides = {name: None if path is None else open_image(path).pixels for name, path in given.items()}
    result = denoised(open_image(image), **guides)
    # A picture of eight bits is for looking at, and has no room for layers.
    result = result if output.suffix.lower() in LAYER_SUFFIXES else result.select_layers()
    result.save(output, exposure=settings.exposure, tonemap=settings.tonemap)


@app.command()
@with_setting_flags("exposure", "tonemap")
def merge(
    checkpoints: Annotated[list[Path], typer.Argument(metavar="CHECKPOINT...", help="Films of one picture.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="An image, or else a checkpoint.")],
    **flags: Any,
) -> None:
    """Add up checkpoints of one picture with other seeds or samples."""
    from ..imaging.files import is_image_name
    from ..rendering.checkpoint import check_target
    from ..rendering.image import LAYER_SUFFIXES, check_writable
    from ..rendering.merging import merge as merged

    settings = settings_from(from_flags(flags))
    if is_image_name(output):
        check_writable(output)
        image = merged(checkpoints).image()
        # A picture of eight bits has no room for layers.
        image = image if output.suffix.lower() in LAYER_SUFFIXES else image.select_layers()
        image.save(output, exposure=settings.exposure, tonemap=settings.tonemap)
    else:
        check_target(output)
        merged(checkpoints).save(output)
