"""The window of the program, in a process of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import _limpid
from ._arrays import particle_arrays, placed, radius_of
from ._closing import Closing
from ._coloring import coloring
from ._drawing import Request
from ._errors import Error
from ._particles import Particles

#: How long a window that cannot be opened may take to say so, s.
_PATIENCE = 1.5


_SCRIPT = "from limpid._window import main; raise SystemExit(main())"


class Window(Closing):
    """A window that shows liquid, in a process of its own: see `view`. It stays when this process ends."""

    def __init__(self, arguments: Sequence[str], folder: str) -> None:
        command = [sys.executable, "-c", _SCRIPT, folder, *arguments]
        self._folder = folder
        self._errors = tempfile.TemporaryFile()
        # In a session of its own, which Ctrl-C does not end.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._errors,
            env=_environment(),
            start_new_session=True,
        )
        try:
            self.wait(_PATIENCE)
        except TimeoutError:
            pass

    @property
    def is_open(self) -> bool:
        """Whether it has not been closed."""
        return self._process.poll() is None

    def wait(self, timeout: float | None = None) -> None:
        """Waits until it is closed.

        Raises
        ------
        Error
            If it could not be opened, or has failed.
        TimeoutError
            If it is still open after `timeout` seconds.
        """
        try:
            code = self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise TimeoutError(f"the window is still open after {timeout} s") from None
        if code > 0:
            self._errors.seek(0)
            lines = self._errors.read().decode(errors="replace").strip().splitlines()
            problem = lines[-1].removeprefix("limpid: ") if lines else f"the window has failed with code {code}"
            if "without its window" in problem:
                problem = "this limpid was built without its window; build it with: maturin build --features viewer"
            raise Error(problem)

    def close(self) -> None:
        """Closes it."""
        if self.is_open:
            self._process.terminate()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    def __repr__(self) -> str:
        return f"<limpid.Window, {'open' if self.is_open else 'closed'}>"


def opened_window(source: Any, request: Request) -> Window:
    """A window that shows files, particles, or a list of particles as a sequence."""
    folder = tempfile.mkdtemp(prefix="limpid-")
    try:
        return Window(_arguments(source, request, folder), folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _arguments(source: Any, request: Request, folder: str) -> list[str]:
    """The arguments of the program; writes what it shows into the folder."""
    shown = None
    if isinstance(source, (str, os.PathLike)):
        if request.values is not None and not isinstance(request.values, str):
            raise ValueError('values is an array; of files, name an attribute, as values="velocity"')
        path, shown = os.fsdecode(os.fspath(source)), request.values
    elif isinstance(source, Particles) or not _is_series(source):
        path = os.path.join(folder, "particles.npz")
        shown = _write(path, source, request)
    else:
        for number, frame in enumerate(source):
            shown = _write(os.path.join(folder, f"frame_{number:06}.npz"), frame, request) or shown
        path = os.path.join(folder, "frame_{}.npz")
    value, _ = radius_of(request.radius)
    scene = request.scene
    if request.camera is not None and scene is not None:
        scene = replace(request).scene.copy()
        scene.camera = request.camera
    arguments = ["view", path, f"--size={request.size[0]}x{request.size[1]}"]
    if scene is not None:
        scene.save(os.path.join(folder, "scene.toml"))
        arguments.append(f"--scene={os.path.join(folder, 'scene.toml')}")
    if value is not None:
        arguments.append(f"--radius={value}")
    if request.up is not None:
        arguments.append(f"--up={request.up}")
    if shown is not None:
        arguments.append(f"--color-by={shown}")
    if request.colormap is not None:
        arguments.append(f"--colormap={request.colormap}")
    if request.range is not None:
        low_high = request.range if isinstance(request.range, str) else "{}:{}".format(*request.range)
        arguments.append(f"--range={low_high}")
    fps = getattr(source, "fps", None)
    return arguments if fps is None else [*arguments, f"--fps={fps}"]


def _is_series(source: Any) -> bool:
    """Whether it is a list of frames, not one frame of numbers."""
    if not isinstance(source, Iterable) or getattr(source, "ndim", 3) == 2:
        return False
    first = next(iter(source), None) if isinstance(source, Sequence) else None
    return isinstance(first, Particles) or np.ndim(first if first is not None else 0) == 2


def _write(path: str, source: Any, request: Request) -> str | None:
    """Writes particles with their colours; returns the attribute that shows these."""
    if isinstance(source, Particles):
        request, source = request.of(source), source.positions
    _, radii = radius_of(request.radius)
    arrays = particle_arrays(source, velocities=request.velocities, radii=radii, ids=request.ids)
    places = arrays["positions"]
    assert places is not None
    colored = coloring(request.colors, request.values, None, None, len(places), placed(places))
    names = {"positions": "position", "velocities": "velocity", "radii": "radius", "ids": "id"}
    written = {names[name]: array for name, array in arrays.items() if name in names and array is not None}
    if "radius" in written:
        written["radius"] = written["radius"].reshape(-1)
    shown = None
    for name, attribute in (("values", "values"), ("colors", "color")):
        if colored[name] is not None:
            written[attribute] = colored[name]
            shown = attribute
    kept = placed(places)
    if kept is not None:
        own = ("values", "color")
        written = {name: array if name in own else array[kept] for name, array in written.items()}
    save: Any = np.savez
    save(path, **written)
    return shown


def _environment() -> dict[str, str]:
    """That of this process, in which the other finds the same package."""
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "NODEVICE_SELECT": "1", "PYTHONPATH": os.pathsep.join(paths)}


def main() -> int:
    """Runs the program, and removes the folder of what it shows."""
    folder, *arguments = sys.argv[1:]
    try:
        return _limpid.main(["limpid", *arguments])
    finally:
        shutil.rmtree(folder, ignore_errors=True)
