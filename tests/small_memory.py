"""Compiles in child processes: a compiler keeps some 80 MB of each program it has made, and tests make hundreds."""

from __future__ import annotations

import os
import pickle
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from lumipath.lang import cuda
from lumipath.lang.cache import KernelCache

compile_here, ptx_here = Dispatcher.compile, cuda.compile_ptx
_compiled_here: set[str] = set()


def in_child(work: Any) -> Any:
    """What `work()` returns in a copy of this process, whose memory goes when it ends; None where it fails there."""
    reader, writer = os.pipe()
    # A copy of the lock that another thread holds would never be released.
    with global_compiler_lock:
        child = os.fork()
    if child == 0:
        try:
            answer = pickle.dumps(work())
            with os.fdopen(writer, "wb") as pipe:
                pipe.write(answer)
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    return pickle.loads(answer) if answer else None


def is_first(function: Any) -> bool:
    """Whether this process has compiled no such function yet: later children find what they have in common with it."""
    if function.__qualname__ in _compiled_here:
        return False
    _compiled_here.add(function.__qualname__)
    return True


def compile_in_child(dispatcher: Dispatcher, signature: Any) -> Any:
    """A child compiles what is kept on disk, and this process loads it from there; or does it itself, and fails."""
    missing = isinstance(dispatcher._cache, KernelCache) and not dispatcher.overloads.get(tuple(signature))
    if missing and not is_first(dispatcher.py_func):
        in_child(lambda: compile_here(dispatcher, signature) and None)
    return compile_here(dispatcher, signature)


def ptx_in_child(function: Any, *arguments: Any) -> str:
    """As `compile_ptx`."""
    made = None if is_first(function) else in_child(lambda: ptx_here(function, *arguments))
    return made or ptx_here(function, *arguments)


def install() -> None:
    """Compile in children from now on, where there is a `fork`, and no GPU whose context would be copied."""
    from lumipath.devices import list_devices

    if hasattr(os, "fork") and all(info.kind == "cpu" for info in list_devices()):
        Dispatcher.compile = compile_in_child
        cuda.compile_ptx = ptx_in_child
