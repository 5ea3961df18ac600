"""Compiling in a second process beside this one: Numba compiles under one lock, so that threads would take turns."""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from .cache import announce_compiling, is_on_disk
from .host import usable_cores
from .scalars import DEBUG_PYTHON

# Many times what it takes; then something is wrong with the child, and this process goes on alone.
_PATIENCE_SECONDS = 60.0


@contextmanager
def compiled_beside(work: partial[Any], threads: int | None = None) -> Iterator[None]:
    """A block of other work, at whose end what `work` calls is compiled and on disk, by a second process meanwhile.

    Where all is on disk already no process is started, nor where only one thread may be used. Whatever happens to that
    process, `work` can be called afterwards: what is not on disk is compiled then.

    Args:
        work: a function of a module, with arguments that can be pickled; quick once it is compiled, since it is called
            here too, as far as it gets without compiling.
        threads: that may be used; every core that the process may use where None.
    """
    cores = usable_cores()
    if DEBUG_PYTHON or min(threads or cores, cores) < 2 or is_on_disk(work):
        yield
        return
    announce_compiling()
    child = _start(work)
    try:
        yield
        if child is not None:
            with suppress(subprocess.TimeoutExpired):
                child.wait(_PATIENCE_SECONDS)
    finally:
        # After an interrupt, or where it took too long; one that has ended is left alone.
        if child is not None:
            child.kill()
            child.wait()


def _start(work: partial[Any]) -> subprocess.Popen[bytes] | None:
    """A Python of its own that calls `work`, in silence; None where none can be started."""
    # A frozen program is no Python, and where one is part of another program, that may stand in its place.
    if getattr(sys, "frozen", False) or not Path(sys.executable or "").name.lower().startswith("python"):
        return None
    # Paths come first, so that the child finds the same modules and none in the folder that it runs in.
    code = f"import sys; sys.path[:] = {sys.path!a}; import pickle; pickle.loads({pickle.dumps(work)!r})()"
    # On Windows a window would open beside a program that has none.
    flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)
    try:
        return subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            creationflags=flags,
        )
    except OSError:
        return None
