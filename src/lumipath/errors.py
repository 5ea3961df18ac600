"""What can go wrong, as a tree of exceptions: each class is one exit code of the command line."""

from __future__ import annotations

from pathlib import Path


class LumipathError(Exception):
    """Base of every error that lumipath raises on purpose; its message is one line: what, where, what to do."""

    exit_code = 1


class RenderError(LumipathError):
    """Rendering failed after it had begun."""

    exit_code = 1


class UsageError(LumipathError):
    """An option or argument is not what it must be."""

    exit_code = 2


class SceneError(LumipathError):
    """A scene is missing, unreadable or wrong.

    Args:
        message: what is wrong and what to do about it, without the place.
        path: the file, if the scene came from one.
        line: line in the file, counted from 1.
        column: column in the line, counted from 1.
    """

    exit_code = 3

    def __init__(
        self, message: str, path: str | Path | None = None, line: int | None = None, column: int | None = None
    ) -> None:
        self.message, self.path, self.line, self.column = message, path, line, column
        place = ":".join(str(part) for part in (path, line, column) if part is not None)
        super().__init__(f"{place}: {message}" if place else message)

    def __reduce__(self) -> tuple[type[SceneError], tuple[object, ...]]:
        """Pickle by constructor arguments, so that an error can cross a process boundary."""
        return type(self), (self.message, self.path, self.line, self.column)


class ImageError(LumipathError):
    """An image file cannot be read or written."""

    exit_code = 3


class CheckpointError(LumipathError):
    """A checkpoint cannot be read or written, or belongs to another render."""

    exit_code = 3


class DeviceError(LumipathError):
    """The device asked for is not there or cannot be used."""

    exit_code = 4


class LumipathWarning(UserWarning):
    """Something in the input was ignored or replaced; the message says what and where."""
