"""The kernel language: Python functions on float32, int32, uint32, Vec3 and structs, compiled for every device.

This package is the only place that touches Numba's internals. Everything else imports from here:

- `kernel` marks a device function, `entry` a function that threads call, `compiled` ordinary host code;
- `struct` makes value types, `Vec3` is the one with arithmetic;
- `intrinsics` of memory and bits: `load`, `load4`, `store`, `stack_floats`, `as_int`, `reverse_bits`, ...;
- `lanes` holds SIMD values.

With LUMIPATH_DEBUG_PYTHON=1 in the environment nothing is compiled: kernels run as plain Python, slowly, under any
debugger.
"""

from .bits import as_float, as_int, as_uint, count_bits, lowest_bit, reverse_bits
from .cache import cache_folder, when_compiling
from .calls import called_not_inlined
from .features import Features, features_of
from .kernel import KernelError, compiled, entry, kernel
from .maths import approximate_reciprocal, inverse, sqrt
from .memory import (
    aligned,
    aligned_empty,
    fetch_add,
    get,
    load,
    load4,
    load_result,
    prefetch,
    put,
    read4,
    read_clock,
    stack_floats,
    stack_ints,
    start_of,
    store,
    store_result,
    write4,
)
from .scalars import DEBUG_PYTHON, INF, INV_PI, PI, TWO_PI, f32, i32, u32
from .struct import struct
from .vector import Vec3

__all__ = [
    "DEBUG_PYTHON",
    "INF",
    "INV_PI",
    "PI",
    "TWO_PI",
    "Features",
    "KernelError",
    "Vec3",
    "aligned",
    "aligned_empty",
    "approximate_reciprocal",
    "as_float",
    "as_int",
    "as_uint",
    "cache_folder",
    "called_not_inlined",
    "compiled",
    "count_bits",
    "entry",
    "f32",
    "features_of",
    "fetch_add",
    "get",
    "i32",
    "inverse",
    "kernel",
    "load",
    "load4",
    "load_result",
    "lowest_bit",
    "prefetch",
    "put",
    "read4",
    "read_clock",
    "reverse_bits",
    "sqrt",
    "stack_floats",
    "stack_ints",
    "start_of",
    "store",
    "store_result",
    "struct",
    "u32",
    "when_compiling",
    "write4",
]
