"""Particle files, and simulations."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import numbers, particle_arrays, radius_of
from ._attributes import Strict
from ._errors import LimpidWarning
from ._world import PathLike

#: Arguments by the names that attributes have in files.
_ARGUMENTS = {"velocity": "velocities", "density": "densities", "id": "ids", "ellipsoid": "ellipsoids"}

Floats = npt.NDArray[np.floating[Any]]


@dataclass(repr=False, eq=False)
class Particles(Strict):
    """One frame of particles; attributes that are not known are ``None``.

    Attributes
    ----------
    positions : (n, 3) array of float32, or of float64 far from the origin
        Centres, m.
    velocities : (n, 3) array of float32, optional
        m/s.
    densities : (n,) array of float32, optional
        kg/m³.
    radii : (n,) array of float32, optional
        m.
    ids : (n,) array of int64, optional
        Numbers that a particle has in all frames.
    ellipsoids : (n, 3, 3) array of float32, optional
        Maps of the unit sphere to each particle's shape, in units of its radius.
    radius : float, optional
        Radius of all particles, m.
    colors, values : arrays, optional
        As for `limpid.render`; `write` leaves them out.
    """

    positions: Floats
    velocities: Floats | None = None
    densities: Floats | None = None
    radii: Floats | None = None
    ids: npt.NDArray[np.int64] | None = None
    ellipsoids: Floats | None = None
    radius: float | None = None
    colors: npt.NDArray[Any] | None = None
    values: npt.NDArray[Any] | None = None

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        names = ("velocities", "densities", "radii", "ids", "ellipsoids", "radius", "colors", "values")
        there = [name for name in names if getattr(self, name) is not None]
        more = f", with {', '.join(there)}" if there else ""
        return f"<limpid.Particles, {len(self)}{more}>"


def read(
    path: PathLike, *, map: str | None = None, select: str | None = None, skip_invalid: bool = False
) -> Particles:
    """Reads a particle file of any format that limpid knows: BGEO, VTK, VTU, PLY, NPZ, HDF5, CSV …

    Parameters
    ----------
    path : path
        The file. Positions have the file's axes and unit.
    map : str, optional
        Where attributes are read from, as for the program's ``--map``: ``"velocity=u,v,w,radius=d/2,id=none"``.
    select : str, optional
        Which particles are read, as for ``--select``: ``"type==1"``, ``"mk in 1..3"``, or ``"all"``.
    skip_invalid : bool
        Leave out particles without a finite position even if they are more than half of the file.

    Raises
    ------
    ValueError
        If `map` or `select` cannot be understood.
    OSError
        If the file cannot be read; ``limpid.FileError`` naming the place if it is damaged.

    Warns
    -----
    LimpidWarning
        If something of the file is left out or understood in a way of its own.
    """
    arrays, remarks = _limpid.read(os.fspath(path), map, select, bool(skip_invalid))
    for remark in remarks:
        warnings.warn(f"{os.fspath(path)!s}: {remark}", LimpidWarning, stacklevel=2)
    return Particles(**arrays)


def write(
    path: PathLike,
    positions: npt.ArrayLike | Particles,
    *,
    velocities: npt.ArrayLike | None = None,
    densities: npt.ArrayLike | None = None,
    radius: npt.ArrayLike | None = None,
    ids: npt.ArrayLike | None = None,
    ellipsoids: npt.ArrayLike | None = None,
) -> None:
    """Writes a particle file in the format of its extension: .bgeo, .vtk, .vtu, .ply, .npz, .csv …

    Warns with ``limpid.LimpidWarning`` if the format cannot hold something.

    Parameters
    ----------
    path : path
        The file; it is written whole or not at all.
    positions : (n, 3) array of floats, or Particles
        Centres, m.
    velocities, densities, ids, ellipsoids : arrays, optional
        As in `Particles`.
    radius : float or (n,) array, optional
        m.

    Raises
    ------
    ValueError
        Naming the argument that cannot be used.
    OSError
        If the file cannot be written, or limpid does not write its format.
    """
    unwritten = [name for name in ("colors", "values") if getattr(positions, name, None) is not None]
    if isinstance(positions, Particles):
        own = positions
        velocities = own.velocities if velocities is None else velocities
        densities = own.densities if densities is None else densities
        radius = own.radii if radius is None else radius
        radius = own.radius if radius is None else radius
        ids = own.ids if ids is None else ids
        ellipsoids = own.ellipsoids if ellipsoids is None else ellipsoids
        positions = own.positions
    value, radii = radius_of(radius)
    if value is not None:
        radii = np.full(len(numbers("positions", positions, ("n", 3))), value)
    arrays = particle_arrays(
        positions,
        velocities=velocities,
        radii=radii,
        densities=densities,
        ids=ids,
        ellipsoids=ellipsoids,
    )
    lost = _limpid.write(os.fspath(path), arrays)
    lost = [_ARGUMENTS.get(name, name) for name in lost] + unwritten
    if lost:
        text = f"{os.fspath(path)!s}: its format does not hold {', '.join(lost)}"
        warnings.warn(text, LimpidWarning, stacklevel=2)


class bake(Iterator[Particles]):
    """Simulates the frames of a scene file's ``[simulation]``, without writing files.

    An iterator with a length; the next frame is computed while the last is used.

    Parameters
    ----------
    scene : path
        The scene file.
    frames : int, optional
        Number of frames; the scene's by default.

    Raises
    ------
    SceneError
        If the scene has no simulation, or one that cannot run.
    """

    def __init__(self, scene: PathLike, frames: int | None = None) -> None:
        whole = isinstance(frames, (int, np.integer)) and not isinstance(frames, bool)
        if frames is not None and not (whole and 1 <= frames < 2**32):
            raise ValueError(f"frames is {frames!r}; expected a whole number, 1 or more")
        self._frames = _limpid.Bake(os.fspath(scene), None if frames is None else int(frames))

    @property
    def fps(self) -> float:
        """Frames per second of the simulation."""
        return self._frames.fps

    def __len__(self) -> int:
        return self._frames.count

    def __next__(self) -> Particles:
        arrays: dict[str, Any] | None = self._frames.next()
        if arrays is None:
            raise StopIteration
        return Particles(**arrays, radius=self._frames.radius)
