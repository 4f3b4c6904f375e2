"""limpid draws clear liquid straight from particles.

    import limpid
    picture = limpid.render(positions)        # (n, 3) array, metres
    picture.save("water.png")

Right-handed coordinates, metres, linear RGB. Work releases the interpreter's lock, and Ctrl-C ends it.
"""

from ._errors import Cancelled, DeviceLost, Error, FileError, LimpidWarning, NoAdapter, SceneError
from ._film import Film
from ._frames import Frames, frames
from ._limpid import Camera, __version__
from ._particles import Particles, bake, read, write
from ._picture import Images, Picture, flip
from ._renderer import Renderer, film, render
from ._scene import Scene, Settings
from ._view import view
from ._vtk import from_pyvista_camera, from_vtk
from ._window import Window
from ._world import (
    Box,
    Checker,
    Glow,
    Gradient,
    Ground,
    Key,
    Mesh,
    Plane,
    PointLight,
    Sky,
    Sphere,
    Sun,
)

for _kind in (Error, SceneError, FileError, NoAdapter, DeviceLost, Cancelled, LimpidWarning):
    # Under the names by which users catch them.
    _kind.__module__ = "limpid"

__all__ = [
    "Box",
    "Camera",
    "Cancelled",
    "Checker",
    "DeviceLost",
    "Error",
    "FileError",
    "Film",
    "Frames",
    "Glow",
    "Gradient",
    "Ground",
    "Images",
    "Key",
    "LimpidWarning",
    "Mesh",
    "NoAdapter",
    "Particles",
    "Picture",
    "Plane",
    "PointLight",
    "Renderer",
    "Scene",
    "SceneError",
    "Settings",
    "Sky",
    "Sphere",
    "Sun",
    "Window",
    "__version__",
    "bake",
    "film",
    "flip",
    "frames",
    "from_pyvista_camera",
    "from_vtk",
    "read",
    "render",
    "view",
    "write",
]
