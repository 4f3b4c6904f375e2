"""Films of particles."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Iterator, Sized
from dataclasses import replace
from typing import Any

import numpy as np

from . import _limpid
from ._arrays import radius_of
from ._closing import Closing
from ._drawing import Drawing, Request
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture, title_of
from ._world import PathLike


class Film(Closing, Iterator[Picture]):
    """The pictures of a film that is being written: see `Renderer.film`."""

    def __init__(
        self,
        drawing: Drawing,
        source: Iterable[Any] | PathLike,
        path: PathLike,
        request: Request,
        *,
        camera: Camera | Iterable[Camera] | None,
        fps: float | None,
        legend: bool | str,
    ) -> None:
        self._drawing = drawing
        self._request = request
        self._shows_values = request.colormap is not None or request.range is not None
        if isinstance(legend, (bool, np.bool_)):
            self._legend, self._title = bool(legend), None
        else:
            title_of(legend)
            self._legend, self._title = True, legend
        self._number = 0
        self._settled = False
        self._busy = threading.Lock()
        self._cameras: Iterator[Camera] | None = None
        if camera is None or isinstance(camera, Camera):
            self._request = replace(request, camera=camera)
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
            value, radii = radius_of(request.radius)
            if radii is not None:
                raise ValueError("radius is an array; files take one radius")
            scene = request.scene
            self._frames = _limpid.Frames.open(
                os.fspath(source),
                None if scene is None else scene._project,
                self._request.camera,
                request.up,
                value,
                request.samples,
                request.size,
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
            os.fspath(path), request.size[0], request.size[1], rate
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
            picture = self._drawing.frame(self._frames, number, self._request)
        else:
            assert self._particles is not None
            positions = next(self._particles)
            request = replace(self._request, frame=number)
            if self._cameras is not None:
                camera = next(self._cameras, None)
                if camera is None:
                    raise ValueError(f"camera has {number} entries, and there are more frames")
                request = replace(request, camera=camera)
            # Emitters begin without particles, and perhaps without values.
            has_values = isinstance(positions, Particles) and positions.values is not None
            if not has_values:
                request = replace(request, colormap=None, range=None)
            picture = self._drawing.picture(positions, request)
            if not self._settled and picture.particles > 0:
                self._settle(picture)
            if self._request.range is None:
                self._keep_range(picture, has_values)
        if self._legend and picture.particles > 0:
            picture = picture.legend(self._title)
        file.push(picture.rgba)
        self._number += 1
        return picture

    def _keep_range(self, picture: Picture, has_values: bool) -> None:
        """Keeps the range of the first frame whose values differ."""
        self._request = replace(self._request, range=picture.range)
        if picture.range is not None and not has_values:
            # The attribute is the scene's.
            scene = picture.scene.copy()
            scene._project.set([f"liquid.color_range={list(picture.range)}"])
            self._request = replace(self._request, scene=scene)

    def _settle(self, picture: Picture) -> None:
        """Keeps what was made to fit the first frame with particles."""
        self._settled = True
        # The scene has the axis.
        self._request = replace(
            self._request, scene=picture.scene, thickness=picture._thickness, up=None
        )
        if self._shows_values and picture.colormap is None:
            raise ValueError("colormap and range show values; give frames as Particles with values")
