"""The disk cache of compiled code, keyed by all sources.

Numba's own cache looks at one file only, so a change in an imported kernel goes unnoticed. Here the folder's name is a
hash of every source that reaches a compiler and of the compilers' versions: stale code can never be loaded.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
import platformdirs
from numba.core import caching
from numba.core.dispatcher import Dispatcher

_PACKAGE = Path(__file__).resolve().parent.parent
_KERNEL_SOURCES = ("lang", "kernels", "accel", "pack", "devices")


@cache
def source_hash() -> str:
    """A hash of every source that reaches a compiler and of the versions that turn them into machine code."""
    digest = hashlib.sha256()
    for path in sorted(path for part in _KERNEL_SOURCES for path in (_PACKAGE / part).rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    for version in (sys.version, numba.__version__, llvmlite.__version__, np.__version__, platform.machine()):
        digest.update(version.encode())
    return digest.hexdigest()[:20]


@cache
def cache_folder() -> Path:
    """Where compiled kernels lie: $LUMIPATH_CACHE or the user's cache folder; a temporary one if it is read-only."""
    root = Path(os.environ.get("LUMIPATH_CACHE") or platformdirs.user_cache_path("lumipath"))
    folder = root / "kernels" / source_hash()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"lumipath-{os.getuid() if hasattr(os, 'getuid') else 0}" / source_hash()
        folder.mkdir(parents=True, exist_ok=True)
    return folder


_listeners: list[Callable[[], None]] = []


@contextmanager
def when_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call `tell`, once, as soon as the block needs machine code that is not on disk and takes seconds to compile."""
    _listeners.append(tell)
    try:
        yield
    finally:
        if tell in _listeners:
            _listeners.remove(tell)


def announce_compiling() -> None:
    """Tell whoever waits for it that something is going to be compiled."""
    while _listeners:
        _listeners.pop()()


class _NotOnDiskError(Exception):
    """Something would have to be compiled where that is not wanted."""


_may_compile = ContextVar("may_compile", default=True)


def is_on_disk(work: Callable[[], Any]) -> bool:
    """Call `work`, up to where it needs machine code that is neither loaded nor on disk; whether it got to its end."""
    before = _may_compile.set(False)
    try:
        work()
    except _NotOnDiskError:
        return False
    finally:
        _may_compile.reset(before)
    return True


class _Locator(caching._CacheLocator):
    """One folder for all kernels; the folder is the stamp."""

    def __init__(self, py_func: object) -> None:
        code = py_func.__code__  # type: ignore[attr-defined]
        self._name = f"{code.co_firstlineno}-{hashlib.sha256(code.co_filename.encode()).hexdigest()[:8]}"

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return source_hash()

    def get_disambiguator(self) -> str:
        return self._name

    @classmethod
    def from_function(cls, py_func: object, py_file: str) -> _Locator:
        return cls(py_func)


class _CacheImpl(caching.CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _CacheFile(caching.IndexDataCacheFile):
    """Code in files named by what it is compiled for.

    Numba numbers its files in an index, where of two processes that save at once one would lose its entry.
    """

    def _name_for(self, key: object) -> str:
        return self._data_name(int(hashlib.sha256(repr(key).encode()).hexdigest()[:15], 16))

    def save(self, key: object, data: object) -> None:
        self._save_data(self._name_for(key), data)

    def load(self, key: object) -> Any:
        try:
            return self._load_data(self._name_for(key))
        except FileNotFoundError:
            return None


class KernelCache(caching.FunctionCache):
    """Numba's function cache in our folder."""

    _impl_class = _CacheImpl

    def __init__(self, py_func: object) -> None:
        super().__init__(py_func)
        self._cache_file = _CacheFile(self._cache_path, self._impl.filename_base, source_hash())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What was compiled for a signature; None, and a word to who waits for it, where there is nothing."""
        found = super().load_overload(sig, target_context)
        if found is None:
            if not _may_compile.get():
                raise _NotOnDiskError
            announce_compiling()
        return found


def enable_cache(dispatcher: Dispatcher, function: Callable[..., Any]) -> None:
    """Keep what `dispatcher` compiles on disk, under the name of `function`."""
    dispatcher._cache = KernelCache(function)
