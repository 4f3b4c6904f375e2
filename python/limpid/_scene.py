"""Scenes: what a picture shows beside the liquid, and how the liquid looks."""

from __future__ import annotations

import json
import math
import os
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import Vector, integers, numbers, vector
from ._errors import FileError, LimpidWarning, SceneError
from ._limpid import Camera
from ._world import (
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

_SHAPES = {Plane: "plane", Box: "box", Sphere: "sphere", Mesh: "mesh"}


class Scene:
    """Surroundings and look of the liquid.

    Right-handed, y up, metres; linear RGB. Missing parts that the picture needs come from a
    `look`, unless there is an `environment`: then the scene is complete as it is.

    Parameters
    ----------
    ior : float, optional
        Index of refraction, 0.3 to 3; that of water, 1.33, by default.
    absorption : three numbers, optional
        Absorption coefficients of red, green and blue, 1/m.
    color : three numbers, optional
        Instead of `absorption`: the colour of white light behind a metre of the liquid.
    solids : iterable of Plane, Box, Sphere and Mesh, optional
        Opaque bodies, at most 512.
    lights : iterable of Sun and PointLight, optional
        Lights, at most 16, which illuminate lit solids.
    environment : optional
        Radiance of what is far away: three numbers for one colour, `Gradient`, `Sky`, the path of
        an equirectangular map (.hdr, .exr), or a map as an array of shape (height, width, 3), whose
        centre is -z and whose top row is +y.
    background : path or (height, width, 3) array of uint8, optional
        A picture behind everything.
    camera : Camera, optional
        The camera, if `render` is given none; without one it is made to fit.
    look : str, optional
        ``"studio"``, ``"daylight"``, ``"pool"``, ``"night"`` or ``"chart"``.
    floor : float or "none", optional
        Height of the look's ground, m, or ``"none"``; below liquid and solids by default.
    settings : mapping, optional
        Settings by name, as ``{"refract.samples": 4}``.

    Raises
    ------
    SceneError
        If a value is out of range, naming it.
    OSError
        If a file cannot be read.
    """

    def __init__(
        self,
        *,
        ior: float | None = None,
        absorption: Vector | None = None,
        color: Vector | None = None,
        solids: Iterable[Solid] | None = None,
        lights: Iterable[Light] | None = None,
        environment: Environment | None = None,
        background: PathLike | npt.NDArray[np.uint8] | None = None,
        camera: Camera | None = None,
        look: str | None = None,
        floor: float | str | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        arrays = _Arrays()
        table: dict[str, Any] = {}
        if look is not None:
            table["look"] = look
        if floor is not None:
            table["floor"] = floor if isinstance(floor, str) else float(floor)
        if ior is not None and not isinstance(ior, (int, float, np.number)):
            raise ValueError(f"ior is {ior!r}; expected a number")
        liquid: dict[str, Any] = {"ior": ior}
        for name, value in (("absorption", absorption), ("color", color)):
            liquid[name] = None if value is None else vector(name, value)
        table["liquid"] = {key: value for key, value in liquid.items() if value is not None}
        if environment is not None:
            table["environment"] = _environment(environment, arrays)
        if background is not None:
            table["background"] = {"file": arrays.texture("background", background)}
        table["solid"] = [
            _solid(f"solids[{i}]", solid, arrays) for i, solid in enumerate(_each("solids", solids))
        ]
        table["light"] = [
            _light(f"lights[{i}]", light) for i, light in enumerate(_each("lights", lights))
        ]
        self._begin(*_lines(table), _folder(), arrays)
        if camera is not None:
            self.camera = camera
        if settings is not None:
            if not isinstance(settings, Mapping):
                raise ValueError(f"settings is {settings!r}; expected a mapping of names to values")
            self.settings.update(settings)

    @classmethod
    def load(cls, path: PathLike) -> Scene:
        """Reads a scene file.

        Raises
        ------
        SceneError
            Naming the line and the key that cannot be used.
        OSError
            If it, or a file that it names, cannot be read.
        """
        scene = cls._of(_limpid.Project.load(os.fspath(path)))
        for remark in scene._project.remarks():
            warnings.warn(remark, LimpidWarning, stacklevel=2)
        return scene

    def save(self, path: PathLike) -> None:
        """Writes a scene file, which the program and `load` read.

        Raises
        ------
        ValueError
            If the scene has a mesh or a texture from an array, which scene files cannot hold.
        OSError
            If it cannot be written.
        """
        self._project.save(os.fspath(path))

    @property
    def settings(self) -> Settings:
        """The settings of the renderer by name, as ``scene.settings["refract.samples"] = 4``."""
        return Settings(self)

    @property
    def camera(self) -> Camera | None:
        """The camera, if the scene has one."""
        return self._project.camera

    @camera.setter
    def camera(self, camera: Camera | None) -> None:
        if camera is not None and not isinstance(camera, Camera):
            raise TypeError(f"camera is {camera!r}; expected a limpid.Camera")
        self._project.camera = camera

    @property
    def ior(self) -> float:
        """The index of refraction."""
        return self._project.ior

    @ior.setter
    def ior(self, ior: float) -> None:
        self._project.set([f"liquid.ior={_toml('ior', ior)}"])

    @property
    def absorption(self) -> tuple[float, float, float]:
        """Absorption coefficients of red, green and blue light, 1/m."""
        return self._project.absorption

    @absorption.setter
    def absorption(self, absorption: Vector) -> None:
        self._project.set([f"liquid.absorption={vector('absorption', absorption)}"])

    def copy(self) -> Scene:
        """A scene of its own with the same values, for variants."""
        return self._of(self._project.copy(), self)

    __copy__ = copy

    def __repr__(self) -> str:
        return f"<limpid.Scene, ior {self.ior:.4g}, absorption {self.absorption}>"

    def __reduce__(self) -> tuple[Any, ...]:
        arrays = _Arrays()
        arrays.meshes, arrays.textures = self._arrays.meshes, self._arrays.textures
        pixels = self._project.environment_map()
        if pixels is not None:
            arrays.environment(pixels[..., :3])
        return _restored, (self._project.text(), self._folder, arrays)

    def _begin(self, text: str, labels: list[str], folder: str, arrays: _Arrays) -> None:
        self._folder = folder
        self._arrays = arrays
        try:
            self._project = _limpid.Project.parse(
                text, labels, folder, arrays.meshes, arrays.environments, arrays.textures
            )
        except SceneError as error:
            raise SceneError(_in_words(str(error))) from None
        except FileError as error:
            # Of what is in memory, not in a file.
            name = re.match(r"\S*?(mesh-array-\d+): ", str(error))
            if name is None:
                raise
            label = arrays.labels.get(name[1], "a Mesh")
            raise ValueError(f"{label}: {str(error)[name.end() :]}") from None
        for remark in self._project.remarks():
            warnings.warn(remark, LimpidWarning, stacklevel=3)

    @classmethod
    def _of(cls, project: _limpid.Project, like: Scene | None = None) -> Scene:
        scene = cls.__new__(cls)
        scene._folder = _folder() if like is None else like._folder
        scene._arrays = _Arrays() if like is None else like._arrays
        scene._project = project
        return scene


def _in_words(problem: str) -> str:
    """A problem that names the tables of a scene file, in terms of the arguments."""
    problem = re.sub(
        r"^Scene: \[+(solid|light)\]+ (\d+):?",
        lambda match: f"{match[1]}s[{int(match[2]) - 1}]:",
        problem,
    )
    return re.sub(r"\[+(\w+)\]+", r"\1", problem, count=1) if problem.startswith("Scene: [") else problem


def _restored(text: str, folder: str, arrays: _Arrays) -> Scene:
    scene = Scene.__new__(Scene)
    scene._begin(text, [], folder, arrays)
    return scene


class Settings(MutableMapping[str, Any]):
    """The settings of a scene by name: ``pass.name``, as listed by ``limpid settings``.

    ``settings["preset"] = "imai2016"`` replaces all but those of caustics and tone mapping.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def __getitem__(self, name: str) -> Any:
        return self._scene._project.get(str(name))

    def __setitem__(self, name: str, value: Any) -> None:
        if not isinstance(name, str):
            raise TypeError(f"the setting {name!r} is not a name; expected pass.name")
        text = value if isinstance(value, str) else _toml(name, value)
        if not re.fullmatch(r"[a-z0-9_.]+", name):
            raise SceneError(f"{name!r} is not the name of a setting; expected pass.name")
        self._scene._project.set([f"{name}={text}"])

    def __delitem__(self, name: str) -> None:
        raise TypeError("settings cannot be removed; give them another value")

    def __iter__(self) -> Iterator[str]:
        return iter(_limpid.Project.names())

    def __len__(self) -> int:
        return len(_limpid.Project.names())

    def __repr__(self) -> str:
        return repr(dict(self))


class _Arrays:
    """Data of a scene in memory instead of files, by the names that stand for it in the text."""

    def __init__(self) -> None:
        self.meshes: list[tuple[str, npt.NDArray[Any], npt.NDArray[Any], Any]] = []
        self.environments: list[tuple[str, npt.NDArray[Any]]] = []
        self.textures: list[tuple[str, npt.NDArray[Any]]] = []
        # The user's labels of these names.
        self.labels: dict[str, str] = {}

    def mesh(self, label: str, mesh: Mesh) -> str:
        vertices = numbers(f"{label}.vertices", mesh.vertices, ("v", 3)).astype(np.float64)
        if not (np.abs(vertices) < 1e18).all():
            row = int(np.argmin((np.abs(vertices) < 1e18).all(axis=1)))
            raise ValueError(
                f"{label}.vertices: row {row} is {vertices[row].tolist()}; expected finite numbers below 1e18"
            )
        faces = np.array(integers(f"{label}.faces", mesh.faces, ("f", 3)))
        coordinates = None
        if mesh.coordinates is not None:
            coordinates = numbers("coordinates", mesh.coordinates, ("v", 2)).astype(np.float32)
            if len(coordinates) != len(vertices):
                raise ValueError(
                    f"coordinates has {len(coordinates)} rows for {len(vertices)} vertices"
                )
        name = f"mesh-array-{len(self.meshes) + 1}"
        self.labels[name] = label
        self.meshes.append((name, vertices, faces, coordinates))
        return name

    def environment(self, pixels: Any) -> str:
        array = numbers("environment", pixels, ("height", "width", 3))
        if array.size == 0:
            raise ValueError(f"environment has the shape {array.shape}, without a pixel")
        self.environments.append(("environment", np.array(array, np.float32)))
        return "environment"

    def texture(self, what: str, texture: PathLike | npt.NDArray[np.uint8]) -> str:
        if isinstance(texture, (str, os.PathLike)):
            return _path(what, texture)
        pixels = np.asarray(texture)
        if pixels.dtype != np.uint8:
            raise ValueError(f"{what} has the dtype {pixels.dtype}; expected a path or uint8")
        if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.size == 0:
            raise ValueError(f"{what} has the shape {pixels.shape}; expected (height, width, 3)")
        name = f"texture-array-{len(self.textures) + 1}"
        self.textures.append((name, np.array(pixels)))
        return name


def _folder() -> str:
    """The working directory, to which paths are relative."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        # It was removed; absolute paths need none.
        return ""


def _lines(table: Mapping[str, Any]) -> tuple[str, list[str]]:
    """The text of a scene file, and for each of its lines what the user has given there."""
    lines: list[str] = []
    labels: list[str] = []

    def add(line: str, label: str) -> None:
        lines.append(line)
        labels.append(label)

    for key, value in table.items():
        if not isinstance(value, list):
            add(f"{key} = {_toml(key, value)}", key)
            continue
        add(f"{key} = [", f"{key}s")
        for number, entry in enumerate(value):
            label = f"{key}s[{number}]"
            add(f"    {_toml(label, entry)},", label)
        add("]", f"{key}s")
    return "\n".join(lines), labels


def _each(name: str, values: Iterable[Any] | None) -> list[Any]:
    try:
        return [] if values is None else list(values)
    except TypeError:
        raise ValueError(f"{name} is {values!r}; expected a list") from None


def _environment(environment: Any, arrays: _Arrays) -> dict[str, Any]:
    if isinstance(environment, (Gradient, Sky)):
        name = "gradient" if isinstance(environment, Gradient) else "sky"
        return {name: _table("environment", environment)}
    if isinstance(environment, (str, os.PathLike)):
        return {"map": _path("environment", environment)}
    if np.ndim(environment) == 3:
        return {"map": arrays.environment(environment)}
    return {"radiance": vector("environment", environment)}


#: Fields with three numbers, and with four.
_VECTORS = frozenset(
    "origin normal min max center translate color even odd direction irradiance position intensity zenith"
    " horizon nadir radiance".split()
)
_ROTATIONS = frozenset(["rotate", "quaternion"])

#: Fields whose values are objects of limpid.
_OBJECTS: dict[str, type] = {"checker": Checker, "ground": Ground}


def _solid(label: str, solid: Any, arrays: _Arrays) -> dict[str, Any]:
    shape = _SHAPES.get(type(solid))
    if shape is None:
        raise ValueError(f"{label} is {solid!r}; expected a Plane, Box, Sphere or Mesh")
    table = {"shape": shape, **_table(label, solid)}
    if isinstance(solid, Mesh):
        if (solid.file is None) == (solid.vertices is None):
            raise ValueError(f"{label}: a Mesh takes a file, or vertices and faces")
        if (solid.vertices is None) != (solid.faces is None):
            raise ValueError(f"{label}: a Mesh takes vertices and faces together")
        for name in ("vertices", "faces", "coordinates"):
            table.pop(name, None)
        if solid.file is None:
            table["file"] = arrays.mesh(label, solid)
    if solid.texture is not None:
        table["texture"] = arrays.texture("texture", solid.texture)
    keys = _all_of(f"{label}.keys", table.pop("keys", ()), Key)
    if keys:
        table["key"] = [_table(f"{label}.keys[{i}]", key) for i, key in enumerate(keys)]
    return table


def _light(label: str, light: Any) -> dict[str, Any]:
    if isinstance(light, Sun):
        return {"sun": _table(label, light)}
    if isinstance(light, PointLight):
        return {"point": _table(label, light)}
    raise ValueError(f"{label} is {light!r}; expected a Sun or PointLight")


def _table(label: str, value: Any) -> dict[str, Any]:
    """The fields that are given."""
    table: dict[str, Any] = {}
    for entry in fields(value):
        name, given = entry.name, getattr(value, entry.name)
        if given is None:
            continue
        inner = f"{label}.{name}"
        if name in _VECTORS:
            given = vector(inner, given)
        elif name in _ROTATIONS:
            given = vector(inner, given, 4)
        elif name in _OBJECTS:
            if not isinstance(given, _OBJECTS[name]):
                expected = f"limpid.{_OBJECTS[name].__name__}"
                raise ValueError(f"{inner} is {given!r}; expected a {expected}")
            given = _table(inner, given)
        elif name == "glow":
            glows = _all_of(inner, given, Glow)
            given = [_table(f"{inner}[{i}]", glow) for i, glow in enumerate(glows)]
        table[name] = given
    # A mesh says by a word where its normals come from.
    if isinstance(value, Mesh) and value.normals is not None:
        table["normals"] = value.normals
    return table


def _all_of(label: str, values: Any, kind: type) -> list[Any]:
    found = _each(label, values)
    for value in found:
        if not isinstance(value, kind):
            raise ValueError(f"{label} has {value!r}; expected a limpid.{kind.__name__}")
    return found


def _path(what: str, path: PathLike) -> str:
    text = os.fspath(path)
    if not isinstance(text, str):
        raise ValueError(f"{what} is {path!r}; expected a path as text")
    return str(Path(text).absolute()) if text else text


def _toml(name: str, value: Any) -> str:
    """A value in TOML."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return repr(number) if math.isfinite(number) else str(number)
    if isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        if isinstance(text, str) and text.isprintable():
            return json.dumps(text, ensure_ascii=False)
        raise ValueError(f"{name} is {value!r}; expected printable text")
    if isinstance(value, Mapping):
        entries = (f"{key} = {_toml(f'{name}.{key}', inner)}" for key, inner in value.items())
        return "{ " + ", ".join(entries) + " }"
    try:
        values = list(value)
    except TypeError:
        raise ValueError(f"{name} is {value!r}; expected numbers, text or a list") from None
    return "[" + ", ".join(_toml(name, inner) for inner in values) + "]"
