"""Rendering: pictures and films of particles."""

from __future__ import annotations

import functools
import inspect
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Concatenate, ParamSpec, TypeVar, Union

import numpy as np
import numpy.typing as npt

from ._arrays import size_of
from ._closing import Closing
from ._drawing import Drawing, Progress, Request, SceneLike, progress_of, ticking
from ._errors import Error
from ._film import Film
from ._limpid import Camera
from ._particles import Particles
from ._picture import Aov, Picture
from ._world import PathLike, Up

#: Foam, spray, bubbles and dust of one frame.
Diffuse = Union[Mapping[str, Any], npt.ArrayLike]


class Renderer(Closing):
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
        self._drawing = Drawing(device)

    @property
    def adapter(self) -> str:
        """The adapter's name."""
        return self._drawing.adapter

    def close(self) -> None:
        """Closes the device; pictures stay as they are."""
        self._drawing.close()

    def __repr__(self) -> str:
        try:
            return f"<limpid.Renderer on {self.adapter}>"
        except Error:
            return "<limpid.Renderer, closed>"

    def __reduce__(self) -> Any:
        raise TypeError("a Renderer cannot be pickled: each process opens a device of its own")

    def render(
        self,
        positions: npt.ArrayLike | Particles | PathLike,
        *,
        radius: npt.ArrayLike | None = None,
        velocities: npt.ArrayLike | None = None,
        ids: npt.ArrayLike | None = None,
        ellipsoids: npt.ArrayLike | None = None,
        diffuse: Diffuse | None = None,
        colors: npt.ArrayLike | None = None,
        values: npt.ArrayLike | str | None = None,
        colormap: str | None = None,
        range: Sequence[float] | str | None = None,
        scene: SceneLike | None = None,
        camera: Camera | None = None,
        size: Sequence[int] = (1024, 768),
        samples: int | None = None,
        aovs: Iterable[Aov] | Aov = (),
        alpha: bool = False,
        up: Up = None,
        frame: int | None = None,
        keep_radiance: bool = False,
        progress: Progress | None = None,
    ) -> Picture:
        """Draws particles.

        Parameters
        ----------
        positions : (n, 3) array of floats, Particles, or path
            Centres, m. Arrays may have any order and strides, and are copied once. Files are drawn as by the program,
            with the radius, velocities and so on that they have: a particle file, a pattern, a folder, or a scene with
            particles. `limpid.frames` reads files whose attributes have unusual names.
        radius : float, or (n,) or (n, 1) array, optional
            Particle radius, m, half the usual spacing; if it is not given, it is estimated from the
            spacing.
        velocities : (n, 3) array of floats, optional
            m/s; only motion vectors need them.
        ids : (n,) array of integers, optional
            Accepted for symmetry with `limpid.write`: a single picture does not need them.
        ellipsoids : (n, 3, 3) array of floats, optional
            Maps of the unit sphere to the particles' shapes, in units of their radius.
        diffuse : mapping or (m, 3) or (m, 4) array, optional
            Foam, spray, bubbles and dust: a mapping with ``positions`` (m, 3), m, and perhaps ``velocities`` (m, 3),
            ``radius`` (one, or (m,); by default a fifth of the liquid's), ``kinds`` ((m,), 0 foam, 1 spray, 2 bubble,
            3 dust; or a name for all), ``ages`` and ``lifetimes`` ((m,), s since they appeared and until they
            disappear); or positions alone, of foam, perhaps with the lifetime as fourth number.
        colors : (n, 3) or (n, 4) array, optional
            For each particle, floats from 0 to 1, linear, or bytes (uint8), sRGB; the fourth number is
            ignored. In a scene with an opaque liquid (``look="paint"``) they are the colours of its
            surface. On clear liquid, which is the default, they are those of white light behind as much
            liquid of its kind as light typically crosses, where less than 0.001 counts as that; of more
            than 16 colours, similar ones are joined.
        values : (n,), (n, 2) or (n, 3) array of numbers, optional
            Data that colour the particles, as temperatures; of vectors the length. Values near each
            other are averaged on the surface. The liquid becomes opaque; without a scene the look is
            ``paint``. Of files, the name of an attribute: ``"velocity"``, ``"density"``, ``"color"`` or any of their
            arrays.
        colormap : str, optional
            The colours of the values: ``"viridis"`` (default), ``"plasma"``, ``"inferno"``, ``"magma"``,
            ``"cividis"``, ``"turbo"``, ``"coolwarm"``, ``"spectral"`` or ``"greys"``.
        range : (low, high), optional
            Values of its first and last colour; ``None`` or ``"auto"`` for the 2nd to 98th percentile of
            these values, which ``"auto"`` prefers to a range of the scene. The picture's scene keeps it.
        scene : Scene, path or mapping, optional
            Everything else: a scene, or the path or the tables of a scene file; a studio is made to fit by
            default.
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
            ``"value"`` (h, w), of what colours the surface;
            ``"smooth_depth"``, ``"smooth_normal"``, of the smoothed layers;
            ``"solid_depth"`` (h, w), m; ``"radiance"`` (h, w, 3), linear;
            ``"interfaces"``, ``"inside"`` (m), ``"iterations"``, ``"failures"`` (h, w), per ray;
            ``"caustics"``, of each light, of the light's own size; or ``"all"``.
            Depth and normal come with those of the layers before smoothing, which can be had alone:
            ``"front.depth"``, ``"back.depth"``, ``"splash_front.normal"`` and so on.
        alpha : bool
            Whether coverage becomes alpha: only liquid and solids cover a pixel.
        up : str, optional
            The axis that points up in the world of positions and camera, ``"y"`` or ``"z"``. By default it
            is that of the scene, which `picture.scene` has, or taken from the camera, or guessed from the
            liquid's surface; ``picture.up`` tells it. Solids, lights and camera of a scene are in a world
            of y up.
        frame : int, optional
            Number of the frame, for solids that move, 0 by default; of several files the one to draw, the first by
            default.
        keep_radiance : bool
            Whether ``picture.radiance``, linear floats, is read at once and kept; otherwise it is read when it is asked
            for, while the device has it.
        progress : function of (done, total), optional
            Called every 0.05 s while the picture is drawn, with the number of pictures that are done and of all; if it
            returns ``False`` or raises, drawing ends.

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
        Cancelled
            If `progress` has returned ``False``.

        Warns
        -----
        LimpidWarning
            If units, radius or camera are likely wrong, or if particles without a finite position are left
            out, up to half of them; in a series of pictures once.
        """
        request = Request(
            radius=radius,
            velocities=velocities,
            ids=ids,
            ellipsoids=ellipsoids,
            diffuse=diffuse,
            colors=colors,
            values=values,
            colormap=colormap,
            range=range,
            scene=scene,
            camera=camera,
            size=size,
            samples=samples,
            aovs=aovs,
            alpha=alpha,
            up=up,
            frame=frame,
        )
        told = progress_of(progress)
        picture = self._drawing.picture(positions, request, ticking(told, 0, 1))
        if keep_radiance:
            picture.radiance  # Reads it.
        if told is not None:
            told(1, 1)
        return picture

    def render_views(
        self,
        positions: npt.ArrayLike | Particles,
        cameras: Iterable[Camera],
        *,
        radius: npt.ArrayLike | None = None,
        ellipsoids: npt.ArrayLike | None = None,
        diffuse: Diffuse | None = None,
        colors: npt.ArrayLike | None = None,
        values: npt.ArrayLike | None = None,
        colormap: str | None = None,
        range: Sequence[float] | str | None = None,
        scene: SceneLike | None = None,
        size: Sequence[int] = (256, 256),
        samples: int | None = None,
        alpha: bool = False,
        up: Up = None,
        frame: int = 0,
        progress: Progress | None = None,
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
        ValueError, OSError, DeviceLost, Cancelled
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
        request = Request(
            radius=radius,
            ellipsoids=ellipsoids,
            diffuse=diffuse,
            colors=colors,
            values=values,
            colormap=colormap,
            range=range,
            scene=scene,
            size=size,
            samples=samples,
            alpha=alpha,
            up=up,
            frame=frame,
        )
        told = progress_of(progress)
        pictures = self._drawing.views(positions, views, request, ticking(told, 0, len(views)))
        if told is not None:
            told(len(views), len(views))
        return pictures

    def film(
        self,
        source: Iterable[Any] | PathLike,
        path: PathLike | None = None,
        *,
        fps: float | None = None,
        radius: npt.ArrayLike | None = None,
        velocities: Iterable[npt.ArrayLike] | None = None,
        diffuse: Iterable[Diffuse | None] | None = None,
        colors: Iterable[npt.ArrayLike] | None = None,
        values: Iterable[npt.ArrayLike] | str | None = None,
        colormap: str | None = None,
        range: Sequence[float] | str | None = None,
        legend: bool | str = False,
        scene: SceneLike | None = None,
        camera: Camera | Iterable[Camera] | None = None,
        size: Sequence[int] = (1024, 768),
        samples: int | None = None,
        aovs: Iterable[Aov] | Aov = (),
        alpha: bool = False,
        up: Up = None,
        progress: Progress | None = None,
    ) -> Film:
        """Draws a film, picture by picture.

        An iterator, which draws when it is asked for the next picture; its length is known where that
        of the source is::

            for picture in renderer.film(frames, "dam.mp4", fps=30):
                print(picture.seconds)
            renderer.film(frames, "dam.mp4", fps=30).run()      # without looking at the pictures
            limpid.film("water_{}.bgeo")                        # notebooks draw it, and play it

        The film is complete after the last picture. If the iterator is closed or forgotten before, the
        unfinished file is removed.

        Parameters
        ----------
        source : path, or iterable of arrays or Particles
            The frames: files as the program takes them (a pattern, a folder, a scene), `limpid.frames`, or positions
            of shape (n, 3), one by one, numbered from 0 for solids that move. With several cameras it may be one frame.
        path : path, optional
            .mp4 or .webm, which need ffmpeg, .gif or .apng; or pictures, as ``"####.png"`` or ``"folder/"``, of any
            format of `Picture.save`. Without one the film is there to be looked at, as long as this object is.
        fps : float, optional
            Pictures per second; those of the source, 30 by default.
        velocities, colors, values : iterable of arrays, optional
            For each frame an array as for `render`, if frames are positions. `values` may be the name of an attribute
            of files.
        diffuse : iterable of mappings or arrays, optional
            For each frame its foam, spray, bubbles and dust as for `render`, or ``None``; files have their own.
        camera : Camera or iterable of Camera, optional
            One for all pictures, or one for each. Scene and camera that are made to fit are those of
            the first frame with particles, and for files of the whole sequence.
        colormap, range : optional
            As for `render`, for values. Without a range, that of the first frame whose values differ is kept for all,
            and for files that of the whole sequence.
        legend : bool or str
            Whether pictures get a legend, or its title: see `Picture.legend`.
        aovs : optional
            As for `render`; pictures in .exr files have them.
        alpha : bool
            As for `render`, if the pictures have files of their own.
        radius, scene, size, samples, up : optional
            As for `render`.
        progress : function of (done, total), optional
            Called after each picture, and every 0.05 s while one is drawn, with the number of pictures that are done and
            of all, or ``None``; if it returns ``False`` or raises, the film is closed.

        Raises
        ------
        ValueError, OSError, DeviceLost, Cancelled
            As `render`; if the film cannot be written, before anything is drawn.
        """
        request = Request(
            radius=radius,
            colormap=colormap,
            range=range,
            scene=scene,
            size=size,
            samples=samples,
            aovs=aovs,
            alpha=alpha,
            up=up,
        )
        return Film(
            self._drawing,
            source,
            path,
            request,
            camera=camera,
            given={"velocities": velocities, "diffuse": diffuse, "colors": colors, "values": values},
            fps=fps,
            legend=legend,
            progress=progress_of(progress),
        )


_default: Renderer | None = None
_default_lock = threading.Lock()


P = ParamSpec("P")
T = TypeVar("T")


def shared() -> Renderer:
    """The renderer of all functions."""
    global _default
    with _default_lock:
        if _default is None:
            _default = Renderer()
        return _default


def _shared(method: Callable[Concatenate[Renderer, P], T]) -> Callable[P, T]:
    """A method as a function, with a renderer that all calls share."""

    @functools.wraps(method)
    def call(*arguments: P.args, **keywords: P.kwargs) -> T:
        return method(shared(), *arguments, **keywords)

    signature = inspect.signature(method)
    parameters = list(signature.parameters.values())[1:]
    call.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    call.__qualname__ = method.__name__
    return call


render = _shared(Renderer.render)
film = _shared(Renderer.film)


def _forget() -> None:
    """In a forked child there is no device."""
    global _default, _default_lock
    _default = None
    _default_lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
