"""Films of particles."""

from __future__ import annotations

import base64
import errno
import html
import os
import shutil
import tempfile
import threading
import weakref
from collections.abc import Iterable, Iterator, Mapping, Sized
from dataclasses import replace
from itertools import chain, repeat
from typing import Any

import numpy as np

from . import _limpid
from ._closing import Closing
from ._drawing import Drawing, Progress, Request, opened, ticking
from ._errors import Cancelled
from ._frames import Frames
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture, title_of
from ._world import PathLike

#: The largest film that a notebook holds, bytes: it stores films in its file.
_LARGEST = 32 << 20

_KINDS = {".mp4": "video/mp4", ".webm": "video/webm", ".gif": "image/gif", ".apng": "image/apng"}

_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".exr")


class Film(Closing, Iterator[Picture]):
    """The pictures of a film that is being written: see `Renderer.film`.

    Notebooks draw it to its end and play it.

    Attributes
    ----------
    path : str
        The film, or the pattern or folder of its pictures.
    """

    path: str

    def __init__(
        self,
        drawing: Drawing,
        source: Iterable[Any] | PathLike,
        path: PathLike | None,
        request: Request,
        *,
        camera: Camera | Iterable[Camera] | None,
        given: dict[str, Any],
        fps: float | None,
        legend: bool | str,
        progress: Progress | None,
    ) -> None:
        self._drawing = drawing
        self._request = request
        self._progress = progress
        self._shows_values = request.shows_values
        if isinstance(legend, (bool, np.bool_)):
            self._legend, self._title = bool(legend), None
        else:
            title_of(legend)
            self._legend, self._title = True, legend
        self._done = 0
        self._settled = False
        self._complete = False
        self._busy = threading.Lock()
        self._count: int | None = None
        given = {name: values for name, values in given.items() if values is not None}
        # What each picture has of its own, apart from the particles.
        self._own: dict[str, Iterator[Any]] = {}
        if camera is None or isinstance(camera, Camera):
            self._request = replace(request, camera=camera)
        else:
            self._own["camera"] = _each("camera", camera, "one Camera, or a list")
        self._frames: _limpid.Frames | None = None
        self._particles: Iterator[Any] = iter(())
        # Whether one frame is seen by several cameras.
        self._stands = False
        self._numbers: list[int] | None = None
        if isinstance(source, (str, os.PathLike)):
            own_fps = self._open(source, given)
        else:
            own_fps = self._take(source, given)
        if self._stands:
            # One picture for each camera.
            self._count = len(camera) if isinstance(camera, Sized) else None
            self._numbers = None
        rate = fps if fps is not None else own_fps if own_fps is not None else 30.0
        try:
            rate = float(rate)
        except (TypeError, ValueError):
            wrong = own_fps if fps is None else fps
            raise ValueError(f"fps is {wrong!r}; expected pictures per second") from None
        self._file: _Video | _Pictures | None = self._output(path, rate)
        self.path = self._file.path

    def _open(self, source: PathLike, given: dict[str, Any]) -> float | None:
        """Opens files; returns their rate."""
        if given:
            # Refuses all but names.
            self._request = replace(self._request, **given)
        request = self._request
        if "camera" in self._own:
            # What is made to fit is made for the first camera.
            first = next(self._own["camera"], None)
            if first is None:
                raise ValueError("camera has no entries")
            request = replace(request, camera=_camera(first))
            self._own["camera"] = chain([first], self._own["camera"])
        frames = self._frames = opened(source, request)
        self._numbers, self._count = frames.numbers, len(frames)
        self._stands = "camera" in self._own and len(frames) == 1
        return frames.fps

    def _take(self, source: Any, given: dict[str, Any]) -> float | None:
        """Takes frames of the caller; returns their rate."""
        if isinstance(values := given.get("values"), str):
            raise ValueError(f"values is {values!r}; names are for files: film a path, or limpid.frames(..., values=...)")
        if isinstance(source, Particles) or getattr(source, "ndim", 3) == 2:
            if "camera" not in self._own:
                raise ValueError("source is one frame; expected frames, as [positions, ...], or a list of cameras")
            self._stands = True
            self._particles = repeat(source)
            self._request = replace(self._request, **given)
            return None
        self._count = len(source) if isinstance(source, Sized) else None
        self._own.update({name: _each_frame(name, values, self._count) for name, values in given.items()})
        self._numbers = source.numbers if isinstance(source, Frames) else None
        try:
            self._particles = iter(source)
        except TypeError:
            raise ValueError(f"source is {source!r}; expected a path, or frames") from None
        rate: float | None = getattr(source, "fps", None)
        return rate

    def _output(self, path: PathLike | None, fps: float) -> _Video | _Pictures:
        """The writer of the pictures."""
        size = self._request.size
        if path is None:
            folder = tempfile.mkdtemp(prefix="limpid-")
            self._folder = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
            is_even = size[0] % 2 == size[1] % 2 == 0
            kind = "mp4" if is_even and shutil.which("ffmpeg") else "gif" if fps <= 50 else "apng"
            path = os.path.join(folder, f"film.{kind}")
        name = os.fsdecode(os.fspath(path))
        if name.endswith(("/", os.sep)) or os.path.isdir(name) or name.lower().endswith(_PICTURES):
            return _Pictures(name, self._numbers)
        if self._request.alpha:
            raise ValueError('alpha is given, and films have no coverage; write pictures, as "####.png"')
        return _Video(name, size, fps)

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
                picture = self._draw()
                file.push(picture)
                self._done += 1
                if self._progress is not None and self._progress(self._done, self._count) is False:
                    raise Cancelled("progress has returned False: the film was stopped")
                return picture
            except StopIteration:
                self._file = None
                file.finish()
                self._complete = True
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
        """Removes the film, unless it is complete. Pictures with files of their own stay."""
        if self._file is not None:
            file, self._file = self._file, None
            file.abandon()

    def __del__(self) -> None:
        if getattr(self, "_file", None) is not None:
            self.close()

    def __repr__(self) -> str:
        total = "pictures" if self._count is None else f"{self._count} pictures"
        if self._complete:
            state = f"{self._done} pictures, complete"
        elif self._file is None:
            state = "closed"
        elif self._done == 0:
            # Notebooks write this beside the film, before they have it drawn.
            state = total
        else:
            state = f"{self._done} of {total} drawn"
        return f"<limpid.Film {self.path!r}, {state}>"

    def _repr_html_(self) -> str:
        self.run()
        kind = _KINDS.get(os.path.splitext(self.path)[1].lower())
        name = html.escape(self.path)
        if kind is None or not os.path.isfile(self.path):
            return f"{self._done} pictures: <code>{name}</code>"
        size = os.path.getsize(self.path)
        if size > _LARGEST:
            return f"<code>{name}</code>: {size >> 20} MiB are too many for a notebook; draw smaller pictures"
        with open(self.path, "rb") as file:
            data = f"data:{kind};base64,{base64.b64encode(file.read()).decode()}"
        if kind.startswith("image"):
            return f'<img src="{data}" width="{self._request.size[0]}">'
        return f'<video src="{data}" width="{self._request.size[0]}" controls autoplay loop muted playsinline></video>'

    def _draw(self) -> Picture:
        done, frames = self._done, self._frames
        tick = ticking(self._progress, done, self._count)
        if frames is not None:
            index = 0 if self._stands else done
            if index == len(frames):
                raise StopIteration
            request = replace(self._request, **self._next())
            return self._labelled(self._drawing.frame(frames, index, request, tick, first=done == 0))
        positions = next(self._particles)
        frame = 0 if self._stands else done if self._numbers is None else self._numbers[done]
        request = replace(self._request, frame=frame, **self._next())
        # Emitters begin without particles, and perhaps without values.
        own = positions.values if isinstance(positions, Particles) else None
        has_values = request.values is not None or own is not None
        if not has_values:
            request = replace(request, colormap=None, range=None)
        picture = self._drawing.picture(positions, request, tick)
        if not self._settled and picture.particles > 0:
            self._settle(picture)
        self._keep(picture)
        return self._labelled(picture)

    def _next(self) -> dict[str, Any]:
        """The next picture's own arguments."""
        own = {}
        for name, values in self._own.items():
            try:
                own[name] = next(values)
            except StopIteration:
                if self._stands:
                    raise
                raise ValueError(f"{name} has {self._done} entries, and there are more frames") from None
        if "camera" in own:
            _camera(own["camera"])
        return own

    def _labelled(self, picture: Picture) -> Picture:
        return picture.legend(self._title) if self._legend and picture.particles > 0 else picture

    def _keep(self, picture: Picture) -> None:
        """Keeps the scene, which has everything that was guessed; the range is that of the first values that differ."""
        given = self._request.range
        kept = None if isinstance(given, str) and picture.range is not None else given
        self._request = replace(self._request, scene=picture.scene, range=kept)

    def _settle(self, picture: Picture) -> None:
        """Checks the first frame with particles, whose scene has what was made to fit it."""
        self._settled = True
        # The scene has the axis.
        self._request = replace(self._request, up=None)
        if self._shows_values and picture.colormap is None:
            raise ValueError("colormap and range show values; give values, or frames as Particles with values")


class _Video:
    """A film in one file."""

    def __init__(self, path: str, size: tuple[int, int], fps: float) -> None:
        self.path = path
        self._file = _limpid.FilmFile(path, size[0], size[1], fps)
        self.finish = self._file.finish
        self.abandon = self._file.abandon

    def push(self, picture: Picture) -> None:
        self._file.push(picture.rgba)


class _Pictures:
    """A film as pictures with files of their own, of these numbers or from 0."""

    def __init__(self, path: str, numbers: list[int] | None) -> None:
        self.path = path
        self._numbers = numbers
        self._done = 0
        folder = os.path.dirname(os.fspath(_limpid.numbered(path, 0))) or "."
        if not os.path.isdir(folder):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), folder)

    def push(self, picture: Picture) -> None:
        number = self._done if self._numbers is None else self._numbers[self._done]
        picture.save(_limpid.numbered(self.path, number))
        self._done += 1

    def finish(self) -> None:
        if self._done == 0:
            raise ValueError(f"{self.path}: a film without pictures")

    def abandon(self) -> None:
        """Each picture is whole: they stay."""


def _each(name: str, values: Any, expected: str) -> Iterator[Any]:
    """One of the values for each picture."""
    try:
        return iter(values)
    except TypeError:
        raise ValueError(f"{name} is {values!r}; expected {expected}") from None


def _each_frame(name: str, values: Any, frames: int | None) -> Iterator[Any]:
    """The array of each frame, of so many if that is known."""
    expected = "one array for each frame"
    if isinstance(values, Mapping):
        raise ValueError(f"{name} is one mapping; expected one for each frame, as [{{...}}, ...]")
    shape = tuple(getattr(values, "shape", ()))
    # Velocities, colours and places are vectors.
    least = 3 if name in ("velocities", "diffuse", "colors") else 2
    if 0 < len(shape) < least:
        raise ValueError(f"{name} has the shape {shape}; expected {expected}, as [{name}, ...]")
    if frames is not None and isinstance(values, Sized) and len(values) != frames:
        turned = f", as {name}.swapaxes(0, 1)" if shape[1:2] == (frames,) else ""
        raise ValueError(f"{name} has {len(values)} entries for {frames} frames; expected {expected}{turned}")
    return _each(name, values, expected)


def _camera(camera: Any) -> Camera:
    if not isinstance(camera, Camera):
        raise ValueError(f"camera has {camera!r}; expected a limpid.Camera")
    return camera
