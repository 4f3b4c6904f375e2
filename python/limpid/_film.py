"""Films of particles."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Iterator, Sequence, Sized
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import radius_of, samples_of, size_of, up_of
from ._closing import Closing
from ._coloring import colormap_of, range_of
from ._drawing import Drawing, SceneLike, scene_of
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture, title_of
from ._world import PathLike, Up


class Film(Closing, Iterator[Picture]):
    """The pictures of a film that is being written: see `Renderer.film`."""

    def __init__(
        self,
        drawing: Drawing,
        source: Iterable[Any] | PathLike,
        path: PathLike,
        *,
        fps: float | None,
        radius: npt.ArrayLike | None,
        colormap: str | None,
        range: Sequence[float] | str | None,
        legend: bool | str,
        scene: SceneLike | None,
        camera: Camera | Iterable[Camera] | None,
        size: Sequence[int],
        samples: int | None,
        up: Up,
    ) -> None:
        self._drawing = drawing
        self._size = size_of(size)
        self._samples = samples_of(samples)
        self._scene = scene_of(scene)
        self._radius = radius
        self._colormap = colormap_of(colormap)
        self._range = range_of(range)
        self._shows_values = self._colormap is not None or self._range is not None
        if isinstance(legend, (bool, np.bool_)):
            self._legend, self._title = bool(legend), None
        else:
            title_of(legend)
            self._legend, self._title = True, legend
        self._up = up_of(up)
        self._number = 0
        self._settled = False
        self._busy = threading.Lock()
        self._cameras: Iterator[Camera] | None = None
        self._camera: Camera | None = None
        if camera is None or isinstance(camera, Camera):
            self._camera = camera
        else:
            try:
                self._cameras = iter(camera)
            except TypeError:
                raise ValueError(f"camera is {camera!r}; expected one Camera, or a list") from None
        self._frames: _limpid.Frames | None = None
        self._particles: Iterator[Any] | None = None
        self._count: int | None = None
        own_fps: float | None = None
        if isinstance(source, (str, os.PathLike)):
            if self._cameras is not None:
                raise ValueError("camera is a list; files take one camera")
            if self._shows_values:
                raise ValueError(
                    "colormap and range show values of Particles; for files, give a scene with color_by"
                )
            value, radii = radius_of(radius)
            if radii is not None:
                raise ValueError("radius is an array; files take one radius")
            project = None if self._scene is None else self._scene._project
            self._frames = _limpid.Frames.open(
                os.fspath(source),
                project,
                self._camera,
                self._up,
                value,
                self._samples,
                self._size,
            )
            self._count = len(self._frames)
            own_fps = self._frames.fps
        else:
            if isinstance(source, Particles) or getattr(source, "ndim", 3) == 2:
                raise ValueError("source is one frame; expected frames, as [positions, ...]")
            if isinstance(source, Sized):
                self._count = len(source)
            own_fps = getattr(source, "fps", None)
            try:
                self._particles = iter(source)
            except TypeError:
                raise ValueError(f"source is {source!r}; expected a path, or frames") from None
        rate = fps if fps is not None else own_fps if own_fps is not None else 30.0
        try:
            rate = float(rate)
        except (TypeError, ValueError):
            given = own_fps if fps is None else fps
            raise ValueError(f"fps is {given!r}; expected pictures per second") from None
        self._file: _limpid.FilmFile | None = _limpid.FilmFile(
            os.fspath(path), self._size[0], self._size[1], rate
        )

    def __len__(self) -> int:
        if self._count is None:
            raise TypeError("the source has no length")
        return self._count

    def __length_hint__(self) -> int:
        return self._count or 0

    def __next__(self) -> Picture:
        if not self._busy.acquire(blocking=False):
            raise ValueError("the film is already drawing, in another thread")
        try:
            file = self._file
            if file is None:
                raise StopIteration
            try:
                return self._draw(file)
            except StopIteration:
                self._file = None
                file.finish()
                raise
            except BaseException:
                self.close()
                raise
        finally:
            self._busy.release()

    def run(self) -> None:
        """Draws all pictures that are left, and so completes the film."""
        for _ in self:
            pass

    def close(self) -> None:
        """Removes the film, unless it is complete."""
        if self._file is not None:
            file, self._file = self._file, None
            file.abandon()

    def __del__(self) -> None:
        if getattr(self, "_file", None) is not None:
            self.close()

    def _draw(self, file: _limpid.FilmFile) -> Picture:
        number = self._number
        if self._frames is not None:
            if number == len(self._frames):
                raise StopIteration
            picture = self._drawing.frame(self._frames, number, self._size, self._scene)
        else:
            assert self._particles is not None
            positions = next(self._particles)
            camera = self._camera
            if self._cameras is not None:
                camera = next(self._cameras, None)
                if camera is None:
                    raise ValueError(f"camera has {number} entries, and there are more frames")
                if not isinstance(camera, Camera):
                    raise ValueError(f"camera has {camera!r}; expected a limpid.Camera")
            # Emitters begin without particles, and perhaps without values.
            has_values = isinstance(positions, Particles) and positions.values is not None
            picture = self._drawing.picture(
                positions,
                radius=self._radius,
                colormap=self._colormap if has_values else None,
                range=self._range if has_values else None,
                scene=self._scene,
                camera=camera,
                size=self._size,
                samples=self._samples,
                up=self._up,
                frame=number,
            )
            if not self._settled and picture.particles > 0:
                self._settle(picture)
            self._scene = picture.scene
        if self._legend and picture.particles > 0:
            picture = picture.legend(self._title)
        file.push(picture.rgba)
        self._number += 1
        return picture

    def _settle(self, picture: Picture) -> None:
        """Checks the first frame with particles, whose scene has what was made to fit it."""
        self._settled = True
        if self._shows_values and picture.colormap is None:
            raise ValueError("colormap and range show values; give frames as Particles with values")
        # The scene has the axis.
        self._up = None
