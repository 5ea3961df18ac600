"""The CUDA driver: devices, memory, modules, launches. Every failure is a one-line DeviceError."""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import DeviceError

INSTALL_HINT = "install it with: pip install 'lumipath[cuda]' (drivers before 580: 'lumipath[cuda12]')"
MINIMUM_CAPABILITY = (7, 5)


class OutOfMemoryError(DeviceError):
    """A GPU has no memory left."""


class NoGpuError(DeviceError):
    """There is no NVIDIA GPU, or no driver for it."""


def _bindings() -> Any:
    """The driver's Python binding.

    Raises:
        DeviceError: it is not installed.
    """
    try:
        from cuda.bindings import driver
    except ImportError:
        raise DeviceError(f"CUDA support is not installed; {INSTALL_HINT}") from None
    return driver


def is_installed() -> bool:
    """Whether numba-cuda and the driver's binding are installed."""
    try:
        return all(find_spec(name) is not None for name in ("numba_cuda", "cuda.bindings"))
    except ModuleNotFoundError:
        return False


def require_installed() -> None:
    """Nothing if CUDA support is installed.

    Raises:
        DeviceError: it is not; the message says how to install it.
    """
    if not is_installed():
        kind = DeviceError if _driver_is_there() else NoGpuError
        raise kind(f"CUDA support is not installed; {INSTALL_HINT}")


def _driver_is_there() -> bool:
    """Whether the driver's library can be loaded; a machine without a GPU has none."""
    try:
        ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    return True


def check(result: Any, doing: str) -> Any:
    """The value of a driver call.

    Raises:
        DeviceError: the call failed; the message says what was being done and the driver's reason.
    """
    driver = _bindings()
    error, *values = result
    if error != driver.CUresult.CUDA_SUCCESS:
        if error == driver.CUresult.CUDA_ERROR_OUT_OF_MEMORY:
            raise OutOfMemoryError(
                f"the GPU is out of memory while {doing}; render a smaller image or scene, or use --device cpu"
            )
        raise DeviceError(f"CUDA failed while {doing}: {str(error).rsplit('.', 1)[-1]}")
    return values[0] if len(values) == 1 else values


def device_count() -> int:
    """Number of GPUs.

    Raises:
        DeviceError: no driver, one that is too old, or no GPU; the message says which.
    """
    driver = _bindings()
    try:
        (error,) = driver.cuInit(0)
    except RuntimeError:
        raise NoGpuError("no NVIDIA driver found; install one, or use --device cpu") from None
    if error == driver.CUresult.CUDA_ERROR_NO_DEVICE:
        raise NoGpuError("the NVIDIA driver finds no GPU; use --device cpu")
    check((error,), "starting the driver")
    count = int(check(driver.cuDeviceGetCount(), "counting GPUs"))
    if count == 0:
        raise NoGpuError("the NVIDIA driver finds no GPU; use --device cpu")
    return count


class Gpu:
    """One GPU and its primary context."""

    def __init__(self, index: int) -> None:
        driver = _bindings()
        count = device_count()
        if not 0 <= index < count:
            names = ", ".join(f"cuda:{k}" for k in range(count))
            raise DeviceError(f"there is no GPU cuda:{index}; there is {names}")
        self.index = index
        self._driver = driver
        self._device = check(driver.cuDeviceGet(index), "opening the GPU")
        self.name = check(driver.cuDeviceGetName(128, self._device), "opening the GPU").split(b"\0")[0].decode()
        attribute = driver.CUdevice_attribute
        major, minor, self.multiprocessors = (
            int(check(driver.cuDeviceGetAttribute(what, self._device), "asking the GPU"))
            for what in (
                attribute.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR,
                attribute.CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR,
                attribute.CU_DEVICE_ATTRIBUTE_MULTIPROCESSOR_COUNT,
            )
        )
        self.capability = (major, minor)
        self.memory = int(check(driver.cuDeviceTotalMem(self._device), "asking the GPU"))
        self._context: Any = None

    def open(self) -> None:
        """Make this GPU the current one of this thread.

        Raises:
            DeviceError: it is too old, or busy.
        """
        if self.capability < MINIMUM_CAPABILITY:
            raise DeviceError(
                f"{self.name} has compute capability {self.capability[0]}.{self.capability[1]}; "
                f"{MINIMUM_CAPABILITY[0]}.{MINIMUM_CAPABILITY[1]} or newer is needed; use --device cpu"
            )
        if self._context is None:
            self._context = check(self._driver.cuDevicePrimaryCtxRetain(self._device), f"opening {self.name}")
        check(self._driver.cuCtxSetCurrent(self._context), f"opening {self.name}")

    def synchronize(self) -> None:
        """Wait until every copy and every launch is done."""
        check(self._driver.cuCtxSynchronize(), "waiting for the GPU")

    def driver_version(self) -> int:
        """The newest CUDA version that the driver knows, as 13000 for 13.0."""
        return int(check(self._driver.cuDriverGetVersion(), "asking the driver"))


@contextmanager
def current(context: Any) -> Iterator[None]:
    """Make the GPU of a context the current one within the block; another one may be by now."""
    driver = _bindings()
    driver.cuCtxPushCurrent(context)
    try:
        yield
    finally:
        driver.cuCtxPopCurrent()


class Stream:
    """Launches and copies that follow each other, beside those of other streams."""

    def __init__(self) -> None:
        self._driver = _bindings()
        flags = self._driver.CUstream_flags.CU_STREAM_NON_BLOCKING
        self.handle = check(self._driver.cuStreamCreate(flags), "opening a stream")

    def __del__(self) -> None:
        if hasattr(self, "handle") and not sys.is_finalizing():
            self._driver.cuStreamDestroy(self.handle)

    def clear(self, target: DeviceArray) -> None:
        """Make an array zeros, after what was launched before."""
        check(self._driver.cuMemsetD8Async(target.pointer, 0, target.nbytes, self.handle), "clearing memory")

    def download(self, source: DeviceArray, array: NDArray[Any]) -> None:
        """Wait for what was launched before, and copy to the host."""
        copy = self._driver.cuMemcpyDtoHAsync
        check(copy(array.ctypes.data, source.pointer, source.nbytes, self.handle), "rendering")
        self.wait()

    def wait(self) -> None:
        """Wait until everything that was launched is done."""
        check(self._driver.cuStreamSynchronize(self.handle), "rendering")


class DeviceArray:
    """An uninitialised array in the GPU's memory, freed with the last reference."""

    def __init__(self, shape: tuple[int, ...], dtype: Any) -> None:
        self._driver = _bindings()
        self.shape, self.dtype = shape, np.dtype(dtype)
        self.nbytes = math.prod(shape) * self.dtype.itemsize
        doing = f"taking {self.nbytes / 1e6:.0f} MB of its memory"
        self._context = check(self._driver.cuCtxGetCurrent(), doing)
        self.pointer = int(check(self._driver.cuMemAlloc(max(self.nbytes, 16)), doing))

    @classmethod
    def of(cls, array: NDArray[Any]) -> DeviceArray:
        """A copy of a host array."""
        made = cls(array.shape, array.dtype)
        made.upload(array)
        return made

    @classmethod
    def zeros(cls, shape: tuple[int, ...], dtype: Any) -> DeviceArray:
        """An array of zeros."""
        made = cls(shape, dtype)
        check(made._driver.cuMemsetD8(made.pointer, 0, max(made.nbytes, 16)), "clearing memory")
        return made

    def upload(self, array: NDArray[Any]) -> None:
        """Copy a host array of this size, or a smaller one to the beginning."""
        if array.nbytes:
            host = np.ascontiguousarray(array)
            check(self._driver.cuMemcpyHtoD(self.pointer, host.ctypes.data, array.nbytes), "uploading")

    def download(self, array: NDArray[Any], first: int = 0) -> None:
        """Fill a contiguous host array from the rows from `first` on."""
        if array.nbytes:
            source = self.pointer + first * (self.nbytes // self.shape[0])
            check(self._driver.cuMemcpyDtoH(array.ctypes.data, source, array.nbytes), "downloading")

    def __del__(self) -> None:
        pointer, self.pointer = getattr(self, "pointer", 0), 0
        # A process that ends gives everything back, and can import the driver no more.
        if pointer and not sys.is_finalizing():
            with current(self._context):
                self._driver.cuMemFree(pointer)


class Kernel:
    """A loaded kernel."""

    def __init__(self, cubin: bytes, name: str) -> None:
        self._driver = _bindings()
        self._context = check(self._driver.cuCtxGetCurrent(), "loading a kernel")
        self._module = check(self._driver.cuModuleLoadData(cubin), "loading a kernel")
        self._function = check(self._driver.cuModuleGetFunction(self._module, name.encode()), "loading a kernel")

    def __del__(self) -> None:
        if hasattr(self, "_module") and not sys.is_finalizing():
            with current(self._context):
                self._driver.cuModuleUnload(self._module)

    def launch(self, blocks: int, threads: int, arguments: Any, stream: Stream) -> None:
        """Start the kernel; `arguments` from `pointers_to`."""
        result = self._driver.cuLaunchKernel(
            self._function, blocks, 1, 1, threads, 1, 1, 0, stream.handle, ctypes.addressof(arguments), 0
        )
        check(result, "starting a kernel")

    def attribute(self, name: str) -> int:
        """NUM_REGS, LOCAL_SIZE_BYTES, ..."""
        which = getattr(self._driver.CUfunction_attribute, f"CU_FUNC_ATTRIBUTE_{name}")
        return int(check(self._driver.cuFuncGetAttribute(which, self._function), "asking a kernel"))


def pointers_to(values: list[Any]) -> Any:
    """The addresses of ctypes scalars as the driver wants them; keeps the scalars alive."""
    pointers = (ctypes.c_void_p * len(values))(*(ctypes.addressof(value) for value in values))
    pointers.values = values
    return pointers


def flatten_arguments(values: Any) -> list[Any]:
    """Kernel arguments as the compiled code takes them: every array as pointers, sizes and strides; tuples unpacked."""
    from ...lang import Features

    flat: list[Any] = []
    for value in values:
        if isinstance(value, DeviceArray):
            item = value.dtype.itemsize
            strides = [item * int(np.prod(value.shape[k + 1 :])) for k in range(len(value.shape))]
            count = int(np.prod(value.shape))
            flat += [ctypes.c_int64(n) for n in (0, 0, count, item, value.pointer, *value.shape, *strides)]
        elif isinstance(value, tuple):
            flat += flatten_arguments(value)
        elif isinstance(value, Features):
            flat.append(ctypes.c_int64(0))
        else:
            flat.append(
                np.ctypeslib.as_ctypes_type(np.asarray(value).dtype)(value.item() if hasattr(value, "item") else value)
            )
    return flat
