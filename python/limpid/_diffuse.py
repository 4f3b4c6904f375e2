"""Foam, spray, bubbles and dust as arrays that the native half copies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import integers, numbers, of_length, plain

#: By their numbers.
KINDS = ("foam", "spray", "bubbles", "dust")
_NAMES = {"positions", "velocities", "radius", "kinds", "ages", "lifetimes"}


def diffuse_arrays(diffuse: Any) -> dict[str, npt.NDArray[Any] | None] | None:
    """The arrays of `diffuse`: a mapping with positions, or positions alone, perhaps with the lifetime as fourth number."""
    if diffuse is None:
        return None
    given = dict(diffuse) if isinstance(diffuse, Mapping) else {"positions": diffuse}
    unknown = sorted(set(given) - _NAMES)
    if unknown or given.get("positions") is None:
        found = f"diffuse has {unknown[0]!r}" if unknown else "diffuse has no positions"
        raise ValueError(f"{found}; expected positions, and perhaps velocities, radius, kinds, ages, lifetimes")
    places = plain("diffuse positions", given["positions"], "(n, 3) or (n, 4)")
    if places.ndim == 2 and places.shape[1] == 4:
        given.setdefault("lifetimes", places[:, 3])
        places = places[:, :3]
    places = numbers("diffuse positions", places, ("n", 3))
    count = len(places)

    def column(name: str) -> npt.NDArray[Any] | None:
        value = given.get(name)
        if value is None:
            return None
        if np.ndim(value) == 0:
            value = np.full(count, value)
        array = of_length(f"diffuse {name}", numbers(f"diffuse {name}", value, ("n",)), count)
        return array.reshape(count, 1)

    velocities = given.get("velocities")
    if velocities is not None:
        velocities = numbers("diffuse velocities", velocities, ("n", 3))
        velocities = of_length("diffuse velocities", velocities, count)
    return {
        "positions": places,
        "velocities": velocities,
        "radii": column("radius"),
        "kinds": _kinds(given.get("kinds"), count),
        "ages": column("ages"),
        "lifetimes": column("lifetimes"),
    }


def _kinds(kinds: Any, count: int) -> npt.NDArray[np.int64] | None:
    """Numbers of kinds, of which one name may stand for all."""
    if kinds is None:
        return None
    if isinstance(kinds, str):
        if kinds not in KINDS:
            raise ValueError(f"diffuse kinds is {kinds!r}; expected one of {', '.join(KINDS)}, or their numbers")
        return np.full(count, KINDS.index(kinds), np.int64)
    return of_length("diffuse kinds", integers("diffuse kinds", kinds, ("n",)), count)
