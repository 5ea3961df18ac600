"""The text of a .ray file, which knows the line and column of each of its characters."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from attrs import frozen

from ...errors import ImageError, SceneError

_SHOWN = 40


@frozen(eq=False)
class Source:
    """One .ray file.

    Args:
        text: all of it.
        path: for messages; None where the text comes from no file.
        base: the folder that `map("file")` is relative to.
    """

    text: str
    path: Path | None
    base: Path

    def error(self, message: str, offset: int) -> SceneError:
        """A `SceneError` placed at the character `offset`."""
        column = offset - self.text.rfind("\n", 0, offset)
        return SceneError(message, self.path, self.line(offset), column)

    def line(self, offset: int) -> int:
        """The line of the character `offset`, counted from 1."""
        return self.text.count("\n", 0, offset) + 1

    @contextmanager
    def placing(self, offset: int) -> Iterator[None]:
        """Give errors that know no place, as those of the scene classes, the place `offset`."""
        try:
            yield
        except SceneError as error:
            if error.line is not None:
                raise
            raise self.error(error.message, offset) from None
        except ImageError as error:
            raise self.error(str(error), offset) from None


def shown(text: str) -> str:
    """`text` in quotes on one line, cut where it is long."""
    return repr(str(text) if len(text) <= _SHOWN else text[:_SHOWN] + "...")
