"""RenderSettings as command-line flags: nothing about a setting is declared here but its short flag."""

from __future__ import annotations

import difflib
import inspect
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any

import attrs
import typer
from attrs import frozen

from ..errors import UsageError
from ..settings import RenderSettings

SHORT_FLAGS = {"spp": "-s", "max_depth": "-r", "width": "-w"}

_NO_VALUE = ("off", "none", "auto")
_KIND_NAMES = {int: "a whole number", float: "a number", bool: "on or off"}
_SWITCHES = {"on": True, "true": True, "off": False, "false": False}
_METAVARS = {int: "N", float: "X", str: "TEXT", bool: "on|off", list: "NAME,..."}
_TUPLE_METAVARS = {2: "X,Y", 4: "X0,Y0,X1,Y1"}
_DEFAULTS = RenderSettings()


@frozen
class Setting:
    """A field of RenderSettings as the command line sees it."""

    name: str
    kind: type
    """int, float, str, bool, tuple (of whole numbers), or list (of names, as a tuple)."""
    length: int
    """Of the tuple; 0 for anything else."""
    may_be_off: bool
    help: str
    unit: str
    choices: tuple[str, ...]

    @property
    def flag(self) -> str:
        """The long flag."""
        return "--" + self.name.replace("_", "-")

    def means_off(self, text: str) -> bool:
        """Whether `text` is one of the words that stand for None."""
        return self.may_be_off and self.kind is not str and text.lower() in _NO_VALUE

    def parse(self, text: str, source: str) -> Any:
        """The value that `text` stands for; `source` is the flag, for the message.

        Raises:
            UsageError: it is no number where one is needed. Ranges and choices are left to RenderSettings.
        """
        if self.means_off(text):
            return None
        try:
            if self.kind is list:
                return tuple(part.strip() for part in text.split(",") if part.strip())
            if self.kind is tuple:
                return tuple(int(part) for part in text.split(","))
            return _SWITCHES[text.lower()] if self.kind is bool else self.kind(text)
        except (KeyError, ValueError):
            wanted = _KIND_NAMES.get(self.kind, "whole numbers with commas between them")
            raise UsageError(f"{source} is {text!r}: it must be {wanted}") from None

    def help_text(self, default: Any) -> str:
        """The meaning, the unit and the default."""
        notes = [self.unit, "" if default in (None, ()) else f"default {default}"]
        noted = ", ".join(note for note in notes if note)
        return f"{self.help} [{noted}]" if noted else self.help

    def metavar(self, default: Any) -> str:
        """What stands for the value in the help."""
        name = "|".join(self.choices) or (_TUPLE_METAVARS[self.length] if self.length else _METAVARS[self.kind])
        return f"{name}|off" if self.may_be_off and default is not None else name

    def parameter(self, default: Any) -> inspect.Parameter:
        """The flag as a parameter of a typer command: a list of texts, so that giving it twice can be noticed."""
        flags = [self.flag, *([SHORT_FLAGS[self.name]] if self.name in SHORT_FLAGS else [])]
        help_text = self.help_text(default)
        option = typer.Option(*flags, metavar=self.metavar(default), help=help_text, show_default=False)
        return inspect.Parameter(
            self.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[list[str] | None, option]
        )


def _kind_of(annotation: Any) -> tuple[type, int, bool]:
    """The one type to parse for an annotation such as `int | None`, the length of a tuple, whether None is possible."""
    members = typing.get_args(annotation) if isinstance(annotation, types.UnionType) else (annotation,)
    # A camera is a name or an index: a text can be both.
    kind = str if str in members else next(member for member in members if member is not types.NoneType)
    parts = typing.get_args(kind)
    if Ellipsis in parts:
        return list, 0, types.NoneType in members
    return typing.get_origin(kind) or kind, len(parts), types.NoneType in members


def _all_settings() -> dict[str, Setting]:
    hints = typing.get_type_hints(RenderSettings)
    settings = {}
    for attribute in attrs.fields(RenderSettings):
        kind, length, may_be_off = _kind_of(hints[attribute.name])
        settings[attribute.name] = Setting(
            name=attribute.name,
            kind=kind,
            length=length,
            may_be_off=may_be_off,
            help=attribute.metadata["help"],
            unit=attribute.metadata["unit"],
            choices=attribute.metadata["choices"],
        )
    return settings


SETTINGS = _all_settings()


def with_setting_flags(
    *names: str, base: RenderSettings = _DEFAULTS
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command that ends in `**flags` one flag for each of these settings (all where none is named).

    Args:
        names: fields of RenderSettings.
        base: where the defaults that the help shows come from; `settings_from` must get the same.
    """
    chosen = [SETTINGS[name] for name in names or SETTINGS]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(command, eval_str=True)
        own = [p for p in signature.parameters.values() if p.kind is not inspect.Parameter.VAR_KEYWORD]
        made = [setting.parameter(getattr(base, setting.name)) for setting in chosen]
        parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in own] + made
        command.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        command.__annotations__ = {p.name: p.annotation for p in parameters}
        return command

    return decorate


@frozen
class Given:
    """One value that the user gave: where, for which setting, as which text."""

    source: str
    name: str
    text: str


def from_flags(flags: Mapping[str, list[str] | None]) -> list[Given]:
    """What the flags made by `with_setting_flags` were given."""
    return [Given(SETTINGS[name].flag, name, text) for name, texts in flags.items() for text in texts or ()]


def from_size(size: str | None) -> list[Given]:
    """`640x480` as width and height.

    Raises:
        UsageError: it is not written so.
    """
    if size is None:
        return []
    width, cross, height = size.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise UsageError(f"--size is {size!r}: it must be WIDTHxHEIGHT, such as 640x480")
    return [Given("--size", "width", width), Given("--size", "height", height)]


def from_definitions(definitions: Iterable[str]) -> list[Given]:
    """Each `key=value` of `-D`.

    Raises:
        UsageError: no `=`, or no such setting; the message gives near matches.
    """
    given = []
    for definition in definitions:
        key, equals, text = definition.partition("=")
        name = key.strip().replace("-", "_")
        if not equals:
            raise UsageError(f"-D {definition}: it must be key=value, such as -D spp=64")
        if name not in SETTINGS:
            near = difflib.get_close_matches(name, SETTINGS, 3, cutoff=0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there are {', '.join(SETTINGS)}"
            raise UsageError(f"-D {definition}: no setting {key!r}; {hint}")
        given.append(Given(f"-D {key}", name, text.strip()))
    return given


def settings_from(given: Iterable[Given], base: RenderSettings = _DEFAULTS) -> RenderSettings:
    """The settings that were given, those of `base` for the rest.

    Raises:
        UsageError: a value is wrong, or one setting was given two different values.
    """
    values: dict[str, Any] = {}
    sources: dict[str, Given] = {}
    for item in given:
        value = SETTINGS[item.name].parse(item.text, item.source)
        before = sources.setdefault(item.name, item)
        if item.name in values and values[item.name] != value:
            raise UsageError(
                f"{item.name} is given twice, as {before.source} {before.text} and {item.source} {item.text}; keep one"
            )
        values[item.name] = value
    # Two ways to focus exclude each other: what is given here takes the place of either in `base`.
    for one, other in (("focus", "focus_on"), ("focus_on", "focus")):
        if values.get(one) is not None:
            values.setdefault(other, None)
    return attrs.evolve(base, **values)
