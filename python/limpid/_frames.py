"""Frames of particles in files, read one by one."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import Any, overload

from . import _limpid
from ._arrays import up_of
from ._errors import warn
from ._particles import Particles
from ._world import PathLike, Up


class Frames(Sequence[Particles]):
    """The frames of particle files: see `frames`.

    Attributes
    ----------
    numbers : list of int
        The numbers of the frames, ascending, as in the names of their files.
    fps : float or None
        Frames per second, if the files or the scene have them.
    """

    numbers: list[int]
    fps: float | None

    def __init__(self, series: _limpid.Series, name: str, indices: Sequence[int], said: set[str]) -> None:
        self._series = series
        self._name = name
        self._indices = indices
        # What was said about the files, without its numbers.
        self._said = said
        known = series.numbers
        self.numbers = [known[i] for i in indices]
        self.fps = series.fps

    def __len__(self) -> int:
        return len(self._indices)

    @overload
    def __getitem__(self, index: int) -> Particles: ...
    @overload
    def __getitem__(self, index: slice) -> Frames: ...
    def __getitem__(self, index: int | slice) -> Particles | Frames:
        if isinstance(index, slice):
            return Frames(self._series, self._name, self._indices[index], self._said)
        try:
            place = self._indices[index]
        except IndexError:
            raise IndexError(f"there is no frame {index}: {self._name} has {len(self)}") from None
        arrays, remarks = self._series.read(place)
        for remark in remarks:
            words = re.sub(r"[0-9.,]+", "", remark)
            if words not in self._said:
                self._said.add(words)
                warn(f"{self._name}: {remark}")
        return Particles(**arrays, radius=self._series.radius)

    def __repr__(self) -> str:
        return f"<limpid.Frames, {len(self)} of {self._name}>"


def frames(
    source: PathLike,
    *,
    map: str | None = None,
    select: str | None = None,
    up: Up = None,
    scale: float | None = None,
    values: str | None = None,
    skip_invalid: bool = False,
) -> Frames:
    """The frames of particle files, of any format that limpid reads: a sequence of `Particles`, each of which is read
    when it is asked for and not kept::

        frames = limpid.frames("water_{}.bgeo", up="z", scale=0.001)
        for particles in frames[::10]:
            print(len(particles))
        limpid.film(frames, "water.mp4").run()

    Parameters
    ----------
    source : path
        A pattern, in which ``{}`` (or ``%04d``, ``$F4``, ``####``) stands for the number and ``*`` for any text; a
        folder, a .pvd or .series file, or a single file, which may have many frames; or a scene file with particles.
    map, select : str, optional
        As for `read`.
    up : str, optional
        The axis that points up in the files, ``"y"`` or ``"z"``. The particles then have y up; by default they have the
        axes of the files, those of a scene file y up.
    scale : float, optional
        Length of the files' unit, m; 1 by default. Scene files have their own.
    values : str, optional
        The attribute that becomes ``Particles.values``, or ``Particles.colors``: ``"velocity"``, ``"density"``,
        ``"color"`` or any array of the files.
    skip_invalid : bool
        As for `read`.

    Raises
    ------
    ValueError, OSError
        As `read`; if there are no files, at once; if one is damaged, when it is read.

    Warns
    -----
    LimpidWarning
        As `read`, of each problem once.
    """
    if scale is not None:
        try:
            scale = float(scale)
        except (TypeError, ValueError):
            raise ValueError(f"scale is {scale!r}; expected the length of the files' unit, m") from None
        if not 1e-12 <= scale <= 1e12:
            raise ValueError(f"scale is {scale}; expected 1e-12 to 1e12 m")
    if values is not None and not isinstance(values, str):
        raise ValueError(f'values is {values!r}; expected the name of an attribute, as "velocity"')
    path: Any = os.fspath(source)
    series = _limpid.Series.open(path, map, select, bool(skip_invalid), up_of(up), scale, values)
    return Frames(series, os.fsdecode(path), range(len(series.numbers)), set())
