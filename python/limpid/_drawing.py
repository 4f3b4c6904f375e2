"""Drawing on a device, and what is said about its pictures."""

from __future__ import annotations

import atexit
import os
import re
import sys
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import particle_arrays, placed, radius_of, samples_of, size_of, up_of
from ._coloring import coloring, colormap_of, range_of
from ._diffuse import diffuse_arrays
from ._errors import Cancelled, warn
from ._frames import Frames
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture
from ._scene import Scene
from ._world import PathLike, Up

SceneLike = Union[Scene, PathLike, Mapping[str, Any]]

#: Is told the number of pictures that are done, and of all if it is known; stops the work if it returns False.
Progress = Callable[[int, Union[int, None]], object]
Tick = Callable[[], None]


@dataclass(eq=False, kw_only=True)
class Request:
    """The arguments of a picture, apart from the positions: see `Renderer.render`.

    The arrays are checked with the positions, all else here.
    """

    radius: npt.ArrayLike | None = None
    velocities: npt.ArrayLike | None = None
    ids: npt.ArrayLike | None = None
    ellipsoids: npt.ArrayLike | None = None
    diffuse: Any = None
    colors: npt.ArrayLike | None = None
    values: npt.ArrayLike | str | None = None
    colormap: str | None = None
    range: Any = None
    scene: Any = None
    camera: Camera | None = None
    size: Any = (1024, 768)
    samples: int | None = None
    aovs: Any = ()
    alpha: bool = False
    up: Up = None
    frame: int | None = None

    def __post_init__(self) -> None:
        self.colormap = colormap_of(self.colormap)
        own_range = range_of(self.range)
        if not isinstance(self.range, str):
            # "auto" is more than none: it replaces the scene's.
            self.range = own_range
        self.scene = scene_of(self.scene)
        if self.camera is not None and not isinstance(self.camera, Camera):
            raise ValueError(f"camera is {self.camera!r}; expected a limpid.Camera")
        self.size = size_of(self.size)
        self.samples = samples_of(self.samples)
        self.aovs = _names(self.aovs)
        self.alpha = bool(self.alpha)
        self.up = up_of(self.up)
        frame = self.frame
        if frame is None:
            return
        if isinstance(frame, bool) or not isinstance(frame, (int, np.integer)):
            raise ValueError(f"frame is {frame!r}; expected a whole number")
        if not -(2**62) < frame < 2**62:
            raise ValueError(f"frame is {frame}; expected a number between -2**62 and 2**62")
        self.frame = int(frame)

    @property
    def shows_values(self) -> bool:
        """Whether it says how values are shown."""
        return self.colormap is not None or range_of(self.range) is not None

    def of(self, own: Particles) -> Request:
        """This, with what the particles have and nothing else was given for."""
        colors, values = self.colors, self.values
        if colors is None and values is None:
            colors, values = own.colors, own.values
        radius = self.radius
        if radius is None:
            radius = own.radius if own.radii is None else own.radii
        return replace(
            self,
            velocities=own.velocities if self.velocities is None else self.velocities,
            ellipsoids=own.ellipsoids if self.ellipsoids is None else self.ellipsoids,
            ids=own.ids if self.ids is None else self.ids,
            colors=colors,
            values=values,
            radius=radius,
        )


_open: weakref.WeakSet[Drawing] = weakref.WeakSet()


def opened(source: PathLike, request: Request) -> _limpid.Frames:
    """Files, opened to be drawn."""
    for name in ("velocities", "ids", "ellipsoids", "diffuse", "colors"):
        if getattr(request, name) is not None:
            raise ValueError(f"{name} is given, and files have their own; limpid.frames reads others, by its map")
    value, radii = radius_of(request.radius)
    if radii is not None:
        raise ValueError("radius is an array; files take one radius")
    values, scene = request.values, request.scene
    if values is not None and not isinstance(values, str):
        raise ValueError('values is an array; of files, name an attribute, as values="velocity"')
    if request.shows_values and values is None and scene is None:
        raise ValueError('colormap and range show values; name an attribute of the files, as values="velocity"')
    opening = {
        "project": None if scene is None else scene._project,
        "camera": request.camera,
        "up": request.up,
        "radius": value,
        "samples": request.samples,
        "size": request.size,
        "alpha": request.alpha,
        "motion": not {"motion", "all"}.isdisjoint(request.aovs),
        "values": values,
        "colormap": request.colormap,
        "range": range_of(request.range),
        "automatic": isinstance(request.range, str),
    }
    return _limpid.Frames.open(os.fspath(source), opening)


def ticking(progress: Progress | None, done: int, total: int | None) -> Tick | None:
    """A callback of a picture that is drawn, for a user's function."""
    if progress is None:
        return None
    told = progress

    def tick() -> None:
        if told(done, total) is False:
            raise Cancelled("progress has returned False: drawing was stopped")

    return tick


def progress_of(progress: Any) -> Progress | None:
    """A function that is told how far the work is."""
    if progress is None or callable(progress):
        return progress  # type: ignore[no-any-return]
    raise ValueError(f"progress is {progress!r}; expected a function of (done, total)")


class Drawing:
    """A device that draws series of pictures, and warns of each problem of a series once."""

    def __init__(self, device: str) -> None:
        # Mesa's device-select layer would ask a display server, and complain if there is none.
        os.environ.setdefault("NODEVICE_SELECT", "1")
        self._device = _limpid.Device(None if device == "auto" else device)
        # Of the last picture: its scenes, which were looked at, and what was said about it.
        self._known: tuple[Any, ...] = ()
        self._issued: set[str] = set()
        _open.add(self)

    @property
    def adapter(self) -> str:
        """The adapter's name."""
        return self._device.adapter

    def close(self) -> None:
        """Closes the device; pictures stay as they are."""
        self._device.close()

    def picture(
        self,
        positions: npt.ArrayLike | Particles | PathLike,
        request: Request,
        tick: Tick | None = None,
    ) -> Picture:
        """A picture of particles, or of a frame of files."""
        if isinstance(positions, (str, os.PathLike)):
            return self._file(positions, request, tick)
        drawn = self._drawn(positions, request, tick=tick)
        picture = Picture(drawn, request.scene, request.alpha)
        self._known = (request.scene, picture.scene)
        self._warn(drawn["notices"])
        return picture

    def views(
        self,
        positions: npt.ArrayLike | Particles,
        cameras: Sequence[Camera],
        request: Request,
        tick: Tick | None,
    ) -> npt.NDArray[np.uint8]:
        """Pictures of particles from several cameras: see `Renderer.render_views`."""
        drawn = self._drawn(positions, replace(request, camera=cameras[0]), cameras, tick)
        self._known = (request.scene,)
        self._warn(drawn["notices"])
        pictures: npt.NDArray[np.uint8] = drawn["rgba"]
        return pictures

    def frame(
        self, frames: _limpid.Frames, index: int, request: Request, tick: Tick | None, *, first: bool
    ) -> Picture:
        """The picture of a frame of files; if it is not the `first`, of one more of a series."""
        camera, size, aovs = request.camera, request.size, request.aovs
        drawn = self._device.draw_frame(frames, index, camera, size, aovs, not first, tick)
        if first:
            self._known = ()
            self._issued.clear()
        self._warn(drawn["notices"])
        return Picture(drawn, request.scene, request.alpha)

    def _file(self, path: PathLike, request: Request, tick: Tick | None) -> Picture:
        frames = opened(path, request)
        numbers = frames.numbers
        number = numbers[0] if request.frame is None else request.frame
        if number not in numbers:
            raise ValueError(f"frame is {number}; {os.fspath(path)!s} has {_listed(numbers)}")
        return self.frame(frames, numbers.index(number), request, tick, first=True)

    def _drawn(
        self,
        positions: npt.ArrayLike | Particles,
        request: Request,
        views: Sequence[Camera] = (),
        tick: Tick | None = None,
    ) -> dict[str, Any]:
        """Draws the particles. Returns the device's results."""
        if isinstance(positions, Particles):
            request, positions = request.of(positions), positions.positions
        if isinstance(positions, Frames):
            raise ValueError("positions is several frames; draw one, as positions[0], or limpid.film(positions)")
        if isinstance(request.values, str):
            raise ValueError(f"values is {request.values!r}; names are for files, give an array")
        value, radii = radius_of(request.radius)
        arrays = particle_arrays(
            positions,
            velocities=request.velocities,
            radii=radii,
            ids=request.ids,
            ellipsoids=request.ellipsoids,
        )
        places = arrays["positions"]
        assert places is not None
        kept = placed(places)
        colored = coloring(
            request.colors, request.values, request.colormap, request.range, len(places), kept
        )
        if kept is not None:
            arrays = {name: None if array is None else array[kept] for name, array in arrays.items()}
        # A scene is checked once, not for each picture of a series.
        scene = request.scene
        described = scene is not None and any(scene is known for known in self._known)
        if not described:
            self._issued.clear()
        drawn = self._device.draw(
            arrays,
            colored,
            None if scene is None else scene._project,
            request.camera,
            request.up,
            value,
            request.frame or 0,
            request.size,
            request.samples,
            request.aovs,
            request.alpha,
            views,
            diffuse_arrays(request.diffuse),
            described,
            tick,
        )
        if kept is not None:
            lost, first = np.count_nonzero(~kept), np.argmin(kept)
            notice = (
                f"{lost} of {len(kept)} particles have no finite position and are left out "
                f"(the first: particle {first})"
            )
            drawn["notices"].insert(0, notice)
        return drawn

    def _warn(self, notices: list[str]) -> None:
        """Warns of what was not yet said, whatever its numbers, about the series."""
        for notice in notices:
            words = re.sub(r"[0-9.,]+", "", notice)
            if words not in self._issued:
                self._issued.add(words)
                warn(notice)


def scene_of(scene: Any) -> Scene | None:
    if scene is None or isinstance(scene, Scene):
        return scene
    if isinstance(scene, (str, os.PathLike)):
        return Scene.load(scene)
    if isinstance(scene, Mapping):
        return Scene.from_dict(scene)
    raise ValueError(f"scene is {scene!r}; expected a limpid.Scene, or the path or the tables of a scene file")


def _names(aovs: Any) -> list[str]:
    if isinstance(aovs, str):
        aovs = aovs.split(",")
    try:
        return [str(name).strip() for name in aovs]
    except TypeError:
        raise ValueError(f"aovs is {aovs!r}; expected names of images") from None


def _listed(numbers: Sequence[int]) -> str:
    if len(numbers) == 1:
        return f"frame {numbers[0]} alone"
    return f"{len(numbers)} frames, {numbers[0]} to {numbers[-1]}"


def _finish() -> None:
    """Ends what threads still draw, and closes all devices, before the interpreter does."""
    # Python ends such a process by the signal itself, which does not wait for a device.
    interrupted = getattr(sys, "last_type", None) is KeyboardInterrupt and not hasattr(sys, "ps1")
    _limpid.finish(interrupted)
    if interrupted:
        return
    for drawing in list(_open):
        drawing.close()


atexit.register(_finish)


if hasattr(os, "register_at_fork"):
    # In a forked child there is no device.
    os.register_at_fork(after_in_child=_open.clear)
