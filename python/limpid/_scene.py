"""Scenes: what a picture shows beside the liquid, and how the liquid looks."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, MutableSequence
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from . import _limpid
from ._arrays import Vector, vector
from ._attributes import Strict, nearest
from ._errors import FileError, SceneError, warn
from ._limpid import Camera
from ._parts import (
    Arrays,
    Table,
    environment_of,
    environment_table,
    items,
    light_of,
    light_table,
    number,
    solid_of,
    solid_table,
    texture_of,
)
from ._toml import lines, value_of
from ._world import Environment, Light, Look, PathLike, Solid

T = TypeVar("T")


class Scene(Strict):
    """Surroundings and look of the liquid.

    Right-handed, y up, metres; linear RGB. A place or direction (x, y, z) of data with z up, which is drawn with
    ``up="z"``, is (x, z, -y) here. Every part can be read and assigned later, too; ``None`` stands for a part that the look
    provides, or that is made to fit.

    Parameters
    ----------
    look : str or None
        ``"studio"``, ``"daylight"``, ``"pool"``, ``"night"``, ``"chart"`` or ``"paint"``: provides sky,
        lights, ground, tint and tone curve, where the scene has none of its own. With ``None`` a scene
        that has an `environment` is complete as it is.
    sky : str, optional
        Another look, whose sky it is.
    floor : float or "none", optional
        Height of the look's ground, m, or ``"none"``; below liquid and solids by default, unless one of
        these is an unbounded level plane.
    ior : float, optional
        Index of refraction, 0.3 to 3; that of water, 1.33, by default.
    absorption : three numbers, optional
        Absorption coefficients of red, green and blue, 1/m.
    color : three numbers, optional
        Instead of `absorption`: the colour of white light behind a metre of the liquid.
    tint_thickness : float, optional
        Length of liquid behind which `colors` of particles are seen, m; that which light typically
        crosses by default.
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
    settings : mapping, optional
        Settings by name, as ``{"refract.samples": 4}``.

    Raises
    ------
    SceneError
        If a value is out of range, naming it.
    OSError
        If a file cannot be read.
    """

    #: The scene: everything else is read from it.
    _project: _limpid.Project
    #: Data that its text names instead of files, and the folder of relative paths in it.
    _arrays: Arrays
    _folder: str

    def __init__(
        self,
        *,
        look: Look = "studio",
        sky: Look = None,
        floor: float | str | None = None,
        ior: float | None = None,
        absorption: Vector | None = None,
        color: Vector | None = None,
        tint_thickness: float | None = None,
        solids: Iterable[Solid] | None = None,
        lights: Iterable[Light] | None = None,
        environment: Environment | None = None,
        background: PathLike | npt.NDArray[np.uint8] | None = None,
        camera: Camera | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        arrays = Arrays()
        liquid = {
            "ior": None if ior is None else number("ior", ior, 0.3, 3),
            "absorption": None if absorption is None else vector("absorption", absorption),
            "color": None if color is None else vector("color", color),
            "tint_thickness": None if tint_thickness is None else number("tint_thickness", tint_thickness),
        }
        table: Table = {
            "look": look,
            "sky": sky,
            "floor": _floor(floor),
            "liquid": {key: value for key, value in liquid.items() if value is not None},
            "environment": None if environment is None else environment_table(environment, arrays),
            "background": None if background is None else {"file": arrays.texture("background", background)},
            "solid": _tables("solids", solids, lambda label, solid: solid_table(label, solid, arrays)),
            "light": _tables("lights", lights, light_table),
        }
        self._parse(table, arrays)
        if camera is not None:
            self.camera = camera
        if settings is not None:
            self._configure(settings)

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
        scene._remark()
        return scene

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Scene:
        """A scene from the tables of a scene file, as ``tomllib`` and ``json`` read them; `render` takes
        such tables, too.

        ::

            limpid.Scene.from_dict({"look": "pool", "solid": [{"shape": "sphere", "center": [0, 1, 0], "radius": 0.2}]})

        Raises
        ------
        SceneError, OSError
            As `load`.
        """
        if not isinstance(table, Mapping):
            raise ValueError(f"the scene is {table!r}; expected tables by name")
        scene = cls.__new__(cls)
        scene._begin(*lines(table), _folder(), Arrays())
        return scene

    def to_toml(self) -> str:
        """The text of a scene file with this scene. Paths are absolute.

        Raises
        ------
        ValueError
            If the scene has an array, which `save` writes into a file beside the scene's.
        """
        if self._arrays.meshes or self._arrays.textures or self._project.environment_map() is not None:
            raise ValueError("the scene has a mesh or a picture in memory; save writes these beside a scene file")
        return self._project.text()

    def save(self, path: PathLike) -> None:
        """Writes a scene file, which the program and `load` read.

        Arrays become files beside it: for ``scene.toml`` meshes ``scene.mesh-1.ply``, textures
        ``scene.texture-1.png`` and an environment map ``scene.environment.exr``.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        self._project.save(os.fspath(path))

    @property
    def look(self) -> Look:
        """The look that completes the scene; ``None`` if nothing is missing.

        Assigned to a complete scene, it replaces environment, lights and tone mapping, as the program's
        ``--look``, and ``"paint"`` the liquid.
        """
        look: Look = self._project.table().get("look")
        return look

    @look.setter
    def look(self, look: Look) -> None:
        table = self._project.table()
        if "look" not in table and look is not None:
            for name in ("environment", "light"):
                table.pop(name, None)
            for name in ("tonemap", "caustics"):
                table.get("settings", {}).pop(name, None)
        if look == "paint":
            table.pop("liquid")
        self._parse({**table, "look": look})

    @property
    def sky(self) -> Look:
        """The look whose sky it is, if that is not the scene's own look. It replaces an environment."""
        sky: Look = self._project.table().get("sky")
        return sky

    @sky.setter
    def sky(self, sky: Look) -> None:
        others = {} if sky is None else {"environment": None}
        self._change(sky=sky, **others)

    @property
    def floor(self) -> float | str | None:
        """Height of the look's ground, m, or ``"none"``; ``None`` where it is made to fit. Assigned to a
        scene that has this ground as a solid, it moves or removes that."""
        table = self._project.table()
        grounds = [solid for solid in table.get("solid", ()) if _is_ground(solid)]
        floor: float | str | None = table.get("floor")
        return grounds[0]["origin"][1] if grounds else floor

    @floor.setter
    def floor(self, floor: float | str | None) -> None:
        height = _floor(floor)
        solids = self._project.table().get("solid", [])
        if isinstance(height, float) and any(map(_is_ground, solids)):
            for solid in filter(_is_ground, solids):
                solid["origin"][1] = height
            height = None
        elif floor is not None:
            solids = [solid for solid in solids if not _is_ground(solid)]
        self._change(floor=height, solid=solids)

    @property
    def ior(self) -> float:
        """The index of refraction."""
        ior: float = self._liquid["ior"]
        return ior

    @ior.setter
    def ior(self, ior: float) -> None:
        self._project.set([f"liquid.ior={number('ior', ior, 0.3, 3)}"])

    @property
    def absorption(self) -> tuple[float, float, float] | None:
        """Absorption coefficients of red, green and blue light, 1/m; ``None`` for those of the look, and
        for an opaque liquid."""
        return _three(self._liquid.get("absorption"))

    @absorption.setter
    def absorption(self, absorption: Vector | None) -> None:
        self._change_liquid(absorption=None if absorption is None else vector("absorption", absorption))

    @property
    def color(self) -> tuple[float, float, float] | None:
        """The colour of white light behind a metre of the liquid, or of the surface of an opaque one;
        ``None`` for that of the look."""
        absorption = self._liquid.get("absorption")
        if absorption is not None:
            absorption = [float(f"{math.exp(-k):.7g}") for k in absorption]
        return _three(self._liquid.get("color", absorption))

    @color.setter
    def color(self, color: Vector | None) -> None:
        self._change_liquid(color=None if color is None else vector("color", color))

    @property
    def tint_thickness(self) -> float | None:
        """Length of liquid behind which `colors` of particles are seen, m; ``None`` for that which light
        typically crosses in the first picture."""
        thickness: float | None = self._liquid.get("tint_thickness")
        return thickness

    @tint_thickness.setter
    def tint_thickness(self, length: float | None) -> None:
        self._change_liquid(tint_thickness=None if length is None else number("tint_thickness", length))

    @property
    def solids(self) -> Parts[Solid]:
        """The opaque bodies, a list: ``scene.solids.append(limpid.Sphere((0, 1, 0), 0.2))``."""
        return Parts(self, "solid")

    @solids.setter
    def solids(self, solids: Iterable[Solid] | None) -> None:
        arrays = self._own_arrays()
        tables = _tables("solids", solids, lambda label, solid: solid_table(label, solid, arrays))
        self._change(arrays, solid=tables)

    @property
    def lights(self) -> Parts[Light]:
        """The lights, a list; those of the look, if it is empty."""
        return Parts(self, "light")

    @lights.setter
    def lights(self, lights: Iterable[Light] | None) -> None:
        self._change(light=_tables("lights", lights, light_table))

    @property
    def environment(self) -> Environment | None:
        """Radiance of what is far away; ``None`` for the sky of a look. A map is an array."""
        return environment_of(self._project.table().get("environment"), self._project.environment_map())

    @environment.setter
    def environment(self, environment: Environment | None) -> None:
        arrays = self._own_arrays()
        table = None if environment is None else environment_table(environment, arrays)
        self._change(arrays, environment=table, sky=None)

    @property
    def background(self) -> PathLike | npt.NDArray[np.uint8] | None:
        """The picture behind everything."""
        table = self._project.table().get("background")
        return None if table is None else texture_of(table["file"], self._arrays)

    @background.setter
    def background(self, background: PathLike | npt.NDArray[np.uint8] | None) -> None:
        arrays = self._own_arrays()
        table = None if background is None else {"file": arrays.texture("background", background)}
        self._change(arrays, background=table)

    @property
    def camera(self) -> Camera | None:
        """The camera, if the scene has one."""
        return self._project.camera

    @camera.setter
    def camera(self, camera: Camera | None) -> None:
        if camera is not None and not isinstance(camera, Camera):
            raise ValueError(f"camera is {camera!r}; expected a limpid.Camera")
        self._project.camera = camera

    @property
    def settings(self) -> Settings:
        """The settings of the renderer by name, as ``scene.settings["refract.samples"] = 4``."""
        return Settings(self)

    @settings.setter
    def settings(self, settings: Mapping[str, Any]) -> None:
        copy = self.copy()
        copy._change(settings=None)
        copy._configure(settings)
        self._project = copy._project

    def copy(self) -> Scene:
        """A scene of its own with the same values, for variants."""
        return self._of(self._project.copy(), self)

    __copy__ = copy

    def __deepcopy__(self, memo: Any) -> Scene:
        return self.copy()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scene):
            return NotImplemented
        return self._project.is_same(other._project)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        values = {"look": self.look, "ior": self.ior, "absorption": self.absorption, "camera": self.camera}
        parts = [f"{name}={value!r}" for name, value in values.items() if value is not None]
        counts = {"solids": len(self.solids), "lights": len(self.lights)}
        parts += [f"{count} {name if count > 1 else name[:-1]}" for name, count in counts.items() if count]
        return f"<limpid.Scene, {', '.join(parts)}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._project.text(), self._folder, self._own_arrays())

    @property
    def _liquid(self) -> Table:
        liquid: Table = self._project.table()["liquid"]
        return liquid

    def _own_arrays(self) -> Arrays:
        """A copy of the arrays, to which others can be added."""
        arrays = self._arrays.kept(self._project.table())
        pixels = self._project.environment_map()
        arrays.map = None if pixels is None else np.ascontiguousarray(pixels[..., :3])
        return arrays

    def _change(self, arrays: Arrays | None = None, **tables: Any) -> None:
        """Replaces tables of the scene file."""
        self._parse({**self._project.table(), **tables}, arrays)

    def _change_liquid(self, **values: Any) -> None:
        """Replaces values of the liquid; of its colours one."""
        old = self._liquid
        if "tint_thickness" not in values:
            dropped = ("absorption", "color", "medium", "color_by", "colormap", "color_range")
            old = {key: value for key, value in old.items() if key not in dropped}
        new = {**old, **values}
        self._change(liquid={key: value for key, value in new.items() if value is not None})

    def _configure(self, settings: Any) -> None:
        if not isinstance(settings, Mapping):
            raise ValueError(f"settings is {settings!r}; expected a mapping of names to values")
        self.settings.update(settings)

    def _parse(self, table: Table, arrays: Arrays | None = None) -> None:
        """Becomes the scene of these tables, unless they have a problem."""
        folder: str = getattr(self, "_folder", None) or _folder()
        arrays = (self._own_arrays() if arrays is None else arrays).kept(table)
        text, labels = lines({key: value for key, value in table.items() if value is not None and value != []})
        self._begin(text, labels, folder, arrays)

    def _begin(self, text: str, labels: list[str], folder: str, arrays: Arrays) -> None:
        meshes = [(name, *mesh) for name, mesh in arrays.meshes.items()]
        environments = [] if arrays.map is None else [("environment", arrays.map)]
        try:
            project = _limpid.Project.parse(
                text,
                labels,
                folder,
                meshes,
                environments,
                list(arrays.textures.items()),
                getattr(self, "_project", None),
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
        self._folder, self._arrays, self._project = folder, arrays, project
        self._remark()

    def _remark(self) -> None:
        for remark in self._project.remarks():
            warn(remark)

    @classmethod
    def _of(cls, project: _limpid.Project, like: Scene | None = None) -> Scene:
        scene = cls.__new__(cls)
        scene._folder = _folder() if like is None else like._folder
        scene._arrays = Arrays() if like is None else like._arrays
        scene._project = project
        return scene


def _restored(text: str, folder: str, arrays: Arrays) -> Scene:
    scene = Scene.__new__(Scene)
    scene._begin(text, [], folder, arrays)
    return scene


def _in_words(problem: str) -> str:
    """A problem that names the tables of a scene file, in terms of the arguments."""
    problem = re.sub(
        r"^Scene: \[+(solid|light)\]+ (\d+):?",
        lambda match: f"{match[1]}s[{int(match[2]) - 1}]:",
        problem,
    )
    return re.sub(r"\[+(\w+)\]+", r"\1", problem, count=1) if problem.startswith("Scene: [") else problem


def _is_ground(solid: Table) -> bool:
    """Whether a table is the ground of a look."""
    return "ground" in solid and "half_extent" not in solid and solid["normal"] == [0, 1, 0]


def _floor(floor: Any) -> float | str | None:
    if floor is None or isinstance(floor, str) and floor == "none":
        return floor
    try:
        return number("floor", floor, -1e18, 1e18)
    except SceneError:
        raise SceneError(f'floor is {floor!r}; expected a height in metres, or "none"') from None


def _three(values: Any) -> tuple[float, float, float] | None:
    return None if values is None else (values[0], values[1], values[2])


def _tables(name: str, values: Any, table_of: Callable[[str, Any], Table]) -> list[Table]:
    return [table_of(f"{name}[{i}]", value) for i, value in enumerate(items(name, values))]


class Parts(Strict, MutableSequence[T], Generic[T]):
    """The solids or the lights of a scene, a list: its changes are those of the scene."""

    def __init__(self, scene: Scene, table: str) -> None:
        self._scene = scene
        self._table = table

    def _list(self) -> list[T]:
        found: list[Any] = self._scene._project.table().get(self._table, [])
        if self._table == "light":
            return [light_of(table) for table in found]  # type: ignore[misc]
        return [solid_of(table, self._scene._arrays) for table in found]  # type: ignore[misc]

    def _replace(self, parts: list[T]) -> None:
        setattr(self._scene, f"{self._table}s", parts)

    def __len__(self) -> int:
        return len(self._scene._project.table().get(self._table, []))

    def __getitem__(self, index: Any) -> Any:
        return self._list()[index]

    def __setitem__(self, index: Any, value: Any) -> None:
        parts = self._list()
        parts[index] = value
        self._replace(parts)

    def __delitem__(self, index: Any) -> None:
        parts = self._list()
        del parts[index]
        self._replace(parts)

    def insert(self, index: int, value: T) -> None:
        """Adds one before the one at this index."""
        parts = self._list()
        parts.insert(index, value)
        self._replace(parts)

    def extend(self, values: Iterable[T]) -> None:
        """Adds several at the end."""
        self._replace([*self._list(), *values])

    def __iter__(self) -> Iterator[T]:
        return iter(self._list())

    def __eq__(self, other: object) -> bool:
        return self._list() == (other._list() if isinstance(other, Parts) else other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(self._list())


class Settings(Strict, MutableMapping[str, Any]):
    """The settings of a scene by name: ``pass.name``, as listed by ``limpid settings``.

    ``settings["preset"] = "imai2016"`` replaces all but those of caustics and tone mapping.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def __getitem__(self, name: str) -> Any:
        try:
            return self._scene._project.get(str(name))
        except KeyError:
            raise KeyError(f"there is no setting {name!r}{nearest(str(name), list(self))}") from None

    def __setitem__(self, name: str, value: Any) -> None:
        if not isinstance(name, str):
            raise TypeError(f"the setting {name!r} is not a name; expected pass.name")
        text = value if isinstance(value, str) else value_of(name, value)
        if not re.fullmatch(r"[a-z0-9_.]+", name):
            raise SceneError(f"{name!r} is not the name of a setting; expected pass.name")
        self._scene._project.set([f"{name}={text}"])

    def __delitem__(self, name: str) -> None:
        raise TypeError("settings cannot be removed; give them another value")

    def __iter__(self) -> Iterator[str]:
        return iter(_limpid.Project.names())

    def __len__(self) -> int:
        return len(_limpid.Project.names())

    def _ipython_key_completions_(self) -> list[str]:
        return [*self, "preset"]

    def __repr__(self) -> str:
        return repr(dict(self))


def _folder() -> str:
    """The working directory, to which paths are relative."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        # It was removed; absolute paths need none.
        return ""
