"""The scalar types of kernels, and the constants that every kernel needs, as float32."""

from __future__ import annotations

import os

import numpy as np

f32 = np.float32
i32 = np.int32
u32 = np.uint32

PI = f32(np.pi)
TWO_PI = f32(2 * np.pi)
INV_PI = f32(1 / np.pi)
INF = f32(np.inf)

DEBUG_PYTHON = os.environ.get("LUMIPATH_DEBUG_PYTHON", "0") not in ("", "0")
"""Run kernels as plain Python instead of compiling them."""


def quiet_arithmetic() -> None:
    """In plain Python, let this thread wrap around and divide by 0 without a warning, as compiled kernels do."""
    if DEBUG_PYTHON:
        np.seterr(over="ignore", divide="ignore", invalid="ignore")


quiet_arithmetic()
