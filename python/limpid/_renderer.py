"""Rendering: pictures and films of particles."""

from __future__ import annotations

import atexit
import os
import re
import sys
import threading
import warnings
import weakref
from collections.abc import Iterable, Iterator, Sequence, Sized
from types import TracebackType
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import numbers, of_length, particle_arrays, placed, radius_of, samples_of, size_of, up_of
from ._errors import Error, LimpidWarning
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture
from ._scene import Scene
from ._world import PathLike

SceneLike = Union[Scene, PathLike]

_open: weakref.WeakSet[Renderer] = weakref.WeakSet()


class Renderer:
    """A graphics device with its compiled pipelines.

    Close it, or use it in a ``with`` statement. Any number of threads may use it at once.

    Parameters
    ----------
    device : str
        ``"auto"`` for the best adapter (or that of ``WGPU_ADAPTER_NAME``), or a part of an adapter's
        name.

    Raises
    ------
    NoAdapter
        If there is no adapter, or none of that name.
    """

    def __init__(self, device: str = "auto") -> None:
        if not isinstance(device, str) or not device:
            raise ValueError(f'device is {device!r}; expected "auto" or a part of an adapter\'s name')
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

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        try:
            return f"<limpid.Renderer on {self.adapter}>"
        except Error:
            return "<limpid.Renderer, closed>"

    def __reduce__(self) -> Any:
        raise TypeError("a Renderer cannot be pickled: each process opens a device of its own")

    def render(
        self,
        positions: npt.ArrayLike | Particles,
        *,
        radius: npt.ArrayLike | None = None,
        velocities: npt.ArrayLike | None = None,
        ids: npt.ArrayLike | None = None,
        ellipsoids: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        scene: SceneLike | None = None,
        camera: Camera | None = None,
        size: Sequence[int] = (1024, 768),
        samples: int | None = None,
        aovs: Iterable[str] = (),
        alpha: bool = False,
        up: str | None = None,
        frame: int = 0,
    ) -> Picture:
        """Draws particles.

        Parameters
        ----------
        positions : (n, 3) array of floats, or Particles
            Centres, m. Arrays may have any order and strides, and are copied once.
        radius : float or (n,) array, optional
            Particle radius, m, half the usual spacing; if it is not given, it is estimated from the
            spacing.
        velocities : (n, 3) array of floats, optional
            m/s; only motion vectors need them.
        ids : (n,) array of integers, optional
            Accepted for symmetry with `limpid.write`: a single picture does not need them.
        ellipsoids : (n, 3, 3) array of floats, optional
            Maps of the unit sphere to the particles' shapes, in units of their radius.
        colors : (n, 3) array of floats, optional
            For each particle, above 0 and at most 1: the colour of white light behind as much liquid
            of its kind as light typically crosses. Of more than 16 colours, similar ones are joined.
        scene : Scene or path, optional
            Everything else; a studio is made to fit by default.
        camera : Camera, optional
            In the world of the positions; that of the scene, or one that sees all particles, by
            default.
        size : two integers
            Width and height, pixels.
        samples : int, optional
            Rays per pixel: 1 for previews, 4 or 9 for final pictures (square numbers are best); those
            of the scene, 1 by default. They go where the picture has structure.
        aovs : iterable of str
            Intermediate images for ``picture.aov``, with 0 where there is nothing:
            ``"depth"`` (h, w), along the view direction to the first interface, m;
            ``"normal"`` (h, w, 3), outward, view space;
            ``"motion"`` (h, w, 2), pixels right and down in 1/30 s;
            ``"coverage"`` (h, w), and ``"mask"`` (h, w, fluids), 0 to 1;
            ``"smooth_depth"``, ``"smooth_normal"``, of the smoothed layers;
            ``"solid_depth"`` (h, w), m; ``"radiance"`` (h, w, 3), linear;
            ``"interfaces"``, ``"inside"`` (m), ``"iterations"``, ``"failures"`` (h, w), per ray;
            ``"caustics"``, of each light, of the light's own size; or ``"all"``.
            Depth and normal come with those of the layers before smoothing, which can be had alone:
            ``"front.depth"``, ``"back.depth"``, ``"splash_front.normal"`` and so on.
        alpha : bool
            Whether coverage becomes alpha: only liquid and solids cover a pixel.
        up : str, optional
            The axis that points up in the world of positions and camera, ``"y"`` or ``"z"``; without a
            scene it is taken from the camera, or guessed from the liquid's surface. Solids and lights
            of a scene are in a world of y up.
        frame : int
            Number of the frame, for solids that move.

        Returns
        -------
        Picture

        Raises
        ------
        ValueError
            Naming the argument that cannot be used; ``SceneError`` for scenes.
        OSError
            If a file of the scene cannot be read.
        DeviceLost
            If the device failed.

        Warns
        -----
        LimpidWarning
            If units, radius or camera are likely wrong, or if particles without a finite position are left
            out, up to half of them; in a series of pictures once.
        """
        return self._render(
            positions,
            radius=radius,
            velocities=velocities,
            ids=ids,
            ellipsoids=ellipsoids,
            colors=colors,
            scene=scene,
            camera=camera,
            size=size,
            samples=samples,
            aovs=aovs,
            alpha=alpha,
            up=up,
            frame=frame,
        )

    def render_views(
        self,
        positions: npt.ArrayLike | Particles,
        cameras: Iterable[Camera],
        *,
        radius: npt.ArrayLike | None = None,
        ellipsoids: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        scene: SceneLike | None = None,
        size: Sequence[int] = (256, 256),
        samples: int | None = None,
        alpha: bool = False,
        up: str | None = None,
        frame: int = 0,
    ) -> npt.NDArray[np.uint8]:
        """Draws particles from several cameras, for instance to train on the pictures.

        The particles are classified and uploaded once, and the caustics of lights are drawn once. A scene that is made
        to fit is made for the first camera.

        Parameters
        ----------
        positions : (n, 3) array of floats, or Particles
            As for `render`, and so are those that are not named here.
        cameras : iterable of Camera
            In the world of the positions.
        size : two integers
            Width and height of each picture, pixels.

        Returns
        -------
        (cameras, height, width, 4) array of bytes
            sRGB; the fourth channel is coverage with `alpha`, and 255 without.

        Raises
        ------
        ValueError, OSError, DeviceLost
            As `render`.
        """
        try:
            views = list(cameras)
        except TypeError:
            raise ValueError(f"cameras is {cameras!r}; expected cameras") from None
        for i, camera in enumerate(views):
            if not isinstance(camera, Camera):
                raise ValueError(f"cameras: number {i} is {camera!r}; expected a limpid.Camera")
        if not views:
            width, height = size_of(size)
            return np.empty((0, height, width, 4), np.uint8)
        drawn, scene = self._drawn(
            positions,
            radius=radius,
            ellipsoids=ellipsoids,
            colors=colors,
            scene=scene,
            camera=views[0],
            views=views,
            size=size,
            samples=samples,
            alpha=alpha,
            up=up,
            frame=frame,
        )
        self._known = (scene, scene)
        self._warn(drawn["notices"])
        pictures: npt.NDArray[np.uint8] = drawn["rgba"]
        return pictures

    def _render(
        self, positions: npt.ArrayLike | Particles, *, alpha: bool = False, **others: Any
    ) -> Picture:
        drawn, scene = self._drawn(positions, alpha=alpha, **others)
        picture = Picture(drawn, scene, bool(alpha))
        self._known = (scene, picture.scene)
        self._warn(drawn["notices"])
        return picture

    def _drawn(
        self,
        positions: npt.ArrayLike | Particles,
        *,
        radius: npt.ArrayLike | None = None,
        velocities: npt.ArrayLike | None = None,
        ids: npt.ArrayLike | None = None,
        ellipsoids: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        scene: SceneLike | None = None,
        camera: Camera | None = None,
        size: Sequence[int] = (1024, 768),
        samples: int | None = None,
        aovs: Iterable[str] = (),
        alpha: bool = False,
        up: str | None = None,
        frame: int = 0,
        thickness: float | None = None,
        views: Sequence[Camera] = (),
    ) -> tuple[dict[str, Any], Scene | None]:
        """What the device draws, with the scene that was given."""
        if isinstance(positions, Particles):
            own = positions
            velocities = own.velocities if velocities is None else velocities
            ellipsoids = own.ellipsoids if ellipsoids is None else ellipsoids
            ids = own.ids if ids is None else ids
            colors = own.colors if colors is None else colors
            if radius is None:
                radius = own.radius if own.radii is None else own.radii
            positions = own.positions
        value, radii = radius_of(radius)
        arrays = particle_arrays(
            positions, velocities=velocities, radii=radii, ids=ids, ellipsoids=ellipsoids
        )
        places = arrays["positions"]
        assert places is not None
        tints = None if colors is None else _colors(colors, len(places))
        kept = placed(places)
        if kept is not None:
            arrays = {name: None if array is None else array[kept] for name, array in arrays.items()}
            tints = None if tints is None else tints[kept]
        scene = _scene(scene)
        if camera is not None and not isinstance(camera, Camera):
            raise ValueError(f"camera is {camera!r}; expected a limpid.Camera")
        names = _names(aovs)
        if isinstance(frame, bool) or not isinstance(frame, (int, np.integer)):
            raise ValueError(f"frame is {frame!r}; expected a whole number")
        if not -(2**62) < frame < 2**62:
            raise ValueError(f"frame is {frame}; expected a number between -2**62 and 2**62")
        # What was looked at once does not need to be looked at for each picture of a series: of one scene.
        described = scene is not None and any(scene is known for known in self._known)
        if not described:
            self._issued.clear()
        drawn = self._device.draw(
            arrays,
            tints,
            None if scene is None else scene._project,
            camera,
            up_of(up),
            value,
            int(frame),
            size_of(size),
            samples_of(samples),
            names,
            bool(alpha),
            thickness,
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
                warnings.warn(notice, LimpidWarning, stacklevel=_level_of_caller())

    def film(
        self,
        source: Iterable[Any] | PathLike,
        path: PathLike,
        *,
        fps: float | None = None,
        radius: npt.ArrayLike | None = None,
        scene: SceneLike | None = None,
        camera: Camera | Iterable[Camera] | None = None,
        size: Sequence[int] = (1024, 768),
        samples: int | None = None,
        up: str | None = None,
    ) -> Film:
        """Draws a film, picture by picture.

        An iterator, which draws when it is asked for the next picture; its length is known where that
        of the source is::

            for picture in renderer.film(frames, "dam.mp4", fps=30):
                print(picture.seconds)
            renderer.film(frames, "dam.mp4", fps=30).run()      # without looking at the pictures

        The film is complete after the last picture. If the iterator is closed or forgotten before, the
        unfinished file is removed.

        Parameters
        ----------
        source : path, or iterable of arrays or Particles
            The frames: files as the program takes them (a pattern, a folder, a scene), or positions
            of shape (n, 3), one by one, numbered from 0 for solids that move.
        path : path
            .mp4 or .webm, which need ffmpeg, .gif or .apng.
        fps : float, optional
            Pictures per second; those of the source, 30 by default.
        camera : Camera or iterable of Camera, optional
            One for all pictures, or one for each. Scene and camera that are made to fit are those of
            the first frame with particles, and for files of the whole sequence.
        radius, scene, size, samples, up : optional
            As for `render`.

        Raises
        ------
        ValueError, OSError
            As `render`; if the film cannot be written, before anything is drawn.
        """
        return Film(self, source, path, fps, radius, scene, camera, size, samples, up)


class Film(Iterator[Picture]):
    """The pictures of a film that is being written: see `Renderer.film`."""

    def __init__(
        self,
        renderer: Renderer,
        source: Iterable[Any] | PathLike,
        path: PathLike,
        fps: float | None,
        radius: npt.ArrayLike | None,
        scene: SceneLike | None,
        camera: Camera | Iterable[Camera] | None,
        size: Sequence[int],
        samples: int | None,
        up: str | None,
    ) -> None:
        self._renderer = renderer
        self._size = size_of(size)
        self._samples = samples_of(samples)
        self._scene = _scene(scene)
        self._radius = radius
        self._up = up_of(up)
        self._number = 0
        self._settled = False
        self._drawing = threading.Lock()
        self._thickness: float | None = None
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
        if not self._drawing.acquire(blocking=False):
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
            self._drawing.release()

    def run(self) -> None:
        """Draws all pictures that are left, and so completes the film."""
        for _ in self:
            pass

    def close(self) -> None:
        """Removes the film, unless it is complete."""
        if self._file is not None:
            file, self._file = self._file, None
            file.abandon()

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_file", None) is not None:
            self.close()

    def _draw(self, file: _limpid.FilmFile) -> Picture:
        number = self._number
        if self._frames is not None:
            if number == len(self._frames):
                raise StopIteration
            renderer = self._renderer
            drawn = renderer._device.draw_frame(self._frames, number, self._size, number > 0)
            if number == 0:
                renderer._known = ()
                renderer._issued.clear()
            renderer._warn(drawn["notices"])
            picture = Picture(drawn, self._scene, False)
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
            picture = self._renderer._render(
                positions,
                radius=self._radius,
                scene=self._scene,
                camera=camera,
                size=self._size,
                samples=self._samples,
                up=self._up,
                frame=number,
                thickness=self._thickness,
            )
            if not self._settled and picture.particles > 0:
                self._settle(picture)
        file.push(picture.rgba)
        self._number += 1
        return picture

    def _settle(self, picture: Picture) -> None:
        """Keeps what was made to fit the first frame with particles."""
        self._settled = True
        self._scene = picture.scene
        self._thickness = picture._thickness
        # The scene has the axis.
        self._up = None


_default: Renderer | None = None
_default_lock = threading.Lock()


def render(
    positions: npt.ArrayLike | Particles,
    *,
    radius: npt.ArrayLike | None = None,
    velocities: npt.ArrayLike | None = None,
    ids: npt.ArrayLike | None = None,
    ellipsoids: npt.ArrayLike | None = None,
    colors: npt.ArrayLike | None = None,
    scene: SceneLike | None = None,
    camera: Camera | None = None,
    size: Sequence[int] = (1024, 768),
    samples: int | None = None,
    aovs: Iterable[str] = (),
    alpha: bool = False,
    up: str | None = None,
    frame: int = 0,
) -> Picture:
    """Draws particles with a renderer that all calls share: see `Renderer.render`."""
    global _default
    with _default_lock:
        if _default is None:
            _default = Renderer()
    return _default._render(
        positions,
        radius=radius,
        velocities=velocities,
        ids=ids,
        ellipsoids=ellipsoids,
        colors=colors,
        scene=scene,
        camera=camera,
        size=size,
        samples=samples,
        aovs=aovs,
        alpha=alpha,
        up=up,
        frame=frame,
    )


def _scene(scene: Any) -> Scene | None:
    if scene is None or isinstance(scene, Scene):
        return scene
    if isinstance(scene, (str, os.PathLike)):
        return Scene.load(scene)
    raise ValueError(f"scene is {scene!r}; expected a limpid.Scene or the path of a scene file")


def _colors(colors: Any, count: int) -> npt.NDArray[np.float32]:
    array = of_length("colors", numbers("colors", colors, ("n", 3)), count)
    single = np.ascontiguousarray(array, np.float32)
    good = (single > 0) & (single <= 1)
    if not good.all():
        row = int(np.argmin(good.all(axis=1)))
        raise ValueError(
            f"colors: particle {row} has {single[row].tolist()}; expected numbers above 0 and at most 1"
        )
    return single


def _names(aovs: Any) -> list[str]:
    if isinstance(aovs, str):
        aovs = aovs.split(",")
    try:
        return [str(name).strip() for name in aovs]
    except TypeError:
        raise ValueError(f"aovs is {aovs!r}; expected names of images") from None


def _level_of_caller() -> int:
    """The level, for `warnings.warn`, of the code that called this package."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("limpid."):
        level, frame = level + 1, frame.f_back
    return level


def _finish() -> None:
    """Ends what threads still draw, and closes all devices, before the interpreter does."""
    # Python ends such a process by the signal itself, which does not wait for a device.
    interrupted = getattr(sys, "last_type", None) is KeyboardInterrupt and not hasattr(sys, "ps1")
    _limpid.finish(interrupted)
    if interrupted:
        return
    for renderer in list(_open):
        renderer.close()


atexit.register(_finish)


def _forget() -> None:
    """In a forked child there is no device."""
    global _default, _default_lock
    _default = None
    _default_lock = threading.Lock()
    _open.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
