"""Parts of scenes: tables of scene files from objects, and objects from tables."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from ._arrays import integers, numbers, vector
from ._errors import SceneError, warn
from ._world import (
    LOOKS,
    Box,
    Checker,
    Environment,
    Glow,
    Gradient,
    Ground,
    Key,
    Light,
    Mesh,
    PathLike,
    Plane,
    PointLight,
    Sky,
    Solid,
    Sphere,
    Sun,
)

Table = dict[str, Any]
T = TypeVar("T")

_SHAPES: dict[str, type] = {"plane": Plane, "box": Box, "sphere": Sphere, "mesh": Mesh}
_LIGHTS: dict[str, type] = {"sun": Sun, "point": PointLight}

#: Fields with three numbers, with four, and with one.
_VECTORS = frozenset(
    "origin normal min max center translate color even odd direction irradiance position intensity zenith"
    " horizon nadir radiance".split()
)
_ROTATIONS = frozenset(["rotate", "quaternion"])
_NUMBERS = frozenset("tile fade frame half_extent radius scale sharpness".split())

#: Fields that are colours of surfaces, and what they cannot be unless they are bytes.
_COLORS = frozenset(["color", "even", "odd"])
_BYTES_FROM = 16.0

#: Fields whose values are objects of limpid.
_OBJECTS: dict[str, type] = {"checker": Checker, "ground": Ground}


class Arrays:
    """Data of a scene in memory instead of files, by the names that stand for it in the tables."""

    def __init__(self) -> None:
        self.meshes: dict[str, tuple[npt.NDArray[Any], npt.NDArray[Any], Any]] = {}
        self.textures: dict[str, npt.NDArray[np.uint8]] = {}
        self.map: npt.NDArray[np.float32] | None = None
        # The user's labels of these names.
        self.labels: dict[str, str] = {}

    def kept(self, table: Table) -> Arrays:
        """Those that a table names."""
        names = {solid.get(key) for solid in table.get("solid") or () for key in ("file", "texture")}
        names.add((table.get("background") or {}).get("file"))
        names = {os.path.basename(name) for name in names if isinstance(name, str)}
        kept = Arrays()
        kept.meshes = {name: mesh for name, mesh in self.meshes.items() if name in names}
        kept.textures = {name: pixels for name, pixels in self.textures.items() if name in names}
        kept.map = self.map if "map" in (table.get("environment") or {}) else None
        kept.labels = self.labels
        return kept

    def mesh(self, label: str, mesh: Mesh) -> str:
        for name, (*own, coordinates) in self.meshes.items():
            if own[0] is mesh.vertices and own[1] is mesh.faces and coordinates is mesh.coordinates:
                return name
        vertices = numbers(f"{label}.vertices", mesh.vertices, ("v", 3)).astype(np.float64)
        if not (np.abs(vertices) < 1e18).all():
            row = int(np.argmin((np.abs(vertices) < 1e18).all(axis=1)))
            raise ValueError(
                f"{label}.vertices: row {row} is {vertices[row].tolist()}; expected finite numbers below 1e18"
            )
        faces = _faces(f"{label}.faces", mesh.faces)
        coordinates = None
        if mesh.coordinates is not None:
            name = f"{label}.coordinates"
            coordinates = numbers(name, mesh.coordinates, ("v", 2)).astype(np.float32)
            if len(coordinates) != len(vertices):
                raise ValueError(f"{name} has {len(coordinates)} rows for {len(vertices)} vertices; expected as many")
        name = self._new("mesh-array", label, self.meshes)
        for array in (vertices, faces, coordinates):
            if array is not None:
                # They are read again as parts of the scene, which would not follow them.
                array.setflags(write=False)
        self.meshes[name] = (vertices, faces, coordinates)
        return name

    def environment(self, pixels: Any) -> str:
        array = numbers("environment", pixels, ("height", "width", 3))
        if array.size == 0:
            raise ValueError(f"environment has the shape {array.shape}, without a pixel")
        self.map = np.array(array, np.float32)
        return "environment"

    def texture(self, what: str, texture: PathLike | npt.NDArray[np.uint8]) -> str:
        if isinstance(texture, (str, os.PathLike)):
            return _path(what, texture)
        for name, known in self.textures.items():
            if known is texture:
                return name
        pixels = np.asarray(texture)
        if pixels.dtype != np.uint8:
            raise ValueError(f"{what} has the dtype {pixels.dtype}; expected a path or uint8")
        if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.size == 0:
            raise ValueError(f"{what} has the shape {pixels.shape}; expected (height, width, 3)")
        name = self._new("texture-array", what, self.textures)
        self.textures[name] = np.array(pixels)
        self.textures[name].setflags(write=False)
        return name

    def _new(self, kind: str, label: str, known: Mapping[str, Any]) -> str:
        number = 1 + max((int(name.rpartition("-")[2]) for name in known), default=0)
        name = f"{kind}-{number}"
        self.labels[name] = label
        return name


def items(name: str, values: Iterable[Any] | None) -> list[Any]:
    """The entries of an argument that is a list."""
    if isinstance(values, (str, bytes, Mapping)):
        raise ValueError(f"{name} is {values!r}; expected a list")
    try:
        return [] if values is None else list(values)
    except TypeError:
        raise ValueError(f"{name} is {values!r}; expected a list") from None


def number(name: str, value: Any, low: float = -np.inf, high: float = np.inf) -> float:
    """A number of an argument."""
    is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not is_number or not low <= value <= high:
        within = "" if low == -np.inf else f" from {low:g} to {high:g}"
        raise SceneError(f"{name} is {value!r}; expected a number{within}")
    return float(value)


def environment_table(environment: Any, arrays: Arrays) -> Table:
    if isinstance(environment, (Gradient, Sky)):
        name = "gradient" if isinstance(environment, Gradient) else "sky"
        return {name: _table("environment", environment)}
    if isinstance(environment, str) and environment in LOOKS:
        raise SceneError(
            f'environment is {environment!r}, which is a look and no file; expected sky="{environment}" for its sky, '
            f'or look="{environment}" for all of it'
        )
    if isinstance(environment, (str, os.PathLike)):
        return {"map": _path("environment", environment)}
    if np.ndim(environment) == 3:
        return {"map": arrays.environment(environment)}
    return {"radiance": vector("environment", environment)}


def environment_of(table: Table | None, pixels: npt.NDArray[np.float32] | None) -> Environment | None:
    if table is None:
        return None
    if "gradient" in table:
        return Gradient(**_values(table["gradient"]))
    if "sky" in table:
        glows = tuple(Glow(**_values(glow)) for glow in table["sky"].get("glow", ()))
        return Sky(**{**_values(table["sky"]), "glow": glows})
    if "map" in table:
        assert pixels is not None
        return pixels[..., :3]
    return tuple(table["radiance"])


def solid_table(label: str, solid: Any, arrays: Arrays) -> Table:
    if isinstance(solid, Mesh) and solid.vertices is None and _is_array(solid.file):
        # As other packages take them.
        vertices: Any = solid.file
        solid = replace(solid, file=None, vertices=vertices)
    is_path = isinstance(solid, Mesh) and isinstance(solid.file, (str, os.PathLike, type(None)))
    if isinstance(solid, Mesh) and not is_path and solid.vertices is None:
        vertices, faces = _triangles(f"{label}.file", solid.file)
        solid = replace(solid, file=None, vertices=vertices, faces=faces)
    shapes = [name for name, kind in _SHAPES.items() if type(solid) is kind]
    if not shapes:
        raise ValueError(f"{label} is {solid!r}; expected a Plane, Box, Sphere or Mesh")
    table = {"shape": shapes[0], **_table(label, solid)}
    if isinstance(solid, Mesh):
        if (solid.file is None) == (solid.vertices is None):
            raise ValueError(f"{label}: a Mesh takes a file, or vertices and faces")
        if (solid.vertices is None) != (solid.faces is None):
            raise ValueError(f"{label}: a Mesh takes vertices and faces together")
        for name in ("vertices", "faces", "coordinates"):
            table.pop(name, None)
        if solid.file is None:
            table["file"] = arrays.mesh(label, solid)
        else:
            table["file"] = _path(f"{label}.file", solid.file)
    if solid.texture is not None:
        table["texture"] = arrays.texture(f"{label}.texture", solid.texture)
    keys = _all_of(f"{label}.keys", table.pop("keys", ()), Key)
    if keys:
        table["key"] = [_table(f"{label}.keys[{i}]", key) for i, key in enumerate(keys)]
    return table


def solid_of(table: Table, arrays: Arrays) -> Solid:
    given = _values(table)
    for name, kind in _OBJECTS.items():
        if name in given:
            given[name] = kind(**_values(given[name]))
    given["keys"] = tuple(Key(**_values(key)) for key in given.pop("key", ()))
    mesh = arrays.meshes.get(os.path.basename(given.get("file", "")))
    if mesh is not None:
        del given["file"]
        given["vertices"], given["faces"], given["coordinates"] = mesh
    if "texture" in given:
        given["texture"] = texture_of(given["texture"], arrays)
    solid: Solid = _SHAPES[given.pop("shape")](**given)
    return solid


def _is_array(value: Any) -> bool:
    return isinstance(value, (list, tuple)) or hasattr(value, "ndim")


def _faces(label: str, faces: Any) -> npt.NDArray[np.int64]:
    """The triangles of a mesh."""
    try:
        return np.array(integers(label, faces, ("f", 3)))
    except ValueError as error:
        found = np.asarray(faces) if _is_array(faces) else np.empty(0)
        expected = "expected rows of vertices, three for each triangle, of shape (f, 3)"
        if found.ndim == 1 and found.size and found.size % 4 == 0 and (found[::4] == 3).all():
            expected += ", as faces.reshape(-1, 4)[:, 1:]"
        elif found.dtype.kind == "f":
            expected += "; a Mesh takes vertices before faces"
        raise ValueError(f"{str(error).partition(';')[0]}; {expected}") from None


def _triangles(label: str, mesh: Any) -> tuple[Any, Any]:
    """Vertices and faces of a mesh of another package."""
    if hasattr(mesh, "extract_surface") and not hasattr(mesh, "is_all_triangles"):
        mesh = mesh.extract_surface()
    if hasattr(mesh, "is_all_triangles"):
        # In PyVista 0.43 and older a method.
        whole = mesh.is_all_triangles
        mesh = mesh if (whole() if callable(whole) else whole) else mesh.triangulate()
        return np.asarray(mesh.points), np.asarray(mesh.faces).reshape(-1, 4)[:, 1:]
    for name in ("faces", "triangles"):
        if hasattr(mesh, "vertices") and hasattr(mesh, name):
            return np.asarray(mesh.vertices), np.asarray(getattr(mesh, name))
    raise ValueError(f"{label} is {mesh!r}; expected a path, or a mesh of trimesh, PyVista or Open3D")


def texture_of(file: str, arrays: Arrays) -> str | npt.NDArray[np.uint8]:
    pixels = arrays.textures.get(os.path.basename(file))
    return file if pixels is None else pixels


def light_table(label: str, light: Any) -> Table:
    for name, kind in _LIGHTS.items():
        if isinstance(light, kind):
            return {name: _table(label, light)}
    raise ValueError(f"{label} is {light!r}; expected a Sun or PointLight")


def light_of(table: Table) -> Light:
    (name, values), *_ = table.items()
    light: Light = _LIGHTS[name](**_values(values))
    return light


def _values(table: Table) -> Table:
    """The entries of a table, vectors as tuples."""
    return {key: tuple(value) if key in _VECTORS | _ROTATIONS else value for key, value in table.items()}


def _table(label: str, value: Any) -> Table:
    """The fields that are given."""
    table: Table = {}
    for entry in fields(value):
        name, given = entry.name, getattr(value, entry.name)
        if given is None:
            continue
        inner = f"{label}.{name}"
        if name in _VECTORS:
            given = vector(inner, given)
            if name in _COLORS and max(given) >= _BYTES_FROM:
                warn(f"{inner} is {tuple(given)}; a colour is linear, and 1 is white: bytes are to be divided by 255")
        elif name in _ROTATIONS:
            given = vector(inner, given, 4)
        elif name in _NUMBERS:
            given = number(inner, given)
        elif name in _OBJECTS:
            if not isinstance(given, _OBJECTS[name]):
                expected = f"limpid.{_OBJECTS[name].__name__}"
                raise ValueError(f"{inner} is {given!r}; expected a {expected}")
            given = _table(inner, given)
        elif name == "glow":
            glows = _all_of(inner, given, Glow)
            given = [_table(f"{inner}[{i}]", glow) for i, glow in enumerate(glows)]
        table[name] = given
    return table


def _all_of(label: str, values: Any, kind: type) -> list[Any]:
    found = items(label, values)
    for value in found:
        if not isinstance(value, kind):
            raise ValueError(f"{label} has {value!r}; expected a limpid.{kind.__name__}")
    return found


def _path(what: str, path: PathLike) -> str:
    try:
        text = os.fspath(path)
    except TypeError:
        text = None
    if not isinstance(text, str):
        raise ValueError(f"{what} is {path!r}; expected a path as text")
    return str(Path(text).absolute()) if text else text
