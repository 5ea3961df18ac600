"""What the processor of this machine can do, as the compiler and the operating system see it."""

from __future__ import annotations

import os
from functools import cache

import llvmlite.binding as llvm

_VECTOR_BITS = {"avx512f": 512, "avx2": 256, "avx": 256, "sse4.2": 128, "neon": 128}


def usable_cores() -> int:
    """Number of cores that this process may run on, which on clusters is often fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def vector_units() -> tuple[str, int]:
    """The widest vector instructions, by their name, and the width of their registers in bits; `scalar`, 0 for none."""
    features = llvm.get_host_cpu_features()
    return next(((name, bits) for name, bits in _VECTOR_BITS.items() if features.get(name)), ("scalar", 0))
