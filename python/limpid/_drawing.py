"""Drawing on a device, and what is said about its pictures."""

from __future__ import annotations

import atexit
import os
import re
import sys
import weakref
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import particle_arrays, placed, radius_of, samples_of, size_of, up_of
from ._coloring import coloring
from ._errors import warn
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture
from ._scene import Scene
from ._world import PathLike, Up

SceneLike = Union[Scene, PathLike, Mapping[str, Any]]

_open: weakref.WeakSet[Drawing] = weakref.WeakSet()


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
        self, positions: npt.ArrayLike | Particles, *, alpha: bool = False, **others: Any
    ) -> Picture:
        """A picture of particles: see `Renderer.render`."""
        drawn, scene = self._drawn(positions, alpha=alpha, **others)
        picture = Picture(drawn, scene, bool(alpha))
        self._known = (scene, picture.scene)
        self._warn(drawn["notices"])
        return picture

    def views(
        self, positions: npt.ArrayLike | Particles, views: Sequence[Camera], **others: Any
    ) -> npt.NDArray[np.uint8]:
        """Pictures of particles from several cameras: see `Renderer.render_views`."""
        drawn, scene = self._drawn(positions, camera=views[0], views=views, **others)
        self._known = (scene, scene)
        self._warn(drawn["notices"])
        pictures: npt.NDArray[np.uint8] = drawn["rgba"]
        return pictures

    def frame(
        self, frames: _limpid.Frames, number: int, size: tuple[int, int], scene: Scene | None
    ) -> Picture:
        """The picture of one of several files, which are a series."""
        drawn = self._device.draw_frame(frames, number, size, number > 0)
        if number == 0:
            self._known = ()
            self._issued.clear()
        self._warn(drawn["notices"])
        return Picture(drawn, scene, False)

    def _drawn(
        self,
        positions: npt.ArrayLike | Particles,
        *,
        radius: npt.ArrayLike | None = None,
        velocities: npt.ArrayLike | None = None,
        ids: npt.ArrayLike | None = None,
        ellipsoids: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        values: npt.ArrayLike | None = None,
        colormap: str | None = None,
        range: Sequence[float] | str | None = None,
        scene: SceneLike | None = None,
        camera: Camera | None = None,
        size: Sequence[int] = (1024, 768),
        samples: int | None = None,
        aovs: Iterable[str] = (),
        alpha: bool = False,
        up: Up = None,
        frame: int = 0,
        views: Sequence[Camera] = (),
    ) -> tuple[dict[str, Any], Scene | None]:
        """Draw the particles. Returns the device's results, and the scene that was given."""
        if isinstance(positions, Particles):
            own = positions
            velocities = own.velocities if velocities is None else velocities
            ellipsoids = own.ellipsoids if ellipsoids is None else ellipsoids
            ids = own.ids if ids is None else ids
            if colors is None and values is None:
                colors, values = own.colors, own.values
            if radius is None:
                radius = own.radius if own.radii is None else own.radii
            positions = own.positions
        value, radii = radius_of(radius)
        arrays = particle_arrays(
            positions, velocities=velocities, radii=radii, ids=ids, ellipsoids=ellipsoids
        )
        places = arrays["positions"]
        assert places is not None
        kept = placed(places)
        colored = coloring(colors, values, colormap, range, len(places), kept)
        if kept is not None:
            arrays = {name: None if array is None else array[kept] for name, array in arrays.items()}
        scene = scene_of(scene)
        if camera is not None and not isinstance(camera, Camera):
            raise ValueError(f"camera is {camera!r}; expected a limpid.Camera")
        names = _names(aovs)
        if isinstance(frame, bool) or not isinstance(frame, (int, np.integer)):
            raise ValueError(f"frame is {frame!r}; expected a whole number")
        if not -(2**62) < frame < 2**62:
            raise ValueError(f"frame is {frame}; expected a number between -2**62 and 2**62")
        # A scene is checked once, not for each picture of a series.
        described = scene is not None and any(scene is known for known in self._known)
        if not described:
            self._issued.clear()
        drawn = self._device.draw(
            arrays,
            colored,
            None if scene is None else scene._project,
            camera,
            up_of(up),
            value,
            int(frame),
            size_of(size),
            samples_of(samples),
            names,
            bool(alpha),
            views,
            described,
        )
        if kept is not None:
            lost, first = np.count_nonzero(~kept), np.argmin(kept)
            notice = (
                f"{lost} of {len(kept)} particles have no finite position and are left out "
                f"(the first: particle {first})"
            )
            drawn["notices"].insert(0, notice)
        return drawn, scene

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
