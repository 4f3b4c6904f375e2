"""Arrays in memory of an NVIDIA card, copied by its driver: no library of CUDA is needed, and none is linked."""

from __future__ import annotations

import ctypes
import sys
from contextlib import contextmanager
from typing import Any, Iterator, NamedTuple

import numpy as np
import numpy.typing as npt

# `CU_POINTER_ATTRIBUTE_DEVICE_ORDINAL` of CUDA's driver API.
_DEVICE_ORDINAL = 9
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
    if hasattr(value, "__cuda_array_interface__"):
        return True
    device = getattr(value, "__dlpack_device__", None)
    return device is not None and int(device()[0]) in _CUDA


def copied(value: Any) -> npt.NDArray[Any]:
    """A copy in the processor's memory, once all that the card has been told to do is done.

    Fails with `CudaError` without NVIDIA's driver, or if that refuses.
    """
    if hasattr(value, "__cuda_array_interface__"):
        return _copy(_of_interface(value.__cuda_array_interface__))
    # Minus one: the owner of the array waits for nothing, since the copy waits for everything.
    capsule = value.__dlpack__(stream=-1)
    # The capsule lets the array go when it ends.
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
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype, pointer_of.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    tensor = _Tensor.from_address(pointer_of(capsule, b"dltensor"))
    if tensor.code not in _KINDS or tensor.lanes != 1 or tensor.bits not in (8, 16, 32, 64):
        raise CudaError(f"its numbers are of the kind {tensor.code} with {tensor.bits} bits")
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
        raise CudaError(f"{name} is not there") from error
    _call(driver.cuInit, ctypes.c_uint(0))
    return driver


@contextmanager
def _context(driver: Any, pointer: int) -> Iterator[None]:
    """The context of the card that has this address, for this thread."""
    ordinal, device, context = ctypes.c_int(), ctypes.c_int(), ctypes.c_void_p()
    _call(
        driver.cuPointerGetAttribute,
        ctypes.byref(ordinal),
        ctypes.c_int(_DEVICE_ORDINAL),
        ctypes.c_uint64(pointer),
    )
    _call(driver.cuDeviceGet, ctypes.byref(device), ordinal)
    _call(driver.cuDevicePrimaryCtxRetain, ctypes.byref(context), device)
    try:
        _call(driver.cuCtxPushCurrent_v2, context)
        try:
            yield
        finally:
            driver.cuCtxPopCurrent_v2(ctypes.byref(ctypes.c_void_p()))
    finally:
        driver.cuDevicePrimaryCtxRelease_v2(device)


def _call(function: Any, *arguments: Any) -> None:
    code = function(*arguments)
    if code != 0:
        raise CudaError(f"{function.__name__} of NVIDIA's driver fails with the code {code}")
