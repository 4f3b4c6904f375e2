"""Looking at particles, in a window or in a notebook."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy.typing as npt

from ._drawing import Request, SceneLike, opened
from ._limpid import Camera
from ._particles import Particles
from ._picture import Picture, in_notebook
from ._renderer import shared
from ._widget import orbiting
from ._window import Window, opened_window
from ._world import PathLike, Up


def view(
    source: npt.ArrayLike | Particles | PathLike | Sequence[Any],
    *,
    radius: npt.ArrayLike | None = None,
    velocities: npt.ArrayLike | None = None,
    colors: npt.ArrayLike | None = None,
    values: npt.ArrayLike | str | None = None,
    colormap: str | None = None,
    range: Sequence[float] | str | None = None,
    scene: SceneLike | None = None,
    camera: Camera | None = None,
    size: Sequence[int] | None = None,
    samples: int | None = None,
    up: Up = None,
    window: bool | None = None,
) -> Window | Any:
    """Shows particles: in a notebook as a picture that the mouse turns, otherwise in a window.

    The window is that of ``limpid view``, in a process of its own; it plays files and lists of frames. The picture in a
    notebook needs anywidget (``pip install anywidget``): drag to turn it, scroll to come nearer, double-click to go back.
    Its ``camera`` and ``shown``, the `Picture`, are there for the next cell.

    Parameters
    ----------
    source : (n, 3) array of floats, Particles, path, or a sequence of arrays or Particles
        As for `render`. A window is given particles by temporary files, and plays several frames.
    radius, velocities, colors, values, colormap, range, scene, up : optional
        As for `render`. A window shows `colors` as those of an opaque liquid.
    camera : Camera, optional
        The camera at first; a window takes it with a scene.
    size : two integers, optional
        Width and height, pixels: 640×480 in a notebook, 1280×800 for a window by default.
    samples : int, optional
        As for `render`; in a notebook, of pictures that stand still.
    window : bool, optional
        Whether to open a window; by default unless a notebook runs this.

    Returns
    -------
    Window, or a widget

    Raises
    ------
    Error
        If the window cannot be opened, as without a display.
    ImportError
        In a notebook without anywidget.
    """
    in_window = not in_notebook() if window is None else window
    request = Request(
        radius=radius,
        velocities=velocities,
        colors=colors,
        values=values,
        colormap=colormap,
        range=range,
        scene=scene,
        camera=camera,
        size=size if size is not None else (1280, 800) if in_window else (640, 480),
        samples=samples,
        up=up,
    )
    if in_window:
        return opened_window(source, request)
    drawing = shared()._drawing
    files = opened(source, request) if isinstance(source, (str, os.PathLike)) else None
    first: list[Picture] = []

    def draw(camera: Camera | None, coarse: bool) -> Picture:
        asked = request if camera is None else replace(request, camera=camera)
        if coarse:
            asked = replace(asked, size=[(side + 1) // 2 for side in request.size], samples=1)
        if files is not None:
            picture = drawing.frame(files, 0, asked, None, first=not first)
        else:
            if first:
                # What was made to fit stays as it is.
                asked = replace(asked, scene=first[0].scene)
            picture = drawing.picture(source, asked)
        first.append(picture)
        del first[1:]
        return picture

    return orbiting(draw)
