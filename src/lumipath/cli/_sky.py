"""`--environment sky:elevation=30,turbidity=4`: a sky by its fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import LumipathError, UsageError

if TYPE_CHECKING:
    from ..scene import Sky

_NUMBERS = ("elevation", "azimuth", "turbidity", "albedo", "sun_angle", "scale")
_SWITCHES = {"on": True, "off": False}


def is_sky(text: str) -> bool:
    """Whether an environment is given by the fields of a sky, and not by a file."""
    return text == "sky" or text.startswith("sky:")


def parse_sky(text: str) -> Sky:
    """The sky that `sky` or `sky:key=value,...` stands for.

    Raises:
        UsageError: an unknown field, or a value that is wrong.
    """
    from ..scene import Sky

    fields: dict[str, float | bool] = {}
    for part in filter(None, text.removeprefix("sky").removeprefix(":").split(",")):
        key, _, value = part.partition("=")
        if key == "sun" and value in _SWITCHES:
            fields[key] = _SWITCHES[value]
        elif key in _NUMBERS:
            fields[key] = _number(part, value)
        else:
            wanted = ", ".join(f"{name}=NUMBER" for name in _NUMBERS)
            raise UsageError(f"--environment {text}: {part!r} is none of {wanted}, sun=on, sun=off")
    try:
        return Sky(**fields)  # type: ignore[arg-type]
    except LumipathError as error:
        raise UsageError(f"--environment {text}: {error}") from None


def _number(part: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise UsageError(f"--environment: {part!r} must be a number, such as elevation=30") from None
