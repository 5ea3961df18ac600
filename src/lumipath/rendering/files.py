"""Files that are written whole or not at all, with one-line errors."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import CheckpointError, ImageError

FileError = type[ImageError] | type[CheckpointError]


@contextmanager
def reported(path: Path, error: FileError) -> Iterator[None]:
    """Turn an operating system's error into an `error` that names the file the user gave."""
    try:
        yield
    except PermissionError:
        raise error(f"{path}: no permission to write in {path.parent}; choose another folder") from None
    except (OSError, ValueError) as cause:
        reason = getattr(cause, "strerror", None) or str(cause)
        raise error(f"{path}: cannot be written: {reason}") from None


def target_of(path: Path, error: FileError, example: str) -> Path:
    """The file that `path` means, links followed, after every check that needs no writing.

    Args:
        path: as the user gave it.
        error: what to raise.
        example: name of a file, for the message where `path` is a folder.

    Raises:
        ImageError or CheckpointError (`error`): no file can be written there; the message says what to do.
    """
    with reported(path, error):
        if path.is_dir():
            raise error(f"{path} is a directory; add a file name, for example {path / example}")
        target = Path(os.path.realpath(path))
        folder = target.parent
        if not folder.exists():
            raise error(f"{path}: there is no folder {folder}; create it first (mkdir -p {folder})")
        if not folder.is_dir():
            raise error(f"{path}: {folder} is a file, not a folder")
        if target.exists() and not stat.S_ISREG(target.stat().st_mode):
            raise error(f"{path} is not a regular file; choose another name")
        if target.exists() and not os.access(target, os.W_OK):
            raise error(f"{path} is read-only; choose another name or change its permissions")
    return target


def temporary_for(target: Path) -> Path:
    """A new name in the same folder, so that the final rename cannot cross file systems."""
    # OpenImageIO knows the format by the suffix.
    return target.with_name(f".lumipath-{secrets.token_hex(6)}{target.suffix.lower()}")


def try_to_write(target: Path, error: FileError) -> None:
    """Find out whether `replacing(target)` will be possible; leaves nothing behind.

    Raises:
        ImageError or CheckpointError (`error`): it will not.
    """
    temporary = temporary_for(target)
    with reported(target, error):
        temporary.touch(exist_ok=False)
        temporary.unlink()


@contextmanager
def replacing(target: Path, temporary: Path, error: FileError) -> Iterator[None]:
    """`temporary`, written in the block, takes the place of `target` if the block succeeds, and vanishes if not.

    Whenever the process or the machine stops, `target` is the earlier file or the new one, complete.

    Raises:
        ImageError or CheckpointError (`error`): for an error of the operating system; the earlier file is still there.
    """
    try:
        with reported(target, error):
            yield
            _to_disk(temporary)
            temporary.replace(target)
            _folder_to_disk(target.parent)
    finally:
        temporary.unlink(missing_ok=True)


def claim_space(path: Path, size: int) -> None:
    """Make a file of `size` bytes, or raise an OSError now if there is no room for it."""
    with path.open("wb") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        else:
            file.write(bytes(size))


def _to_disk(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _folder_to_disk(folder: Path) -> None:
    """Make a rename in a folder last; Windows has no way to ask for it, and some file systems refuse."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:
        pass
    finally:
        os.close(handle)
