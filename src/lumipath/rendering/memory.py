"""How much memory there is."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import UsageError

_MEMINFO = Path("/proc/meminfo")
# The limit of a container, where there is one.
_LIMITS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))


def available_memory() -> int | None:
    """Bytes that this process can still get, at most; None where nobody knows.

    On Linux free memory, caches that can be dropped and swap, within the limit of the container; elsewhere all memory.
    """
    bounds = [bound for bound in (_free(), *map(_limit, _LIMITS)) if bound is not None]
    return min(bounds, default=_installed())


def require_memory(width: int, height: int, bytes_per_pixel: int, what: str) -> None:
    """Make sure that there is memory for so many bytes a pixel, which `what` needs.

    Raises:
        UsageError: there is not.
    """
    needed, available = width * height * bytes_per_pixel, available_memory()
    if available is not None and needed > available:
        raise UsageError(
            f"{width} x {height} pixels need {needed} bytes for {what}, and {available} are available; "
            "choose a smaller size, or render it in crops"
        )


def _free() -> int | None:
    try:
        rows = dict(line.split(":", 1) for line in _MEMINFO.read_text().splitlines() if ":" in line)
        return sum(int(rows[name].split()[0]) * 1024 for name in ("MemAvailable", "SwapFree"))
    except (OSError, KeyError, ValueError):
        return None


def _limit(path: Path) -> int | None:
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        # No container, or the word "max".
        return None


def _installed() -> int | None:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None
