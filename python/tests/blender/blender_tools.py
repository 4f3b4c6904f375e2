"""The add-on in Blender, of which the module `bpy` is a whole one without windows.

Without `bpy` the tests that import this are skipped; with LIMPID_REQUIRE_BPY set, they fail.
"""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
ADDON = ROOT / "python/blender/limpid_render"
DAM = ROOT / "sims/demo.bgeo"

if importlib.util.find_spec("bpy") is None:
    if os.environ.get("LIMPID_REQUIRE_BPY"):
        pytest.fail("LIMPID_REQUIRE_BPY is set, and there is no module bpy", pytrace=False)
    pytest.skip("there is no module bpy (pip install bpy)", allow_module_level=True)

import bpy  # noqa: E402
from mathutils import Vector  # noqa: E402


def aim(camera, eye, target):
    camera.location = eye
    towards = Vector(target) - Vector(eye)
    camera.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()


def material(name, color, node="ShaderNodeBsdfDiffuse"):
    made = bpy.data.materials.new(name)
    # Blender 5 always has nodes.
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(node)
    socket = shader.inputs.get("Base Color") or shader.inputs["Color"]
    socket.default_value = (*color, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def world(scene, color, strength=1.0):
    """A world of one colour; returns its Background node."""
    scene.world = bpy.data.worlds.new("world")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    return background


def light(scene, kind, energy, location=(0, 0, 0), rotation=(0, 0, 0), color=(1, 1, 1)):
    data = bpy.data.lights.new(kind.lower(), kind)
    data.energy, data.color = energy, color
    thing = bpy.data.objects.new(kind.lower(), data)
    thing.location, thing.rotation_euler = location, rotation
    scene.collection.objects.link(thing)
    return thing


def sphere(name, center, radius, paint):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=radius, location=center)
    ball = bpy.context.object
    ball.name = name
    ball.data.materials.append(paint)
    return ball


def floor(size, height, color):
    bpy.ops.mesh.primitive_plane_add(size=size, location=(0, 0, height))
    ground = bpy.context.object
    ground.name = "floor"
    ground.data.materials.append(material("floor", color))
    return ground


def flood(scene):
    """The dam, a head in its way, ground and sun; some of it is only in renders."""
    bpy.ops.mesh.primitive_monkey_add(size=0.7, location=(0.35, -0.1, 0.3), rotation=(0, 0, 0.5))
    head = bpy.context.object
    head.name = "head"
    head.data.materials.append(material("head", (0.8, 0.2, 0.1), "ShaderNodeBsdfPrincipled"))
    bpy.ops.object.shade_smooth()
    rounded = head.modifiers.new("rounded", "SUBSURF")
    rounded.levels, rounded.render_levels = 0, 2
    floor(8, -0.05, (0.6, 0.55, 0.5))
    hidden = sphere("hidden", (0, 0, 1), 0.5, material("hidden", (1, 1, 1)))
    hidden.hide_render = True
    light(scene, "SUN", 3.0, rotation=(0.6, 0.3, 0))
    world(scene, (0.35, 0.5, 0.8), 0.8)
    scene.camera.data.lens = 40
    aim(scene.camera, (0.9, -3.1, 1.5), (0.05, -0.2, 0.12))


def render(scene, path):
    """Renders into a file: linear for .exr."""
    path = Path(path)
    settings = scene.render.image_settings
    if path.suffix == ".exr":
        settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    else:
        settings.file_format, settings.color_depth = "PNG", "8"
    settings.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return read(path)


def read(path):
    """The pixels of a picture, rows from the top; linear of .exr."""
    image = bpy.data.images.load(str(path), check_existing=False)
    values = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(values)
    pixels = values.reshape(image.size[1], image.size[0], image.channels)[::-1]
    bpy.data.images.remove(image)
    return pixels


def in_cycles(scene, path, samples=16):
    """The picture that Cycles makes of the same scene, with direct light alone."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", samples, 0
    scene.cycles.use_denoising = False
    # limpid's pixels are means of their own area.
    scene.cycles.pixel_filter_type = "BOX"
    pixels = render(scene, path)
    scene.render.engine = "LIMPID"
    return pixels


def render_passes(scene, path):
    """Renders; returns the passes of the view layer by name, of shape (height, width, channels)."""
    settings = scene.render.image_settings
    before = settings.file_format
    if bpy.app.version >= (5, 0):
        settings.media_type = "MULTI_LAYER_IMAGE"
        settings.use_exr_interleave = True
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "32", "NONE"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    if bpy.app.version >= (5, 0):
        settings.media_type = "IMAGE"
    settings.file_format = before
    return exr_passes(Path(path).read_bytes())


def exr_passes(data):
    """The passes of an uncompressed multi-layer EXR file of 32-bit floats."""
    at, attributes = 8, {}
    while data[at]:
        name, kind, rest = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        size = int.from_bytes(data[at : at + 4], "little")
        attributes[name.decode()] = data[at + 4 : at + 4 + size]
        at += 4 + size
    channels, rest = [], attributes["channels"]
    while rest[0]:
        name, rest = rest.split(b"\0", 1)
        assert rest[0] == 2, "expected 32-bit floats"
        channels.append(name.decode())
        rest = rest[16:]
    left, top, right, bottom = np.frombuffer(attributes["dataWindow"], "<i4")
    width, height = right - left + 1, bottom - top + 1
    # After the table of offsets, each row has its number, its size and its channels.
    row = np.dtype([("y", "<i4"), ("size", "<i4"), ("values", "<f4", (len(channels), width))])
    rows = np.frombuffer(data, row, height, at + 1 + 8 * height)["values"]
    passes = {}
    for name in dict.fromkeys(channel.rsplit(".", 1)[0] for channel in channels):
        own = [channel for channel in channels if channel.rsplit(".", 1)[0] == name]
        own.sort(key=lambda channel: "XYZWRGBAV".index(channel[-1]) % 8)
        image = np.stack([rows[:, channels.index(channel)] for channel in own], axis=-1)
        passes[name.split(".", 1)[-1]] = image
    return passes


def program(*arguments):
    """Runs the program `limpid` of this environment."""
    path = Path(sys.executable).with_name("limpid")
    done = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stderr


def program_picture(scene, folder, particles=None):
    """Saves the scene, and draws it by the program, as .png and as linear .exr."""
    file = folder / "scene.toml"
    assert bpy.ops.limpid.save_scene(filepath=str(file)) == {"FINISHED"}
    size = f"{scene.render.resolution_x}x{scene.render.resolution_y}"
    given = [file] if particles is None else [particles, "--scene", file]
    for name in ("program.png", "program.exr"):
        program("render", *given, "--size", size, "-o", folder / name)
    return folder / "program.png", read(folder / "program.exr")[..., :3]


def difference(a, b):
    """Mean difference of two linear pictures, as a share of the mean of the first."""
    return float(np.abs(a - b).mean() / a.mean())
