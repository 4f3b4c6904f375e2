"""The arguments that colour particles."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import numbers, of_length, plain

Floats = npt.NDArray[np.float32]

_BYTES = np.arange(256) / 255
#: Linear colours of bytes, which are sRGB (IEC 61966-2-1).
_LINEAR = np.where(_BYTES <= 0.04045, _BYTES / 12.92, ((_BYTES + 0.055) / 1.055) ** 2.4)


def coloring(
    colors: Any, values: Any, colormap: Any, range: Any, count: int, kept: npt.NDArray[np.bool_] | None
) -> dict[str, Any]:
    """Return the colours of `count` particles, of which some are `kept`, as the native half takes them."""
    if colors is not None and values is not None:
        raise ValueError("colors and values: give one of them")
    if values is None and (colormap is not None or range_of(range) is not None):
        raise ValueError("colormap and range show values; give values")
    return {
        "colors": None if colors is None else _colors(colors, count, kept),
        "values": None if values is None else _values(values, count, kept),
        "colormap": colormap_of(colormap),
        "range": range_of(range),
        "automatic": isinstance(range, str),
    }


def colormap_of(colormap: Any) -> str | None:
    """The name of a colour map."""
    if colormap is None:
        return None
    if not isinstance(colormap, str):
        raise ValueError(f'colormap is {colormap!r}; expected a name, as "viridis"')
    return _limpid.colormap(colormap)


def range_of(range: Any) -> tuple[float, float] | None:
    """A range of values; ``None`` for the usual one."""
    if range is None or isinstance(range, str) and range == "auto":
        return None
    try:
        if isinstance(range, (str, bytes, set, frozenset, dict)):
            raise TypeError
        low, high = (float(np.float32(end)) for end in range)
    except (TypeError, ValueError, OverflowError):
        low, high = np.nan, np.nan
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ValueError(f'range is {range!r}; expected (low, high), the smaller one first, or "auto"')
    return low, high


def _colors(colors: Any, count: int, kept: npt.NDArray[np.bool_] | None) -> Floats:
    array = plain("colors", colors, "(n, 3) or (n, 4)")
    is_bytes = array.dtype == np.uint8
    if array.size and (array.ndim != 2 or array.shape[1] not in (3, 4)):
        raise ValueError(f"colors has the shape {array.shape}; expected (n, 3) or (n, 4)")
    array = array[:, :3] if array.size else array.reshape(0, 3)
    array = _LINEAR[array] if is_bytes else numbers("colors", array, ("n", 3))
    array = of_length("colors", array, count)
    with np.errstate(invalid="ignore"):
        good: npt.NDArray[np.bool_] = np.asarray(((array >= 0) & (array <= 1)).all(axis=1))
    _check("colors", array, good, kept, "numbers from 0 to 1")
    return np.ascontiguousarray(array if kept is None else array[kept], np.float32)


def _values(values: Any, count: int, kept: npt.NDArray[np.bool_] | None) -> Floats:
    array = plain("values", values, "(n,)")
    is_vectors = array.ndim == 2 and array.shape[1] in (2, 3)
    if array.ndim != 1 and not is_vectors:
        raise ValueError(f"values has the shape {array.shape}; expected (n,), (n, 2) or (n, 3)")
    array = numbers("values", array, ("n", "k") if is_vectors else ("n",))
    array = of_length("values", array, count)
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(array.astype(np.float64), axis=1) if is_vectors else array
        single = np.ascontiguousarray(lengths, np.float32)
    _check("values", array, np.isfinite(single), kept, "finite numbers")
    return single if kept is None else single[kept]


def _check(
    name: str,
    array: npt.NDArray[Any],
    good: npt.NDArray[np.bool_],
    kept: npt.NDArray[np.bool_] | None,
    expected: str,
) -> None:
    """Fails for the first row that is drawn and not good."""
    if kept is not None:
        good = good | ~kept
    if not good.all():
        row = int(np.argmin(good))
        raise ValueError(f"{name}: particle {row} has {array[row].tolist()}; expected {expected}")
