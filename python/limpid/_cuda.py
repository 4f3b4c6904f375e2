"""Arrays in memory of an NVIDIA card, copied by its driver: no library of CUDA is needed, and none is linked."""

from __future__ import annotations

import ctypes
import sys
from contextlib import contextmanager
from typing import Any, Iterator, NamedTuple

import numpy as np
import numpy.typing as npt

# `CU_POINTER_ATTRIBUTE_CONTEXT` and `CU_POINTER_ATTRIBUTE_DEVICE_ORDINAL` of CUDA's driver API.
_CONTEXT = 1
_DEVICE_ORDINAL = 9
_FUNCTIONS = (
    "cuInit",
    "cuPointerGetAttribute",
    "cuDeviceGet",
    "cuDevicePrimaryCtxRetain",
    "cuDevicePrimaryCtxRelease_v2",
    "cuCtxPushCurrent_v2",
    "cuCtxPopCurrent_v2",
    "cuCtxSynchronize",
    "cuMemcpyDtoH_v2",
)
# `kDLCUDA` and `kDLCUDAManaged` of DLPack, and its types of numbers.
_CUDA = (2, 13)
_KINDS = {0: "i", 1: "u", 2: "f"}


class CudaError(Exception):
    """Why an array was not copied."""


class _View(NamedTuple):
    """An array in memory of a card."""

    pointer: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    # Bytes from one item of each axis to the next; `None` if rows follow one another.
    strides: tuple[int, ...] | None


def is_cuda(value: Any) -> bool:
    """Whether it is an array in memory of an NVIDIA card."""
    device = getattr(value, "__dlpack_device__", None)
    if device is not None:
        return int(device()[0]) in _CUDA
    return hasattr(value, "__cuda_array_interface__")


def copied(value: Any) -> npt.NDArray[Any]:
    """A copy in the processor's memory, once the card has done what its context was told to do.

    Fails with `CudaError` without NVIDIA's driver, or if that refuses.
    """
    if hasattr(value, "__cuda_array_interface__"):
        return _copy(_of_interface(value.__cuda_array_interface__))
    # The capsule lets the array go when it ends.
    capsule = value.__dlpack__()
    return _copy(_of_capsule(capsule))


def _of_interface(interface: dict[str, Any]) -> _View:
    if interface.get("mask") is not None:
        raise CudaError("it is masked")
    strides = interface.get("strides")
    return _View(
        pointer=int(interface["data"][0] or 0),
        shape=tuple(map(int, interface["shape"])),
        dtype=np.dtype(interface["typestr"]),
        strides=None if strides is None else tuple(map(int, strides)),
    )


class _Tensor(ctypes.Structure):
    """`DLTensor` of DLPack, with which a `DLManagedTensor` begins."""

    _fields_ = [
        ("data", ctypes.c_void_p),
        ("device_type", ctypes.c_int32),
        ("device_id", ctypes.c_int32),
        ("ndim", ctypes.c_int32),
        ("code", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    ]


def _of_capsule(capsule: Any) -> _View:
    prototype = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)
    pointer_of = prototype(("PyCapsule_GetPointer", ctypes.pythonapi))
    tensor = _Tensor.from_address(pointer_of(capsule, b"dltensor"))
    if tensor.code not in _KINDS or tensor.lanes != 1 or tensor.bits not in (8, 16, 32, 64):
        raise CudaError(f"its element type is unsupported (DLPack code {tensor.code}, {tensor.bits} bits)")
    dtype = np.dtype(f"{_KINDS[tensor.code]}{tensor.bits // 8}")
    axes = range(tensor.ndim)
    strides = tuple(tensor.strides[i] * dtype.itemsize for i in axes) if tensor.strides else None
    pointer = (tensor.data or 0) + tensor.byte_offset
    return _View(pointer, tuple(tensor.shape[i] for i in axes), dtype, strides)


def _copy(view: _View) -> npt.NDArray[Any]:
    array = np.empty(view.shape, view.dtype)
    if array.size == 0:
        return array
    strides = view.strides or array.strides
    # From the first byte of the array to the last.
    steps = [(size - 1) * stride for size, stride in zip(view.shape, strides)]
    before = sum(-step for step in steps if step < 0)
    length = before + sum(step for step in steps if step > 0) + view.dtype.itemsize
    copy = np.empty(length, np.uint8)
    driver = _driver()
    with _context(driver, view.pointer):
        # Only some arrays name the stream that writes them.
        _call(driver.cuCtxSynchronize)
        _call(
            driver.cuMemcpyDtoH_v2,
            ctypes.c_void_p(copy.ctypes.data),
            ctypes.c_uint64(view.pointer - before),
            ctypes.c_size_t(length),
        )
    return np.ndarray(view.shape, view.dtype, copy, before, strides)


def _driver() -> Any:
    """NVIDIA's driver, if there is one."""
    name = "nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1"
    try:
        driver = ctypes.CDLL(name)
    except OSError as error:
        raise CudaError(f"{name} was not found") from error
    missing = [function for function in _FUNCTIONS if not hasattr(driver, function)]
    if missing:
        raise CudaError(f"NVIDIA's driver is too old: it lacks {missing[0]}")
    _call(driver.cuInit, ctypes.c_uint(0))
    return driver


@contextmanager
def _context(driver: Any, pointer: int) -> Iterator[None]:
    """The context of an address on a card, for this thread: its own, or its card's primary one."""
    address, own = ctypes.c_uint64(pointer), ctypes.c_void_p()
    # Memory of a pool belongs to no context.
    if driver.cuPointerGetAttribute(ctypes.byref(own), ctypes.c_int(_CONTEXT), address) == 0 and own:
        with _pushed(driver, own):
            yield
        return
    ordinal, device, context = ctypes.c_int(), ctypes.c_int(), ctypes.c_void_p()
    _call(driver.cuPointerGetAttribute, ctypes.byref(ordinal), ctypes.c_int(_DEVICE_ORDINAL), address)
    _call(driver.cuDeviceGet, ctypes.byref(device), ordinal)
    _call(driver.cuDevicePrimaryCtxRetain, ctypes.byref(context), device)
    try:
        with _pushed(driver, context):
            yield
    finally:
        driver.cuDevicePrimaryCtxRelease_v2(device)


@contextmanager
def _pushed(driver: Any, context: ctypes.c_void_p) -> Iterator[None]:
    _call(driver.cuCtxPushCurrent_v2, context)
    try:
        yield
    finally:
        driver.cuCtxPopCurrent_v2(ctypes.byref(ctypes.c_void_p()))


def _call(function: Any, *arguments: Any) -> None:
    code = function(*arguments)
    if code != 0:
        raise CudaError(f"{function.__name__} of NVIDIA's driver failed with code {code}")
