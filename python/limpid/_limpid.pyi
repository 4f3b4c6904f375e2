"""The native half of limpid: `limpid` wraps it, and other programs should not call it."""

from os import PathLike
from typing import Any, Callable, Sequence, final

import numpy as np
import numpy.typing as npt

__version__: str

_Path = str | PathLike[str] | bytes
_Vector = Sequence[float] | npt.NDArray[Any]
_Rows = Sequence[Sequence[float]] | npt.NDArray[np.floating[Any]]
_Arrays = dict[str, npt.NDArray[Any] | None]

@final
class Camera:
    """A camera that is aimed at a point: right-handed world, metres, degrees.

    Parameters
    ----------
    eye : three numbers
        Position, m.
    target : three numbers
        The point in the middle of the picture, m.
    fov_y : float
        Vertical field of view, degrees, above 0 and below 180.
    up : three numbers
        The direction that points up in the picture; not parallel to the view.
    near : float, optional
        Near plane, m; the eye counts as inside liquid nearer than this.

    Raises
    ------
    SceneError
        Naming the argument, if the values define no view.
    """

    def __new__(
        cls,
        eye: _Vector,
        target: _Vector,
        fov_y: float = 40.0,
        up: _Vector = (0.0, 1.0, 0.0),
        near: float | None = None,
    ) -> Camera: ...
    @staticmethod
    def orthographic(
        eye: _Vector,
        target: _Vector,
        height: float,
        up: _Vector = (0.0, 1.0, 0.0),
        near: float | None = None,
    ) -> Camera:
        """A camera with parallel rays.

        Parameters
        ----------
        eye, target, up, near : optional
            As for `Camera`.
        height : float
            Height of what the picture shows, m.
        """

    @staticmethod
    def orbit(
        target: _Vector,
        distance: float,
        azimuth: float = 25.0,
        elevation: float = 20.0,
        fov_y: float = 40.0,
        up: _Vector = (0.0, 1.0, 0.0),
    ) -> Camera:
        """A camera on a sphere around its target.

        Parameters
        ----------
        target : three numbers
            The point in the middle of the picture, m.
        distance : float
            Of the eye from the target, m.
        azimuth : float
            Direction of the eye, degrees: where y is up, from +z towards +x; where z is up, from -y
            towards +x.
        elevation : float
            Height of the eye above the horizon, degrees, -90 to 90.
        fov_y, up : optional
            As for `Camera`.
        """

    @staticmethod
    def fit(
        points: Any,
        azimuth: float = 25.0,
        elevation: float = 20.0,
        fov_y: float = 40.0,
        up: _Vector = (0.0, 1.0, 0.0),
        size: Sequence[int] = (1024, 768),
    ) -> Camera:
        """The camera that sees all points from a direction, and comes as near as it can.

        Parameters
        ----------
        points : (n, 3) array of floats, or Particles
            m.
        azimuth, elevation, fov_y, up : optional
            As for `Camera.orbit`.
        size : two integers
            Width and height of the picture, pixels.
        """

    @staticmethod
    def from_matrices(view: _Rows, projection: _Rows, *, opengl: bool = False) -> Camera:
        """The camera of a program that has matrices, which multiply columns. It may be perspective or
        orthographic, off-centre, and of reversed depth.

        Parameters
        ----------
        view : (4, 4) array
            From the world to view space: x right, y up, looking down -z.
        projection : (4, 4) array
            From view space to clip space.
        opengl : bool
            Whether depth in clip space is from -1 to 1, and not from 0 to 1 as in WebGPU, Vulkan, Metal
            and DirectX.
        """

    @property
    def eye(self) -> tuple[float, float, float]:
        """Position, m."""

    @property
    def target(self) -> tuple[float, float, float] | None:
        """The point in the middle of the picture, m; `None` for a camera from matrices."""

    @property
    def up(self) -> tuple[float, float, float] | None:
        """The direction that points up in the picture; `None` for a camera from matrices."""

    @property
    def fov_y(self) -> float | None:
        """Vertical field of view, degrees; `None` for parallel rays and cameras from matrices."""

    @property
    def height(self) -> float | None:
        """Height of what a picture with parallel rays shows, m; otherwise `None`."""

    @property
    def near(self) -> float | None:
        """Near plane, m, if it was given; see `Camera`."""

    def turned(self, degrees: float) -> Camera:
        """The camera turned by `degrees` about its target, counterclockwise as seen from above.

        Raises
        ------
        ValueError
            For a camera from matrices, which has no target.
        """

    def look_at(self, target: _Vector) -> Camera:
        """The camera at its place, aimed at another point.

        Parameters
        ----------
        target : three numbers
            The point, m.

        Raises
        ------
        ValueError
            For a camera from matrices.
        """

    @staticmethod
    def _parse(text: str) -> Camera: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...
    def __reduce__(self) -> Any: ...

@final
class Project:
    @staticmethod
    def parse(
        text: str,
        labels: Sequence[str],
        folder: _Path,
        meshes: Sequence[tuple[str, npt.NDArray[Any], npt.NDArray[Any], Any]],
        environments: Sequence[tuple[str, npt.NDArray[Any]]],
        textures: Sequence[tuple[str, npt.NDArray[Any]]],
        like: Project | None,
    ) -> Project: ...
    @staticmethod
    def load(path: _Path) -> Project: ...
    def save(self, path: _Path) -> None: ...
    def text(self) -> str: ...
    def table(self) -> dict[str, Any]: ...
    def is_same(self, other: Project) -> bool: ...
    def copy(self) -> Project: ...
    def set(self, overrides: Sequence[str]) -> None: ...
    @staticmethod
    def names() -> list[str]: ...
    def get(self, name: str) -> Any: ...
    @property
    def camera(self) -> Camera | None: ...
    @camera.setter
    def camera(self, value: Camera | None, /) -> None: ...
    def environment_map(self) -> npt.NDArray[np.float32] | None: ...
    def remarks(self) -> list[str]: ...

@final
class Radiance:
    def read(self) -> npt.NDArray[np.float32] | None: ...

@final
class Device:
    def __new__(cls, wanted: str | None) -> Device: ...
    @property
    def adapter(self) -> str: ...
    def close(self) -> None: ...
    def draw(
        self,
        arrays: _Arrays,
        coloring: dict[str, Any],
        project: Project | None,
        camera: Camera | None,
        up: str | None,
        radius: float | None,
        frame: int,
        size: tuple[int, int],
        samples: int | None,
        aovs: Sequence[str],
        alpha: bool,
        views: Sequence[Camera],
        diffuse: dict[str, Any] | None,
        described: bool,
        tick: Callable[[], object] | None,
    ) -> dict[str, Any]: ...
    def draw_frame(
        self,
        frames: Frames,
        index: int,
        camera: Camera | None,
        size: tuple[int, int],
        aovs: Sequence[str],
        described: bool,
        tick: Callable[[], object] | None,
    ) -> dict[str, Any]: ...

@final
class Frames:
    @staticmethod
    def open(source: _Path, opening: dict[str, Any]) -> Frames: ...
    def __len__(self, /) -> int: ...
    @property
    def numbers(self) -> list[int]: ...
    @property
    def fps(self) -> float | None: ...

@final
class Series:
    @staticmethod
    def open(
        source: _Path,
        map: str | None,
        select: str | None,
        skip_invalid: bool,
        up: str | None,
        scale: float | None,
        values: str | None,
    ) -> Series: ...
    @property
    def numbers(self) -> list[int]: ...
    @property
    def radius(self) -> float | None: ...
    @property
    def fps(self) -> float | None: ...
    def read(self, index: int) -> tuple[dict[str, Any], list[str]]: ...

@final
class FilmFile:
    def __new__(cls, path: _Path, width: int, height: int, fps: float) -> FilmFile: ...
    def push(self, rgba: npt.NDArray[np.uint8]) -> None: ...
    def finish(self) -> None: ...
    def abandon(self) -> None: ...

@final
class Bake:
    def __new__(cls, path: _Path, count: int | None) -> Bake: ...
    @property
    def count(self) -> int: ...
    @property
    def radius(self) -> float: ...
    @property
    def fps(self) -> float: ...
    def next(self) -> dict[str, npt.NDArray[Any]] | None: ...

def read(
    path: _Path, map: str | None, select: str | None, skip_invalid: bool
) -> tuple[dict[str, Any], list[str]]: ...
def write(path: _Path, arrays: _Arrays) -> list[str]: ...
def flip(
    reference: npt.NDArray[np.uint8], test: npt.NDArray[np.uint8]
) -> tuple[float, npt.NDArray[np.float32]]: ...
def load(path: _Path) -> npt.NDArray[np.uint8]: ...
def colormap(name: str) -> str: ...
def legend(
    rgba: npt.NDArray[np.uint8], scale: tuple[str, str, str, tuple[float, float]]
) -> npt.NDArray[np.uint8]: ...
def encode(extension: str, pixels: dict[str, Any]) -> bytes: ...
def save(path: _Path, extension: str, pixels: dict[str, Any]) -> None: ...
def numbered(output: _Path, number: int) -> PathLike[str]: ...
def finish(by_signal: bool) -> None: ...
def main(arguments: Sequence[str]) -> int: ...
