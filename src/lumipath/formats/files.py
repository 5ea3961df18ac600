"""Opening of files, with one-line errors."""

from __future__ import annotations

from pathlib import Path

from ..errors import CheckpointError, ImageError, SceneError


def require_file(path: Path, error: type[SceneError] | type[ImageError] | type[CheckpointError] = SceneError) -> None:
    """Make sure that `path` is a regular file that may be read.

    Raises:
        SceneError, ImageError or CheckpointError (`error`): it is missing, a folder, or may not be read; the message
            says which.
    """
    try:
        if path.is_dir():
            raise error(f"{path} is a folder: name a file in it")
        if path.exists() and not path.is_file():
            raise error(f"{path} is not a regular file: copy it to one")
        with path.open("rb"):
            pass
    except (OSError, ValueError) as cause:
        reason = getattr(cause, "strerror", None) or str(cause)
        raise error(f"cannot read {str(path)!r}: {reason}; check the name and the permissions") from None


def read_bytes(path: Path) -> bytes:
    """All bytes of a file.

    Raises:
        SceneError: it is missing, a folder, or may not be read; the message says which.
    """
    require_file(path)
    try:
        return path.read_bytes()
    except OSError as cause:
        raise SceneError(f"cannot read {str(path)!r}: {cause.strerror}; check the disk") from None
