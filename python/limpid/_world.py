"""Solids, lights and environments, with the names and the values of scene files (docs/scenes.md)."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any, Literal, Optional, Union, get_args

import numpy as np
import numpy.typing as npt

from ._arrays import Vector
from ._errors import warn

PathLike = Union[str, "os.PathLike[str]"]
Look = Optional[Literal["studio", "daylight", "pool", "night", "chart", "paint"]]
Up = Optional[Literal["y", "z"]]

LOOKS: tuple[str, ...] = get_args(get_args(Look)[0])


@dataclass(frozen=True)
class Checker:
    """A checkerboard of cubes.

    Parameters
    ----------
    tile : float
        Side of a tile, m.
    even, odd : three numbers
        Linear RGB of the tiles.
    """

    tile: float
    even: Vector = (0.85, 0.80, 0.70)
    odd: Vector = (0.15, 0.20, 0.30)


@dataclass(frozen=True)
class Ground:
    """A checkerboard that fades into the environment at the distance `fade`, m."""

    tile: float
    fade: float
    even: Vector = (0.85, 0.80, 0.70)
    odd: Vector = (0.15, 0.20, 0.30)


@dataclass(frozen=True)
class Key:
    """Where a solid is at a frame.

    Parameters
    ----------
    frame : float
        Number of the frame.
    translate : three numbers, optional
        Position of a mesh, m; of other shapes, how far they have moved.
    rotate : four numbers, optional
        Axis and degrees; of meshes.
    quaternion : four numbers, optional
        x, y, z, w, instead of `rotate`.
    """

    frame: float
    translate: Vector | None = None
    rotate: Vector | None = None
    quaternion: Vector | None = None


@dataclass(frozen=True, eq=False)
class _Solid:
    """Properties of all solids.

    Parameters
    ----------
    color : three numbers, optional
        Linear RGB: emitted radiance, or with `lit` the albedo under the lights.
    checker, ground : optional
        A pattern instead of a colour.
    texture : path or (height, width, 3) array of uint8, optional
        A picture instead of a colour.
    tile : float, optional
        Width of the texture on planes and boxes, m.
    lit : bool
        Whether lights illuminate it; only then it receives caustics.
    keys : Key, optional
        How it moves.
    """

    color: Vector | None = field(default=None, kw_only=True)
    checker: Checker | None = field(default=None, kw_only=True)
    ground: Ground | None = field(default=None, kw_only=True)
    texture: PathLike | npt.NDArray[np.uint8] | None = field(default=None, kw_only=True)
    tile: float | None = field(default=None, kw_only=True)
    lit: bool = field(default=False, kw_only=True)
    keys: Iterable[Key] = field(default=(), kw_only=True)

    def __init_subclass__(cls) -> None:
        """Adds the parameters of all solids to the documentation."""
        _, shared = (_Solid.__doc__ or "").split("----------\n", 1)
        own = (cls.__doc__ or "").rstrip()
        title = "" if "Parameters\n" in own else "\n\n    Parameters\n    ----------"
        cls.__doc__ = f"{own}{title}\n{shared}"

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, entry.name), getattr(other, entry.name)) for entry in fields(self))

    __hash__ = None  # type: ignore[assignment]


def _same(a: Any, b: Any) -> bool:
    is_data = not (a is None or b is None or isinstance(a, str) or isinstance(b, str))
    return np.array_equal(a, b) if is_data else a == b


@dataclass(frozen=True, eq=False)
class Plane(_Solid):
    """A square, or an unbounded plane without `half_extent`.

    Parameters
    ----------
    origin : three numbers
        Its centre, m.
    normal : three numbers
        Its normal, of any length.
    half_extent : float, optional
        Half its side, m.
    """

    origin: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 1.0, 0.0)
    half_extent: float | None = None


@dataclass(frozen=True, eq=False)
class Box(_Solid):
    """An axis-aligned box from the corner `min` to the corner `max`, m."""

    min: Vector
    max: Vector


@dataclass(frozen=True, eq=False)
class Sphere(_Solid):
    """A sphere about `center`, m, with a `radius`, m."""

    center: Vector
    radius: float


@dataclass(frozen=True, eq=False)
class Mesh(_Solid):
    """A triangle mesh from a file, from arrays, or of trimesh, PyVista or Open3D. A closed one has an inside.

    Parameters
    ----------
    file : path or mesh, optional
        A glTF, OBJ, PLY or STL file; a pattern as ``pump_####.obj`` has a mesh for each frame. Or an
        object with `vertices` and `faces` or `triangles`, or a PyVista mesh, whose arrays are taken; or `vertices`.
    faces : (f, 3) array of integers, optional
        Rows of `vertices`, counterclockwise as seen from outside.
    vertices : (v, 3) array of floats, optional
        Corners of the triangles, m, instead of a file.
    coordinates : (v, 2) array of floats, optional
        Texture coordinates of the vertices.
    normals : str, optional
        ``"file"``, ``"smooth"`` or ``"flat"``.
    translate : three numbers, optional
        Position, m.
    rotate : four numbers, optional
        Axis and degrees: ``(1, 0, 0, -90)`` turns a mesh of a world of z up.
    quaternion : four numbers, optional
        x, y, z, w, instead of `rotate`.
    scale : float, optional
        Length of the file's unit, m.
    flip : bool, optional
        Whether textures are upside down.
    """

    file: PathLike | Any = None
    faces: npt.ArrayLike | None = None
    vertices: npt.ArrayLike | None = field(default=None, kw_only=True)
    coordinates: npt.ArrayLike | None = field(default=None, kw_only=True)
    normals: str | None = field(default=None, kw_only=True)
    translate: Vector | None = field(default=None, kw_only=True)
    rotate: Vector | None = field(default=None, kw_only=True)
    quaternion: Vector | None = field(default=None, kw_only=True)
    scale: float | None = field(default=None, kw_only=True)
    flip: bool | None = field(default=None, kw_only=True)


@dataclass(frozen=True)
class Sun:
    """Light from one direction.

    Parameters
    ----------
    direction : three numbers
        The direction in which it travels, y up, of any length: ``(0, -1, 0)`` shines straight down.
    irradiance : three numbers
        On a surface that faces it, W/m² per channel.
    """

    direction: Vector
    irradiance: Vector = (3.0, 3.0, 3.0)

    def __post_init__(self) -> None:
        direction = np.asarray(self.direction, dtype=object).ravel()
        if direction.size == 3 and isinstance(direction[1], (int, float)) and direction[1] > 0:
            problem = f"direction is {self.direction!r}: this sun shines upwards, from below the ground; y points up"
            warn(problem)


@dataclass(frozen=True)
class PointLight:
    """Light from a point.

    Parameters
    ----------
    position : three numbers
        Its place, m.
    intensity : three numbers
        W/sr per channel.
    """

    position: Vector
    intensity: Vector


@dataclass(frozen=True)
class Gradient:
    """An environment whose radiance is linear in the sine of the elevation."""

    zenith: Vector
    horizon: Vector
    nadir: Vector | None = None


@dataclass(frozen=True)
class Glow:
    """A lobe of radiance around a direction: radiance · exp(sharpness · (cos θ - 1))."""

    direction: Vector
    radiance: Vector
    sharpness: float


@dataclass(frozen=True)
class Sky:
    """A gradient that is steeper at the horizon, with up to two glows, such as the sun."""

    zenith: Vector
    horizon: Vector
    nadir: Vector | None = None
    glow: Iterable[Glow] = ()


Solid = Union[Plane, Box, Sphere, Mesh]
Light = Union[Sun, PointLight]
Environment = Union[Vector, Gradient, Sky, PathLike, "npt.NDArray[np.floating[Any]]"]
