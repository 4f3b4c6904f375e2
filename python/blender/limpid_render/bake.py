"""Pictures of worlds that limpid does not know, rendered by Cycles in a Blender of their own.

This file is also the program that runs there: a render engine cannot start another render.
"""

import contextlib
import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile

import bpy
import numpy as np

# Width of a picture in all directions, or that of the images in it if they are larger, up to a
# limit; rays for each of its pixels.
_WIDTH, _MOST, _SAMPLES = 512, 4096, 9

# The suns of skies are drawn apart, in a picture this many times as wide as they are.
_AROUND, _SUN_SIZE, _SUN_SAMPLES = 1.5, 64, 4

# The last world: what it was, and its picture and suns.
_last = (None, None)


class Failed(Exception):
    """Cycles could not draw the world."""


def baked(world, frame, wait):
    """The radiance of a world and the suns of its Sky Textures, which the radiance is without.

    Returns a picture of shape (height, width, 3), whose middle is +y of Blender's world, whose
    right is +x and whose top row is +z; and pairs of the direction towards a sun and its
    irradiance. `wait` is called now and then and may raise.
    """
    global _last
    key = _key(world)
    if _last[0] != key:
        _last = (key, _drawn(world, frame, wait))
    return _last[1]


def _drawn(world, frame, wait):
    with tempfile.TemporaryDirectory(prefix="limpid-") as folder:
        file = os.path.join(folder, "world.blend")
        bpy.data.libraries.write(file, {world.original}, path_remap="ABSOLUTE", fake_user=True)
        program = [sys.executable, __file__]
        if bpy.app.binary_path:
            options = ("--background", "--factory-startup", "--python-exit-code", "1")
            program = [bpy.app.binary_path, *options, "--python", __file__, "--"]
        with open(os.path.join(folder, "log"), "w+") as log:
            child = subprocess.Popen(
                [*program, file, world.original.name, str(frame)], stdout=log, stderr=log
            )
            try:
                while child.poll() is None:
                    wait()
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        child.wait(0.05)
            finally:
                child.kill()
                child.wait()
            log.seek(0)
            lines = log.read().split("\n")
        if child.returncode != 0:
            raise Failed(next((text for text in reversed(lines) if text), "it ended"))
        found = np.load(os.path.join(folder, "world.npz"))
        return found["picture"], list(zip(found["directions"], found["irradiances"]))


def _key(world):
    """The inputs of a world's picture, as a text."""
    described = json.dumps(_described(world.node_tree, set()), sort_keys=True)
    return hashlib.sha256(described.encode()).hexdigest()


def _described(tree, seen):
    """The nodes of a tree, their values and links."""
    if tree is None or tree.name_full in seen:
        return []
    seen = seen | {tree.name_full}
    nodes = []
    for node in tree.nodes:
        sockets = [_value(socket, "default_value") for socket in node.inputs]
        sockets += [_value(socket, "default_value") for socket in node.outputs]
        values = {
            name: _value(node, name)
            for name in node.bl_rna.properties.keys()
            if name not in {"rna_type", "location", "location_absolute", "select", "dimensions"}
        }
        inner = _described(getattr(node, "node_tree", None), seen)
        nodes.append((node.name, sockets, values, inner, _tables(node)))
    links = [
        (link.from_node.name, link.from_socket.identifier, link.to_node.name)
        + (link.to_socket.identifier, link.is_muted)
        for link in tree.links
    ]
    return [nodes, links]


def _value(data, name):
    """A property as numbers and texts, without what differs between copies of the world."""
    value = getattr(data, name, None)
    if isinstance(value, (str, int, float, bool, type(None))):
        return value
    if isinstance(value, bpy.types.Image):
        return [value.name_full, value.filepath, list(value.size), value.is_dirty]
    if isinstance(value, bpy.types.bpy_struct) or not hasattr(value, "__len__"):
        return getattr(value, "name_full", type(value).__name__)
    return [part if isinstance(part, (int, float)) else type(part).__name__ for part in value]


def _tables(node):
    """The stops of a colour ramp and the points of curves."""
    found = []
    if getattr(node, "color_ramp", None):
        ramp = node.color_ramp
        stops = [(stop.position, *stop.color) for stop in ramp.elements]
        found.append([ramp.interpolation, *stops])
    if getattr(node, "mapping", None) and hasattr(node.mapping, "curves"):
        for curve in node.mapping.curves:
            found.append([tuple(point.location) for point in curve.points])
    return found


def _main(file, name, frame):
    """Draws the world `name` of a file, into world.npz beside it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(file) as (_, wanted):
        wanted.worlds = [name]
    scene = bpy.context.scene
    scene.world = wanted.worlds[0]
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.use_persistent_data = False
    image = scene.render.image_settings
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR", "32", "NONE"
    image.color_mode = "RGB"
    scene.render.filepath = os.path.join(os.path.dirname(file), "picture.exr")
    data = bpy.data.cameras.new("camera")
    scene.camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(scene.camera)
    scene.frame_set(frame)

    suns = _take_suns(scene.world.node_tree)
    data.type = "PANO"
    # The type of the panorama moved to the camera itself.
    panorama = data if hasattr(data, "panorama_type") else data.cycles
    panorama.panorama_type = "EQUIRECTANGULAR"
    scene.camera.rotation_euler = (math.pi / 2.0, 0.0, 0.0)
    width = min(max(_WIDTH, *_widths(scene.world.node_tree), 0), _MOST)
    picture = _rendered(scene, (width, width // 2), _SAMPLES)

    directions, irradiances = [], []
    data.type = "PERSP"
    for node in suns:
        node.sun_disc = True
        direction = _direction(node)
        data.angle = 2.0 * math.atan(_AROUND * math.tan(0.5 * node.sun_size))
        scene.camera.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
        with_sun = _rendered(scene, (_SUN_SIZE, _SUN_SIZE), _SUN_SAMPLES)
        node.sun_disc = False
        added = with_sun - _rendered(scene, (_SUN_SIZE, _SUN_SIZE), _SUN_SAMPLES)
        directions.append(tuple(direction))
        irradiances.append(added.mean(axis=(0, 1)) * (2.0 * math.tan(0.5 * data.angle)) ** 2)
    np.savez(
        os.path.join(os.path.dirname(file), "world.npz"),
        picture=picture,
        directions=np.reshape(directions, (-1, 3)),
        irradiances=np.reshape(irradiances, (-1, 3)),
    )


def _widths(tree):
    """The widths of a world's images."""
    for node in tree.nodes:
        if getattr(node, "image", None):
            yield node.image.size[0]
        elif getattr(node, "node_tree", None):
            yield from _widths(node.node_tree)


def _take_suns(tree):
    """Removes the discs of suns from all Sky Textures, and returns their nodes."""
    found = []
    for node in tree.nodes:
        has_disc = node.type == "TEX_SKY" and node.sky_type not in {"PREETHAM", "HOSEK_WILKIE"}
        if has_disc and node.sun_disc:
            node.sun_disc = False
            found.append(node)
        elif getattr(node, "node_tree", None):
            found += _take_suns(node.node_tree)
    return found


def _direction(sky):
    """The direction towards the sun of a Sky Texture."""
    from mathutils import Vector

    height, around = sky.sun_elevation, sky.sun_rotation
    level = math.cos(height)
    return Vector((level * math.sin(around), level * math.cos(around), math.sin(height)))


def _rendered(scene, size, samples):
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.cycles.samples = samples
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath, check_existing=False)
    values = np.empty(size[0] * size[1] * image.channels, np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(size[1], size[0], -1)[::-1, :, :3]


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    _main(arguments[0], arguments[1], int(arguments[2]))
