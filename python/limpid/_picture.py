"""Pictures, and the difference between them."""

from __future__ import annotations

import atexit
import importlib
import os
import shutil
import subprocess
import sys
import tempfile
from typing import IO, Any, Literal, Union

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._errors import Error
from ._limpid import Camera
from ._scene import Scene
from ._world import PathLike

#: The names of intermediate images: those of the picture, and of its layers.
Aov = Union[
    Literal[
        "all",
        "depth",
        "normal",
        "motion",
        "coverage",
        "mask",
        "diffuse",
        "value",
        "smooth_depth",
        "smooth_normal",
        "solid_depth",
        "radiance",
        "interfaces",
        "inside",
        "iterations",
        "failures",
        "caustics",
    ],
    Literal[
        "front.depth",
        "front.normal",
        "front.smooth_depth",
        "front.smooth_normal",
        "back.depth",
        "back.normal",
        "back.smooth_depth",
        "back.smooth_normal",
        "splash_front.depth",
        "splash_front.normal",
        "splash_back.depth",
        "splash_back.normal",
    ],
]

_FORMATS = ("png", "jpg", "jpeg", "webp", "exr")

Pixels = npt.NDArray[np.uint8]


class Images(dict[str, npt.NDArray[np.float32]]):
    """Intermediate images by name."""

    def __missing__(self, name: str) -> Any:
        there = ", ".join(self) or "none"
        raise KeyError(f"{name}: not among the images that were asked for by aovs; there are: {there}")

    def __repr__(self) -> str:
        return "{" + ", ".join(f"{name!r}: {image.shape}" for name, image in self.items()) + "}"


class Picture:
    """A picture of particles.

    ``numpy.asarray(picture)`` is `rgba`, and so it is for libraries that take arrays; notebooks show it.

    Attributes
    ----------
    rgba : (height, width, 4) array of uint8
        sRGB and coverage, which is 255 unless the picture was drawn with ``alpha=True``; not
        premultiplied.
    aov : dict of arrays of float32
        The intermediate images that were asked for, of shape (height, width) or (height, width,
        channels).
    camera : Camera
        The camera that was used, in the world of the positions.
    up : str
        The axis that points up in the world of the positions, ``"y"`` or ``"z"``, given or guessed.
    scene : Scene
        The scene that was used, with everything that was not given: radius, axis, camera, look, the
        range of values and the thickness behind tints. Drawing the next positions in it keeps these,
        as `film` does. It has no camera if that was made from matrices, and of a picture without
        particles it is as it was given.
    colormap : str or None
        The colour map that shows values, if one does.
    range : (float, float) or None
        The values of its first and last colour; ``None`` if all values are the same.
    radius : float
        Median radius of the particles, m.
    particles, splashes : int
        Number of particles, and of those that were drawn as droplets.
    seconds : float
        Time that classification and drawing took, s. A renderer's first picture also compiles.
    """

    rgba: Pixels
    aov: Images
    camera: Camera
    up: str
    scene: Scene
    colormap: str | None
    range: tuple[float, float] | None
    radius: float
    particles: int
    splashes: int
    seconds: float

    def __init__(self, drawn: dict[str, Any], scene: Scene | None, alpha: bool) -> None:
        self.rgba = drawn["rgba"]
        self.aov = Images(drawn["aov"])
        self.camera = drawn["camera"]
        self.scene = Scene._of(drawn["project"], scene)
        self.up = drawn["up"]
        self.radius = drawn["radius"]
        self.particles = drawn["particles"]
        self.splashes = drawn["splashes"]
        self.seconds = drawn["seconds"]
        self._scale: tuple[str, str, str, tuple[float, float]] | None = drawn["scale"]
        self.colormap = self.range = None
        if self._scale is not None:
            _, _, self.colormap, (low, high) = self._scale
            self.range = (low, high) if low < high else None
        self._alpha = alpha
        self._radiance: npt.NDArray[np.float32] | None = None
        self._pending: _limpid.Radiance | None = drawn["radiance"]

    @property
    def radiance(self) -> npt.NDArray[np.float32]:
        """Linear radiance before exposure and tone curve, W/(m² sr), of shape (height, width, 3);
        with ``alpha=True`` (height, width, 4), the colours multiplied by the coverage.

        It stays on the device until it is asked for, and until four more pictures were drawn; with
        ``keep_radiance=True`` it is read at once.

        Raises
        ------
        Error
            If it is not kept any more.
        """
        if self._radiance is None and self._pending is not None:
            self._radiance = self._pending.read()
            self._pending = None
        if self._radiance is None:
            raise Error(
                "the radiance of this picture is not kept any more: ask for it before four more are drawn, or render "
                "with keep_radiance=True"
            )
        return self._radiance

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of `rgba`: height, width, 4."""
        return self.rgba.shape

    def save(self, file: PathLike | IO[bytes], format: str | None = None) -> None:
        """Writes the picture: .png, .jpg, .webp, or .exr for its radiance with the images of `aov`.

        The file is written whole or not at all. A .jpg holds no coverage. An .exr has the channels R, G, B (and A), and
        those of the images, named as by the program: ``depth.Z``, ``normal.X`` and so on; caustics are parts of their own.

        Parameters
        ----------
        file : path or file object
            Where it is written to; a file object must be open for bytes.
        format : str, optional
            ``"png"``, ``"jpg"``, ``"webp"`` or ``"exr"``; by default the extension of the path, and of file objects
            without a name ``"png"``.

        Raises
        ------
        ValueError
            For another extension.
        OSError
            If the file cannot be written.
        """
        write = getattr(file, "write", None)
        name = getattr(file, "name", None) if write else os.fspath(file)  # type: ignore[arg-type]
        if format is None:
            named = isinstance(name, (str, bytes))
            format = os.path.splitext(os.fsdecode(name))[1] if named else "png"  # type: ignore[arg-type]
        if not isinstance(format, str):
            raise ValueError(f'format is {format!r}; expected "png", "jpg", "webp" or "exr"')
        extension = format.lower().lstrip(".")
        if extension not in _FORMATS and write is None and _is_device(name):
            extension = "png"
        if extension not in _FORMATS:
            raise ValueError(f"{name or format}: a picture ends in .png, .jpg, .webp or .exr")
        if write is None:
            _limpid.save(name, extension, self._pixels(extension))  # type: ignore[arg-type]
        else:
            write(_limpid.encode(extension, self._pixels(extension)))

    def to_pil(self) -> Any:
        """The picture as a ``PIL.Image.Image``, with alpha if it was drawn with ``alpha=True``. Needs Pillow."""
        try:
            pil: Any = importlib.import_module("PIL.Image")
        except ImportError:
            raise ImportError("to_pil needs Pillow: pip install pillow") from None
        self._check()
        return pil.fromarray(self.rgba if self._alpha else np.ascontiguousarray(self.rgba[..., :3]))

    def show(self) -> None:
        """Shows the picture: in a notebook below the cell, otherwise in the system's program for pictures.

        Raises
        ------
        Error
            If there is no such program.
        """
        show(self)

    def tobytes(self) -> bytes:
        """The bytes of `rgba`, row by row from the top."""
        return self.rgba.tobytes()

    @property
    def __array_interface__(self) -> dict[str, Any]:
        # With strides: some libraries ask an object without them for a buffer.
        return {**self.rgba.__array_interface__, "strides": self.rgba.strides}

    def legend(self, title: str | None = None) -> Picture:
        """This picture with a legend in its upper right corner: a bar of the colours with the values that
        they stand for. Its `radiance` has none.

        Parameters
        ----------
        title : str, optional
            Name of the values, with their unit in brackets, as ``"temperature [K]"``; by default that of
            the scene's ``color_by``.

        Returns
        -------
        Picture
            Without a legend if it is too small for one.

        Raises
        ------
        ValueError
            If it shows no values.
        """
        self._check()
        if self._scale is None:
            raise ValueError("a legend needs a picture that shows values; give values")
        name, unit, colormap, ends = self._scale
        if title is not None:
            name, unit = title_of(title)
        picture = Picture.__new__(Picture)
        picture.__dict__.update(self.__dict__)
        picture.rgba = _limpid.legend(self.rgba, (name, unit, colormap, ends))
        return picture

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if dtype is not None and np.dtype(dtype) != self.rgba.dtype:
            if copy is False:
                raise ValueError("a picture of another dtype is a copy")
            return self.rgba.astype(dtype)
        return self.rgba.copy() if copy else self.rgba

    def _check(self) -> None:
        """Fails if somebody has replaced the pixels by others than a picture's."""
        pixels = self.rgba
        if not isinstance(pixels, np.ndarray) or pixels.dtype != np.uint8 or pixels.ndim != 3:
            raise ValueError("rgba was replaced; expected (height, width, 4) of uint8")

    def _pixels(self, extension: str) -> dict[str, Any]:
        """The picture as the native half encodes it."""
        self._check()
        radiance = self.radiance if extension == "exr" else None
        return {"rgba": self.rgba, "alpha": self._alpha, "radiance": radiance, "aov": dict(self.aov)}

    def _repr_png_(self) -> bytes:
        return _limpid.encode("png", self._pixels("png"))

    def __repr__(self) -> str:
        height, width = self.rgba.shape[:2]
        return f"<limpid.Picture of {width}x{height}, {self.particles} particles>"

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        if self._radiance is None and self._pending is not None:
            state["_radiance"] = self._pending.read()
        state["_pending"] = None
        return state


def _is_device(path: Any) -> bool:
    """Whether a path leads to a pipe or a device."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def show(picture: Picture) -> None:
    """Shows a picture where the user is."""
    if in_notebook():
        importlib.import_module("IPython.display").display(picture)
        return
    folder = tempfile.mkdtemp(prefix="limpid-")
    # The viewer opens the file after this returns, and may outlive the process.
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    path = os.path.join(folder, "picture.png")
    picture.save(path)
    if sys.platform == "win32":
        os.startfile(path)
        return
    program = "open" if sys.platform == "darwin" else "xdg-open"
    if shutil.which(program) is None:
        raise Error(f"there is no program {program} to show the picture; save it with picture.save(path)")
    done = subprocess.run([program, path], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Error(f"{program} cannot show the picture ({done.stderr.strip()}); save it with picture.save(path)")


def in_notebook() -> bool:
    """Whether a notebook runs this code."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def title_of(title: Any) -> tuple[str, str]:
    """Name and unit of a legend's title."""
    if not isinstance(title, str):
        raise ValueError(f'the title of a legend is {title!r}; expected text, as "temperature [K]"')
    name, bracket, unit = title.rstrip().partition("[")
    if bracket and unit.endswith("]"):
        return name.strip(), unit[:-1].strip()
    return title.strip(), ""


def flip(
    a: Picture | npt.ArrayLike | PathLike, b: Picture | npt.ArrayLike | PathLike
) -> tuple[float, npt.NDArray[np.float32]]:
    """The difference between two pictures as seen: FLIP (Andersson et al. 2020), 0 alike, 1 not.

    Parameters
    ----------
    a, b : Picture, (height, width, 3 or 4) array of uint8, or path of a PNG
        The reference and the picture to test, sRGB. Coverage is ignored.

    Returns
    -------
    mean : float
        Mean of all pixels.
    map : (height, width) array of float32
        FLIP of each pixel.

    Raises
    ------
    ValueError
        If the pictures have different sizes or are not pictures.
    OSError
        If a file cannot be read.
    """
    return _limpid.flip(_pixels("a", a), _pixels("b", b))


def _pixels(name: str, picture: Union[Picture, npt.ArrayLike, PathLike]) -> Pixels:
    if isinstance(picture, Picture):
        return picture.rgba
    if isinstance(picture, (str, os.PathLike)):
        return _limpid.load(os.fspath(picture))
    pixels = np.asarray(picture)
    if pixels.dtype != np.uint8:
        raise ValueError(f"{name} has the dtype {pixels.dtype}; expected uint8")
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.size == 0:
        raise ValueError(f"{name} has the shape {pixels.shape}; expected (height, width, 3 or 4)")
    return pixels
