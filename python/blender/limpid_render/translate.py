"""From Blender's scene to that of limpid. The report tells what limpid has no counterpart for."""

from dataclasses import dataclass

import limpid
import numpy as np

from .axes import Y_UP
from .errors import Problem
from .lights import light_of, strongest
from .omissions import say_of_object, say_of_scene
from .shading import look_of
from .source import is_source
from .world import Map, world_light


@dataclass
class Shape:
    """The surface of an object in limpid's world."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    smooth: bool
    lit: bool
    # One colour, or one for each vertex if the faces have several materials.
    colors: np.ndarray
    color_of: np.ndarray | None


@dataclass
class Camera:
    """A camera by its matrices, as Blender and OpenGL have them: depth from -1 to 1."""

    view: np.ndarray
    projection: np.ndarray
    size: tuple[int, int]


@dataclass
class Translation:
    """Scene that limpid draws beside the particles."""

    camera: Camera
    lights: list
    environment: tuple[float, float, float] | Map
    shapes: list[Shape]


def translate(depsgraph, camera, size, report):
    """Translates an evaluated scene, seen by the object `camera` in a picture of `size` pixels."""
    seen = camera_at(depsgraph, camera, size)
    say_of_scene(depsgraph, camera, report)
    lights, found = [], []
    for instance in depsgraph.object_instances:
        thing = instance.object
        if not instance.show_self or is_source(instance, depsgraph.scene.limpid):
            continue
        say_of_object(thing, report)
        if thing.type == "LIGHT":
            lights.append((thing.name, light_of(instance, report)))
        elif thing.type == "MESH":
            # Blender gives the surfaces of curves, texts and metaballs as instances of meshes too.
            found += _shapes(instance, report)
    environment = world_light(depsgraph.scene.world, report)
    for shape, emits in found:
        shape.lit = bool(lights) and not emits
        if not lights and not emits:
            # limpid's unlit solids emit their colour. Under the light of the world alone, they send
            # on what a white surface would receive on average, as limpid's lit ones do.
            shape.colors = shape.colors * _mean(environment)
        if shape.color_of is not None and shape.colors.max() > 1.0:
            report.add("colours end at 1, as the object has several materials", shape.name)
    shapes = [shape for shape, _ in found]
    return Translation(seen, strongest(lights, report), environment, shapes)


def scene_of(translation, settings, solids=None):
    """The scene of limpid, with its own solids or these."""
    if solids is None:
        solids = [solid_of(shape) for shape in translation.shapes]
    liquid = {"absorption": tuple(settings.absorption)}
    if settings.tint == "COLOR":
        liquid = {"color": tuple(settings.color)}
    environment = translation.environment
    if isinstance(environment, Map):
        environment = environment.pixels
    return limpid.Scene(
        ior=settings.ior,
        **liquid,
        solids=solids,
        lights=translation.lights,
        environment=environment,
        settings={"refract.samples": settings.samples},
    )


def solid_of(shape):
    """A solid of limpid that is in memory."""
    look = {"color": tuple(shape.colors[0])}
    if shape.color_of is not None:
        look = {"texture": palette(shape), "coordinates": palette_coordinates(shape)}
    return limpid.Mesh(
        vertices=shape.vertices,
        faces=shape.faces,
        normals="smooth" if shape.smooth else "flat",
        lit=shape.lit,
        **look,
    )


def palette(shape):
    """The colours of a shape as a picture of one row, sRGB."""
    linear = np.clip(shape.colors, 0.0, 1.0)
    encoded = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055
    )
    return np.round(255.0 * encoded).astype(np.uint8)[None]


def palette_coordinates(shape):
    """For each vertex the middle of its colour in the palette."""
    across = (shape.color_of + 0.5) / len(shape.colors)
    return np.stack([across, np.full_like(across, 0.5)], axis=1)


def camera_at(depsgraph, camera, size):
    """The object `camera` at the frame of the depsgraph, for a picture of `size` pixels."""
    if camera is None:
        raise Problem("the scene has no camera")
    camera = camera.evaluated_get(depsgraph)
    if camera.type != "CAMERA" or camera.data.type not in {"PERSP", "ORTHO"}:
        raise Problem(f"the camera {camera.name} is neither perspective nor orthographic")
    render = depsgraph.scene.render
    projection = camera.calc_matrix_camera(
        depsgraph,
        x=size[0],
        y=size[1],
        scale_x=render.pixel_aspect_x,
        scale_y=render.pixel_aspect_y,
    )
    # A camera's scale does not count.
    place, turn, _ = camera.matrix_world.decompose()
    rotation = Y_UP @ np.array(turn.to_matrix())
    view = np.eye(4)
    view[:3, :3] = rotation.T
    view[:3, 3] = -rotation.T @ (Y_UP @ np.array(place))
    return Camera(view, np.array(projection), size)


def camera_of(camera):
    """The camera of limpid."""
    return limpid.Camera.from_matrices(camera.view, camera.projection, opengl=True)


def _shapes(instance, report):
    """The surface of an object and whether its colours are light: two parts if only some are."""
    thing = instance.object
    mesh = thing.data
    if len(mesh.polygons) == 0:
        return []
    mesh.calc_loop_triangles()
    vertices = _read(mesh.vertices, "co", 3, np.float32).astype(np.float64)
    faces = _read(mesh.loop_triangles, "vertices", 3, np.int32)
    slots = _read(mesh.loop_triangles, "material_index", 1, np.int32)[:, 0]
    smooth = _read(mesh.polygons, "use_smooth", 1, bool).mean() >= 0.5
    matrix = np.array(instance.matrix_world)
    materials = [slot.material for slot in thing.material_slots] or list(mesh.materials) or [None]

    vertices = (vertices @ matrix[:3, :3].T + matrix[:3, 3]) @ Y_UP.T
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        # A mirrored mesh would be inside out.
        faces = faces[:, ::-1]
    slots = np.clip(slots, 0, len(materials) - 1)
    looks = [look_of(material, thing.name, report) for material in materials]
    emits = np.array([look.emits for look in looks])
    colors = np.array([look.color for look in looks])
    parts = []
    for part in np.unique(emits[slots]):
        chosen = emits[slots] == part
        shape = _part(thing.name, vertices, faces[chosen], slots[chosen], colors, bool(smooth))
        parts.append((shape, bool(part)))
    return parts


def _part(name, vertices, faces, slots, colors, smooth):
    """A shape of some faces, whose materials are in `slots`."""
    used, color_of_face = np.unique(slots, return_inverse=True)
    colors = colors[used]
    color_of = None
    if len(used) > 1:
        # A vertex between two materials becomes two, one of each colour.
        corner = faces.astype(np.int64) * len(used) + color_of_face.reshape(-1, 1)
        kept, faces = np.unique(corner, return_inverse=True)
        faces = faces.reshape(-1, 3)
        vertices, color_of = vertices[kept // len(used)], kept % len(used)
    return Shape(name, vertices, faces, smooth, False, colors, color_of)


def _mean(environment):
    if isinstance(environment, Map):
        return environment.mean()
    return np.array(environment)


def _read(collection, name, width, dtype):
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, values)
    return values.reshape(-1, width)
