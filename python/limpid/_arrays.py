"""Arguments as arrays that the native half copies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _cuda

# Without types in some versions of NumPy.
_is_masked: Any = np.ma.is_masked

#: The axis that points up.
Vector = Union[Sequence[float], "npt.NDArray[Any]"]


def numbers(name: str, value: Any, shape: tuple[int | str, ...]) -> npt.NDArray[Any]:
    """An array of 32- or 64-bit floats of this shape, in which letters stand for any size."""
    array = plain(name, value, _written(shape))
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} has the dtype {array.dtype}; expected float32 or float64")
    if array.size == 0 and array.ndim == 1 and shape[0] == "n":
        # An empty list has no second axis.
        array = array.reshape([0, *(size for size in shape[1:] if isinstance(size, int))])
    array = shaped(name, array, shape)
    kind = np.float32 if array.dtype.kind == "f" and array.dtype.itemsize <= 4 else np.float64
    is_plain = array.dtype == kind and array.dtype.isnative and array.flags.aligned
    with np.errstate(over="ignore"):
        return array if is_plain else array.astype(kind)


def plain(name: str, value: Any, expected: str) -> npt.NDArray[Any]:
    """An array of whatever numbers, of which this shape is expected."""
    refuse_masked(name, value)
    try:
        return as_array(name, value)
    except _Refused:
        raise
    except Exception as error:
        raise ValueError(f"{name}: {_first_line(error)}; expected numbers of shape {expected}") from error


def integers(name: str, value: Any, shape: tuple[int | str, ...]) -> npt.NDArray[np.int64]:
    """As `numbers`, of 64-bit integers."""
    refuse_masked(name, value)
    array = as_array(name, value, np.int64)
    if array.size == 0:
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} has the dtype {array.dtype}; expected integers")
    array = shaped(name, array, shape)
    if array.dtype == np.uint64 and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise ValueError(f"{name} has {int(array.max())}; expected integers of 64 bits with a sign")
    return np.require(array, np.int64, "A")


class _Refused(ValueError):
    """An array that cannot be read as it is; the text has the line that converts it."""


# Kinds of devices of DLPack whose memory the processor reads: its own, and what CUDA and ROCm have pinned.
_READABLE = (1, 3, 11)


def as_array(name: str, value: Any, kind: type = np.float64) -> npt.NDArray[Any]:
    """Convert a value to a NumPy array: arrays that only speak DLPack without a copy, CUDA's by a copy, tables with missing
    numbers as this kind."""
    if isinstance(value, (list, tuple)):
        return np.asarray(value)
    if isinstance(value, np.ndarray):
        return _of_fields(name, value)
    # Checked first: these arrays implement NumPy's protocols only to refuse.
    if _cuda.is_cuda(value):
        try:
            return _cuda.copied(value)
        except _cuda.CudaError as error:
            raise _on_device(name, str(error)) from error
    if hasattr(value, "detach"):
        # A tensor of PyTorch, which refuses to be converted while it records gradients.
        value = value.detach()
    if hasattr(value, "__array_interface__") or hasattr(value, "__array__"):
        return _of_fields(name, _of_table(name, value, kind))
    if hasattr(value, "__dlpack_device__") and int(value.__dlpack_device__()[0]) not in _READABLE:
        raise _on_device(name, "only CUDA arrays can be read from there")
    if hasattr(value, "__dlpack__"):
        array: npt.NDArray[Any] = np.from_dlpack(value)
        return array
    if isinstance(value, Iterator):
        # Not consumed: it may be a simulation.
        raise _Refused(
            f"{name} is a {type(value).__name__}; expected an array, as numpy.array(list({name})); limpid.film draws frames"
        )
    if isinstance(value, Mapping):
        keys = [key for key in value if isinstance(key, str)][:3]
        raise _Refused(
            f"{name} is a {type(value).__name__}; expected an array, as numpy.stack([{name}[key] for key in {keys}], axis=1)"
        )
    return np.asarray(value)


def _of_table(name: str, value: Any, kind: type) -> npt.NDArray[Any]:
    """An array of something that NumPy knows how to convert; nullable numbers of pandas are objects to it."""
    try:
        array = np.asarray(value)
    except TypeError as error:
        if "bfloat16" in str(error).lower():
            raise _Refused(f"{name} has the dtype bfloat16; expected float32 or float64, as {name}.float()") from None
        raise
    if array.dtype.name == "bfloat16":
        return array.astype(np.float32)
    is_table = hasattr(value, "to_numpy") and not isinstance(getattr(value, "dtype", None), np.dtype)
    # Integers with missing ones become floats, which would lose digits.
    if not is_table or array.dtype.kind != "O" and (kind is np.float64 or array.dtype.kind != "f"):
        return array
    missing = {"na_value": np.nan} if kind is np.float64 else {}
    try:
        converted: npt.NDArray[Any] = value.to_numpy(dtype=kind, **missing)
    except (TypeError, ValueError):
        raise _Refused(_of_other_columns(name, value)) from None
    return converted


def _of_other_columns(name: str, table: Any) -> str:
    """The text about a table or a column that holds something else than numbers."""
    columns = [str(column) for column in getattr(table, "columns", ())]
    if columns:
        there, way = f"columns {', '.join(columns)}", f'{name}[["x", "y", "z"]].to_numpy("float64")'
    elif hasattr(table, "fill_null"):
        there, way = f"dtype {table.dtype} with missing ones", f"{name}.fill_null(-1).to_numpy()"
    else:
        there, way = f"dtype {table.dtype} with missing ones", f'{name}.fillna(-1).to_numpy("int64")'
    return f"{name} has the {there}; expected numbers, as {way}"


#: The fields of structured arrays, as of PLY files, that are read as vectors.
_FIELDS = {
    "positions": (("x", "y", "z"),),
    "velocities": (("vx", "vy", "vz"), ("u", "v", "w")),
    "colors": (("red", "green", "blue"), ("r", "g", "b")),
}


def _of_fields(name: str, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The array, or the vectors of one whose elements have fields."""
    names = array.dtype.names
    if names is None:
        return array
    for fields in _FIELDS.get(name, ()):
        if set(fields) <= set(names) and all(array.dtype[field].shape == () for field in fields):
            return np.stack([array[field] for field in fields], axis=-1)
    wide = [field for field in names if array.dtype[field].shape]
    single = f'{name}["{(wide or names)[0]}"]'
    several = f"numpy.lib.recfunctions.structured_to_unstructured({name}[{list(names[:3])}])"
    way = several if name in _FIELDS and not wide and len(names) > 2 else single
    raise _Refused(f"{name} has the fields {', '.join(names)}; expected plain numbers, as {way}")


def _on_device(name: str, why: str) -> _Refused:
    return _Refused(
        f"{name} is in memory of a graphics card, and limpid could not copy it ({why}); copy it to the host first, as "
        f"{name}.cpu(), {name}.numpy() or cupy.asnumpy({name})"
    )


def shaped(name: str, array: npt.NDArray[Any], shape: tuple[int | str, ...]) -> npt.NDArray[Any]:
    """The array, if it has this shape."""
    sizes = zip(shape, array.shape)
    if array.ndim != len(shape) or any(s != own for s, own in sizes if isinstance(s, int)):
        raise ValueError(f"{name} has the shape {array.shape}; expected {_written(shape)}")
    return array


def refuse_masked(name: str, value: Any) -> None:
    """Fails for a masked array, whose hidden values would be drawn."""
    if _is_masked(value):
        raise ValueError(f"{name} is masked; expected plain values, as {name}[~mask]")


def of_length(name: str, array: npt.NDArray[Any], count: int) -> npt.NDArray[Any]:
    """The array, if it has a row for each of `count` particles."""
    if len(array) != count:
        raise ValueError(f"{name} has {len(array)} rows for {count} positions; expected as many")
    return array


def particle_arrays(
    positions: Any,
    *,
    velocities: Any = None,
    radii: Any = None,
    densities: Any = None,
    ids: Any = None,
    ellipsoids: Any = None,
) -> dict[str, npt.NDArray[Any] | None]:
    """The arrays of particles as the native half takes them."""
    places = numbers("positions", positions, ("n", 3))
    count = len(places)

    def rows(name: str, value: Any, shape: tuple[int | str, ...]) -> npt.NDArray[Any] | None:
        if value is None:
            return None
        return of_length(name, numbers(name, value, shape), count)

    def column(name: str, value: Any) -> npt.NDArray[Any] | None:
        is_column = np.ndim(value) == 2 and np.shape(value)[1] == 1
        array = rows(name, value, ("n", 1) if is_column else ("n",))
        return None if array is None else array.reshape(count, 1)

    shapes = rows("ellipsoids", ellipsoids, ("n", 3, 3))
    return {
        "positions": places,
        "velocities": rows("velocities", velocities, ("n", 3)),
        "radii": column("radius", radii),
        "densities": column("densities", densities),
        "ids": None if ids is None else of_length("ids", integers("ids", ids, ("n",)), count),
        "ellipsoids": None if shapes is None else shapes.reshape(count, 9),
    }


def placed(places: npt.NDArray[Any]) -> npt.NDArray[np.bool_] | None:
    """Which positions can be drawn, as of files: those that are finite and below 1e18; ``None`` if all can be, or if so many
    cannot that the native half refuses them."""
    if not places.size or (places.min() > -1e18 and places.max() < 1e18):
        return None
    with np.errstate(invalid="ignore"):
        there: npt.NDArray[np.bool_] = np.asarray((np.abs(places) < 1e18).all(axis=1))
    return there if 2 * np.count_nonzero(there) >= len(there) else None


def radius_of(radius: Any) -> tuple[float | None, Any]:
    """A radius for all particles, or an array with one for each."""
    if radius is None:
        return None, None
    refuse_masked("radius", radius)
    try:
        single = np.ndim(radius) == 0
    except ValueError:
        raise ValueError("radius is ragged; expected metres, or one for each particle") from None
    if not single:
        return None, radius
    try:
        if isinstance(radius, (bool, np.bool_, str, bytes)):
            raise TypeError
        value = float(radius)
    except (TypeError, ValueError):
        raise ValueError(f"radius is {radius!r}; expected metres, or one for each particle") from None
    if not 1e-12 <= value <= 1e12:
        raise ValueError(f"radius is {value}; expected 1e-12 to 1e12 m")
    return value, None


def size_of(size: Any) -> tuple[int, int]:
    """Width and height of a picture."""
    try:
        if isinstance(size, (set, frozenset, dict)):
            raise TypeError
        width, height = (int(side) for side in size)
        exact = all(int(side) == side for side in size)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"size is {size!r}; expected (width, height) in pixels") from None
    if not exact or not (1 <= width < 2**31 and 1 <= height < 2**31):
        raise ValueError(f"size is {size!r}; expected (width, height) in pixels, 1 or more")
    return width, height


def samples_of(samples: Any) -> int | None:
    """Rays per pixel."""
    if samples is None:
        return None
    if isinstance(samples, bool) or not isinstance(samples, (int, np.integer)):
        raise ValueError(f"samples is {samples!r}; expected a whole number")
    if not 1 <= samples <= 64:
        raise ValueError(f"samples is {samples}; expected 1 to 64")
    return int(samples)


def vector(name: str, value: Any, count: int = 3) -> list[float]:
    """So many numbers."""
    refuse_masked(name, value)
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(())
    if array.shape != (count,):
        raise ValueError(f"{name} is {_shortened(value)}; expected {count} numbers")
    return [float(x) for x in array]


def up_of(up: Any) -> Literal["y", "z"] | None:
    """The axis that points up."""
    if up is None or isinstance(up, str) and up in ("y", "z"):
        return up  # type: ignore[return-value]
    raise ValueError(f'up is {up!r}; expected "y" or "z"')


def _written(shape: tuple[int | str, ...]) -> str:
    return "(" + ", ".join(map(str, shape)) + ("," if len(shape) == 1 else "") + ")"


def _shortened(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def _first_line(error: BaseException) -> str:
    lines = str(error).splitlines()
    return lines[0] if lines else type(error).__name__
