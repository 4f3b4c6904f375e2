"""From Blender's scene to that of limpid. The report tells what limpid has no counterpart for."""

from dataclasses import dataclass

import limpid
import numpy as np

from .axes import Y_UP
from .errors import Problem
from .lights import light_of, strongest
from .omissions import say_of_object, say_of_scene
from .source import is_source
from .surfaces import Shape, shapes_of, solid_of
from .world import Map, world_light


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


def translate(depsgraph, camera, size, wait, report):
    """Translates an evaluated scene, seen by the object `camera` in a picture of `size` pixels.

    What takes long calls `wait` now and then, which may raise.
    """
    seen = camera_at(depsgraph, camera, size)
    say_of_scene(depsgraph, camera.evaluated_get(depsgraph), report)
    lights, shapes, pictures = [], [], {}
    for instance in depsgraph.object_instances:
        thing = instance.object
        if not instance.show_self or is_source(instance, depsgraph.scene.limpid):
            continue
        say_of_object(thing, report)
        if thing.type == "LIGHT":
            lights.append((thing.name, light_of(instance, report)))
        elif thing.type == "MESH":
            # Blender gives the surfaces of curves, texts and metaballs as instances of meshes too.
            shapes += shapes_of(instance, pictures, report)
    scene = depsgraph.scene
    # The scene has the world without its animation.
    world = scene.world and scene.world.evaluated_get(depsgraph)
    environment, suns = world_light(world, scene.frame_current, wait, report)
    lights += [(f"of {world.name}", sun) for sun in suns]
    for shape in shapes:
        shape.lit = bool(lights) and not shape.emits
        if not lights and not shape.emits:
            # limpid's unlit solids emit their colour. Under the light of the world alone, they send
            # on what a white surface would receive on average, as limpid's lit ones do.
            shape.dim(_mean(environment))
        if shape.picture is not None and shape.picture.max() > 1.0:
            report.add("colours of textures and of several materials end at 1", shape.name)
    return Translation(seen, strongest(lights, report), environment, shapes)


def scene_of(translation, settings, solids=None):
    """The scene of limpid, with its own solids or these."""
    if solids is None:
        solids = [solid_of(shape) for shape in translation.shapes]
    liquid = {"absorption": tuple(settings.absorption)}
    if settings.tint == "COLOR":
        liquid = {"color": tuple(settings.color)}
    pictures = [shape.picture for shape in translation.shapes if shape.picture is not None]
    # Those of several rows are images; they are averaged over the pixels.
    has_images = any(len(picture) > 1 for picture in pictures)
    environment = translation.environment
    if isinstance(environment, Map):
        environment = environment.pixels
    return limpid.Scene(
        look=None,
        ior=settings.ior,
        **liquid,
        solids=solids,
        lights=translation.lights,
        environment=environment,
        settings={"refract.samples": settings.samples, "refract.filter_patterns": has_images},
    )


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


def _mean(environment):
    if isinstance(environment, Map):
        return environment.mean()
    return np.array(environment)
