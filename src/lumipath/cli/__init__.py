"""The command line: one file a verb. Heavy libraries are imported by the verbs that need them, when they run."""

from __future__ import annotations

import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Annotated, Any, TextIO

import typer

from ..errors import LumipathError, LumipathWarning
from . import bench, devices, image, info, render, scenes
from ._signals import exit_code, sigterm_as_interrupt
from ._terminal import one_line, show, show_error, show_warning

# Plain help: rich would take longer to import than everything else together.
_app = typer.Typer(
    name="lumipath",
    rich_markup_mode=None,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_app.command()(render.render)
_app.command()(info.info)
_app.command()(scenes.scenes)
_app.command()(devices.devices)
_app.add_typer(image.app, name="image")
_app.add_typer(bench.app, name="bench")

# All errors in how a command line is written; the class has no public name in every version of typer.
_CommandLineError: Any = typer.BadParameter.__base__


def _version() -> str:
    from importlib import metadata

    try:
        return metadata.version("lumipath")
    except metadata.PackageNotFoundError:
        return "(not installed)"


@_app.callback(invoke_without_command=True)
def _lumipath(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """A physically based path tracer."""
    if version:
        show(f"lumipath {_version()}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        show(context.get_help())
        raise typer.Exit


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; `arguments` are those of the process by default.

    Returns:
        The exit code: 0 done, 1 render failed, 2 usage, 3 bad scene or image, 4 device not available, 128 + the
        signal's number when stopped by one (130 for Ctrl-C). No error escapes: each is one line on stderr.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    with warnings.catch_warnings(), sigterm_as_interrupt():
        warnings.simplefilter("always", LumipathWarning)
        warnings.showwarning = _show_warning
        try:
            return _invoke(arguments)
        except KeyboardInterrupt as interrupt:
            show_error("interrupted; nothing was written")
            return exit_code(interrupt)
        except LumipathError as error:
            show_error(error)
            return error.exit_code
        except Exception as error:
            return _report_unexpected(error, arguments)


def _invoke(arguments: list[str]) -> int:
    # Not through typer's own main: that would catch interrupts and print usage errors on several lines.
    command = typer.main.get_command(_app)
    try:
        with command.make_context("lumipath", arguments) as context:
            command.invoke(context)
    except typer.Exit as end:
        return end.exit_code
    except _CommandLineError as error:
        place = error.ctx.command_path if error.ctx else "lumipath"
        show_error(f"{error.format_message().rstrip('.')}; see {place} --help")
        return int(error.exit_code)
    return 0


def _report_unexpected(error: Exception, arguments: list[str]) -> int:
    if "-v" in arguments or "--verbose" in arguments:
        traceback.print_exception(error)
        return 1
    show_error(f"unexpected {type(error).__name__}: {one_line(error)}; run render with -v for the traceback")
    return 1


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    if issubclass(category, LumipathWarning):
        show_warning(message)
    else:
        show_warning(f"{category.__name__} from {filename}:{lineno}: {message}")
