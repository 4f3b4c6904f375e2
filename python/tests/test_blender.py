"""The add-on in Blender, of which the module `bpy` is a whole one without windows.

Without `bpy` these tests are skipped; with LIMPID_REQUIRE_BPY set, they fail.
"""

import importlib
import math
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import limpid

ROOT = Path(__file__).parents[2]
ADDON = ROOT / "python/blender/limpid_render"
DAM = ROOT / "sims/demo.bgeo"

if importlib.util.find_spec("bpy") is None:
    if os.environ.get("LIMPID_REQUIRE_BPY"):
        pytest.fail("LIMPID_REQUIRE_BPY is set, and there is no module bpy", pytrace=False)
    pytest.skip("there is no module bpy (pip install bpy)", allow_module_level=True)

import bpy  # noqa: E402
from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mathutils import Euler, Vector  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def addon():
    sys.path.insert(0, str(ADDON.parent))
    module = importlib.import_module(ADDON.name)
    module.register()
    yield module
    module.unregister()
    sys.path.remove(str(ADDON.parent))


@pytest.fixture
def scene(addon):
    """An empty scene with a camera that looks along +y from 5 m, drawn by limpid at 320x240."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    render = scene.render
    render.engine = "LIMPID"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 320, 240, 100
    # Blender's noise against banding is no part of the picture.
    render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Standard"
    scene.limpid.particles = str(DAM)
    scene.limpid.radius = 0.025
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    aim(camera, (0, -5, 0), (0, 0, 0))
    return scene


@pytest.fixture
def dry(scene, tmp_path):
    """The empty scene without liquid."""
    limpid.write(tmp_path / "dry.npz", np.zeros((0, 3), np.float32))
    scene.limpid.particles = str(tmp_path / "dry.npz")
    return scene


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


def test_the_program_draws_the_same_picture(scene, tmp_path):
    flood(scene)
    render(scene, tmp_path / "addon.png")
    linear = render(scene, tmp_path / "addon.exr")
    png, exr = program_picture(scene, tmp_path, DAM)
    mean, _ = limpid.flip(str(tmp_path / "addon.png"), str(png))
    print(f"FLIP {mean:.5f}, linear {difference(exr, linear[..., :3]):.5f}")
    assert mean <= 0.002
    assert difference(exr, linear[..., :3]) <= 0.002
    # The head is rounded as it is in renders, and what renders hide is not saved.
    names = sorted(path.name for path in (tmp_path / "scene_meshes").iterdir())
    assert names == ["floor.ply", "head.ply"]


def test_a_saved_scene_names_its_particles(scene, tmp_path):
    flood(scene)
    for number in (3, 4):
        shutil.copy(DAM, tmp_path / f"water_{number:04}.bgeo")
    scene.limpid.particles = str(tmp_path / "water_####.bgeo")
    scene.frame_current, scene.limpid.offset = 13, 10
    render(scene, tmp_path / "addon.png")
    png, _ = program_picture(scene, tmp_path)
    assert limpid.flip(str(tmp_path / "addon.png"), str(png))[0] <= 0.002
    particles = tomllib.loads((tmp_path / "scene.toml").read_text())["particles"]
    assert particles["source"] == "water_####.bgeo" and particles["frame"] == 3


@pytest.mark.parametrize("transform", ["Raw", "Standard", "AgX"])
def test_blender_manages_colours(scene, tmp_path, transform):
    world(scene, (0.2, 0.3, 0.4))
    scene.view_settings.view_transform = transform
    pixel = render(scene, tmp_path / "sky.png")[0, 0]
    encoded = [0.2, 0.3, 0.4] if transform == "Raw" else [0.4845, 0.5838, 0.6652]
    matches = np.allclose(pixel[:3], encoded, atol=0.003)
    assert matches == (transform != "AgX")


MARKS = {
    "red": ((1, 0, 0), (-0.9, 0.3, 0.5)),
    "green": ((0, 1, 0), (0.8, -0.4, 0.2)),
    "blue": ((0, 0, 1), (0.1, 0.9, -0.6)),
}


def landed(pixels, channel):
    """The middle of what has this colour, in pixels from the upper left corner."""
    share = np.clip(pixels[..., channel] - pixels[..., (channel + 1) % 3], 0, None)
    rows, columns = np.indices(share.shape) + 0.5
    return np.average(columns, weights=share), np.average(rows, weights=share)


def place_marks():
    for name, (color, center) in MARKS.items():
        sphere(name, center, 0.03, material(name, color, "ShaderNodeEmission"))


def marks_land(scene, pixels, offset=(0, 0)):
    """Whether limpid draws the marks where Blender's own camera sees them."""
    bpy.context.view_layer.update()
    misses = []
    for channel, (_, center) in enumerate(MARKS.values()):
        x, y, _ = world_to_camera_view(scene, scene.camera, Vector(center))
        expected = x * scene.render.resolution_x, (1 - y) * scene.render.resolution_y
        found = np.add(landed(pixels, channel), offset)
        misses.append(math.dist(expected, found))
    return max(misses)


CAMERAS = {
    "landscape": {},
    "portrait": {"size": (240, 320)},
    "vertical fit": {"sensor_fit": "VERTICAL", "sensor_height": 20},
    "horizontal fit in portrait": {"sensor_fit": "HORIZONTAL", "size": (240, 320), "lens": 30},
    "lens shift": {"shift_x": 0.12, "shift_y": -0.08},
    "shift in portrait": {"shift_x": -0.1, "shift_y": 0.15, "size": (240, 320)},
    "wide pixels": {"aspect": (1.0, 1.5)},
    "tall pixels and shift": {"aspect": (1.4, 1.0), "shift_x": 0.1},
    "orthographic": {"type": "ORTHO", "ortho_scale": 3.2},
    "orthographic shift": {"type": "ORTHO", "ortho_scale": 3.2, "shift_x": 0.1, "shift_y": -0.05},
    "orthographic portrait": {"type": "ORTHO", "ortho_scale": 3.2, "size": (240, 320)},
}


def set_camera(scene, values):
    values = dict(values)
    scene.render.resolution_x, scene.render.resolution_y = values.pop("size", (320, 240))
    aspect = values.pop("aspect", (1.0, 1.0))
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = aspect
    for name, value in values.items():
        setattr(scene.camera.data, name, value)
    aim(scene.camera, (0.7, -4.5, 1.2), (0, 0, 0))
    # The scale of a camera does not count.
    scene.camera.scale = (2, 2, 2)


@pytest.mark.parametrize("values", CAMERAS.values(), ids=CAMERAS.keys())
def test_points_land_where_blender_sees_them(dry, tmp_path, values):
    place_marks()
    set_camera(dry, values)
    pixels = render(dry, tmp_path / "marks.exr")
    miss = marks_land(dry, pixels)
    print(f"misses by {miss:.3f} pixels")
    assert miss < 0.25


def test_the_liquid_lies_where_blender_sees_its_particles(scene, tmp_path):
    dam = limpid.read(DAM).positions
    corner = dam[(dam[:, 0] > 0.3) & (dam[:, 2] > 0.5)]
    limpid.write(tmp_path / "corner.npz", corner)
    scene.limpid.particles = str(tmp_path / "corner.npz")
    scene.render.film_transparent = True
    set_camera(scene, {"shift_x": 0.05, "lens": 28})
    covered = render(scene, tmp_path / "corner.exr")[..., 3] > 0
    bpy.context.view_layer.update()
    # The file has y up.
    places = [Vector((x, -z, y)) for x, y, z in corner.tolist()]
    seen = np.array([world_to_camera_view(scene, scene.camera, place)[:2] for place in places])
    columns, rows = (seen * (1, -1) + (0, 1)).T * [[320], [240]]
    inside = covered[rows.astype(int), columns.astype(int)]
    assert inside.mean() > 0.99
    # And nowhere else: within 5 pixels, about twice the radius of a particle.
    rest = np.argwhere(covered) + 0.5
    distances = [np.hypot(rows - row, columns - column).min() for row, column in rest]
    assert max(distances) < 5


SAVED = ["orthographic", "orthographic shift", "lens shift", "wide pixels"]


@pytest.mark.parametrize("name", SAVED)
def test_the_program_has_the_same_camera(scene, tmp_path, name):
    flood(scene)
    set_camera(scene, CAMERAS[name])
    render(scene, tmp_path / "addon.png")
    png, _ = program_picture(scene, tmp_path)
    mean, _ = limpid.flip(str(tmp_path / "addon.png"), str(png))
    print(f"FLIP {mean:.5f}")
    assert mean <= 0.002


@pytest.mark.parametrize("crop", [False, True])
def test_a_border_shows_the_same_pixels(scene, tmp_path, crop):
    flood(scene)
    whole = render(scene, tmp_path / "whole.exr")
    border = scene.render
    border.use_border, border.use_crop_to_border = True, crop
    border.border_min_x, border.border_max_x = 0.25, 0.7
    border.border_min_y, border.border_max_y = 0.3, 0.9
    part = render(scene, tmp_path / "part.exr")
    rows, columns = slice(240 - 216, 240 - 72), slice(80, 224)
    assert np.array_equal(part if crop else part[rows, columns], whole[rows, columns])


def in_cycles(scene, path):
    """The picture that Cycles makes of the same scene, with direct light alone."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", 16, 0
    scene.cycles.use_denoising = False
    # limpid's pixels are means of their own area.
    scene.cycles.pixel_filter_type = "BOX"
    pixels = render(scene, path)
    scene.render.engine = "LIMPID"
    return pixels


def sky(scene, rotation=None, kind="POINT", floats=True):
    """A world whose texture differs in all directions."""
    height, width = 64, 128
    rows, columns = np.indices((height, width))
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., 0] = 0.1 + 0.8 * (columns / width)
    pixels[..., 1] = 0.1 + 0.8 * (rows / height)
    pixels[..., 2] = 0.3 + 0.2 * np.sin(0.4 * columns) * np.sin(0.3 * rows)
    image = bpy.data.images.new("sky", width, height, float_buffer=floats)
    image.pixels.foreach_set(pixels.ravel())
    background = world(scene, (0, 0, 0), 1.5)
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    if rotation is not None:
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.vector_type = kind
        mapping.inputs["Rotation"].default_value = rotation
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])


SKIES = {
    "plain": ({}, (0, 0, 0)),
    "to the side": ({}, (math.pi / 2, 0, 1.1)),
    "bytes": ({"floats": False}, (1.2, 0, -2)),
    "turned": ({"rotation": (0, 0, 1.0)}, (1.5, 0, 0.4)),
    "turned about all axes": ({"rotation": (0.4, -0.3, 1.0)}, (1.5, 0, 2.4)),
    "turned as a texture": ({"rotation": (0.4, -0.3, 1.0), "kind": "TEXTURE"}, (1.9, 0, 2.4)),
}


@pytest.mark.parametrize(("values", "turn"), SKIES.values(), ids=SKIES.keys())
def test_the_world_has_the_orientation_of_cycles(dry, tmp_path, values, turn):
    sky(dry, **values)
    dry.camera.data.lens = 18
    dry.camera.rotation_euler = Euler(turn)
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3]
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3]
    print(f"differs by {difference(truth, drawn):.4f}")
    assert difference(truth, drawn) < 0.01


LIGHTS = {
    "sun": {"kind": "SUN", "energy": 3.0, "rotation": (0.5, 0.3, 0)},
    "coloured sun": {"kind": "SUN", "energy": 2.0, "color": (1, 0.5, 0.2)},
    "lamp": {"kind": "POINT", "energy": 150.0, "location": (0.4, 0.2, 1.5)},
}


@pytest.mark.parametrize("values", LIGHTS.values(), ids=LIGHTS.keys())
def test_lights_are_as_bright_as_in_cycles(dry, tmp_path, values):
    floor(20, 0, (0.8, 0.6, 0.4))
    sphere("ball", (0.3, 0.5, 0.3), 0.3, material("ball", (0.2, 0.5, 0.7)))
    bpy.ops.object.shade_smooth()
    lamp = light(dry, **values)
    # limpid's lights are points.
    if lamp.data.type == "SUN":
        lamp.data.angle = 0.0
    else:
        lamp.data.shadow_soft_size = 0.0
    aim(dry.camera, (1, -4, 2), (0, 0, 0.3))
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3]
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3]
    print(f"differs by {difference(truth, drawn):.4f}")
    assert difference(truth, drawn) < 0.02


def test_settings_of_lights_are_those_of_cycles(dry, tmp_path):
    floor(20, 0, (0.8, 0.8, 0.8))
    aim(dry.camera, (0.01, 0, 4), (0, 0, 0))
    lamp = light(dry, "POINT", 100, location=(0, 0, 2))
    lamp.data.shadow_soft_size = 0.1
    if hasattr(lamp.data, "exposure"):
        lamp.data.exposure = 0.7
        lamp.data.use_temperature, lamp.data.temperature = True, 4000
        lamp.data.normalize = False
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3].mean(axis=(0, 1))
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3].mean(axis=(0, 1))
    assert np.allclose(truth, drawn, rtol=0.03)


def test_without_lights_solids_have_the_brightness_of_the_world(dry, tmp_path):
    floor(20, 0, (0.8, 0.6, 0.4))
    world(dry, (0.5, 0.5, 1.0), 2.0)
    aim(dry.camera, (0.01, 0, 4), (0, 0, 0))
    pixels = render(dry, tmp_path / "floor.exr")
    assert np.allclose(pixels[120, 160, :3], (0.8, 0.6, 0.8), rtol=1e-3)


def test_objects_have_several_materials(dry, tmp_path):
    world(dry, (1, 1, 1))
    cube = sphere("ball", (0, 0, 0), 1, material("left", (0.9, 0.1, 0.1)))
    cube.data.materials.append(material("right", (0.1, 0.1, 0.9)))
    cube.data.materials.append(material("light", (0.2, 3.0, 0.2), "ShaderNodeEmission"))
    for face in cube.data.polygons:
        face.material_index = 2 if face.center.z > 0.6 else int(face.center.x > 0)
    pixels = render(dry, tmp_path / "ball.exr")
    assert np.allclose(pixels[120, 140, :3], (0.9, 0.1, 0.1), atol=0.01)
    assert np.allclose(pixels[120, 180, :3], (0.1, 0.1, 0.9), atol=0.01)
    assert pixels[..., 1].max() == pytest.approx(3.0)
    _, drawn = program_picture(dry, tmp_path)
    assert difference(drawn, pixels[..., :3]) < 0.001


def test_other_surfaces_than_meshes_are_drawn(dry, tmp_path):
    world(dry, (1, 1, 1))
    paint = material("red", (0.9, 0, 0))
    bpy.ops.object.text_add(location=(-1.5, 0, 0), rotation=(math.pi / 2, 0, 0))
    bpy.context.object.data.materials.append(paint)
    bpy.context.object.data.extrude = 0.05
    bpy.ops.curve.primitive_bezier_curve_add(location=(3, 0, 3))
    original = sphere("original", (0, 0, -0.7), 0.2, paint)
    group = bpy.data.collections.new("group")
    dry.collection.children.link(group)
    dry.collection.objects.unlink(original)
    group.objects.link(original)
    copy = bpy.data.objects.new("copy", None)
    copy.instance_type, copy.instance_collection = "COLLECTION", group
    copy.location, copy.scale = (1, 0, 0), (-1, 1, 1)
    dry.collection.objects.link(copy)
    red = (render(dry, tmp_path / "text.exr")[..., 1] < 0.01).astype(float)
    assert red[90:130, 60:220].mean() > 0.1
    for x in (0, 1):
        column, row = 160 + round(x / 5 * 50 / 36 * 320), 120 + round(0.7 / 5 * 50 / 36 * 320)
        assert red[row, column] == 1.0
    program_picture(dry, tmp_path)
    names = sorted(path.name for path in (tmp_path / "scene_meshes").iterdir())
    assert names == ["Text.ply", "original.ply", "original_2.ply"]


def test_a_file_with_z_up_is_drawn_alike(scene, tmp_path):
    flood(scene)
    expected = render(scene, tmp_path / "y.exr")
    dam = limpid.read(DAM)
    turned = dam.positions[:, [0, 2, 1]] * np.float32([1, -1, 1])
    limpid.write(tmp_path / "z.npz", turned, ids=dam.ids)
    scene.limpid.particles, scene.limpid.up = str(tmp_path / "z.npz"), "Z"
    drawn = render(scene, tmp_path / "z.exr")
    assert difference(expected, drawn) < 0.002
    _, program = program_picture(scene, tmp_path)
    assert difference(program, drawn[..., :3]) < 0.002


def test_a_transparent_film_is_covered_by_liquid_and_solids(scene, tmp_path):
    flood(scene)
    bpy.data.objects["floor"].hide_render = True
    scene.render.film_transparent = True
    pixels = render(scene, tmp_path / "film.exr")
    assert pixels[5, 5].tolist() == [0, 0, 0, 0]
    assert pixels[150, 160, 3] == 1.0
    assert 0.2 < pixels[..., 3].mean() < 0.8


def test_a_tint_is_a_colour_or_an_absorption(scene, tmp_path):
    flood(scene)
    scene.limpid.absorption = (0.5, 1.0, 2.0)
    absorbed = render(scene, tmp_path / "absorption.exr")
    scene.limpid.tint = "COLOR"
    scene.limpid.color = np.exp([-0.5, -1.0, -2.0])
    assert difference(absorbed, render(scene, tmp_path / "color.exr")) < 1e-3


PATTERNS = ["w_####.npz", "w_{}.npz", "w_%04d.npz", "w_$F4.npz", "w_$F.npz"]


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_sequence_follows_the_frames(scene, tmp_path, pattern):
    for number in (1, 2):
        positions = np.float32([[0.1 * number, 0, 0]])
        limpid.write(tmp_path / f"w_{number:04}.npz", positions)
    scene.limpid.particles = str(tmp_path / pattern)
    scene.limpid.offset = 10
    scene.frame_current = 12
    from limpid_render import particles

    assert particles.file_of_frame(scene.limpid, 12) == str(tmp_path / "w_0002.npz")
    with pytest.raises(RuntimeError, match=r"frame 3 is missing in .*: there are 1 to 2"):
        scene.frame_current = 13
        render(scene, tmp_path / "missing.png")


def test_the_radius_of_a_sequence_is_that_of_its_first_file(scene, tmp_path, monkeypatch):
    flood(scene)
    dam = limpid.read(DAM)
    limpid.write(tmp_path / "w_1.npz", dam.positions)
    limpid.write(tmp_path / "w_2.npz", 1.5 * dam.positions)
    scene.limpid.particles, scene.limpid.radius = str(tmp_path / "w_{}.npz"), 0.0
    radii = []
    draw = limpid.Renderer.render

    def recorded(*arguments, **options):
        picture = draw(*arguments, **options)
        radii.append(picture.radius)
        return picture

    monkeypatch.setattr(limpid.Renderer, "render", recorded)
    for scene.frame_current in (2, 1):
        render(scene, tmp_path / "w.png")
    print(radii)
    # The first is that of the estimate.
    assert len(radii) == 3 and radii[1] == radii[0] == radii[2]


def errors_of(capfd, scene, action):
    """What an action that fails reports: one line, and no traceback."""
    with pytest.raises(RuntimeError) as failed:
        action()
    printed = "".join(capfd.readouterr())
    assert "Traceback" not in printed + str(failed.value)
    lines = str(failed.value).strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("Error: ")
    return lines[0]


PROBLEMS = {
    "": "no particles: choose a particle file",
    "none.bgeo": "there is no particle file .*none.bgeo",
    "none_####.bgeo": "no particle file matches .*none_####.bgeo",
    "away/none_####.bgeo": "cannot list .*away: No such file",
    "broken.bgeo": "broken.bgeo",
}


@pytest.mark.parametrize("file", PROBLEMS)
def test_a_file_that_cannot_be_read_is_reported(scene, tmp_path, capfd, file):
    (tmp_path / "broken.bgeo").write_bytes(b"no particles")
    scene.limpid.particles = file and str(tmp_path / file)
    picture = tmp_path / "picture.png"
    line = errors_of(capfd, scene, lambda: render(scene, picture))
    assert re.search(PROBLEMS[file], line), line
    assert not picture.exists()


def test_cameras_that_limpid_lacks_are_reported(scene, tmp_path, capfd):
    scene.camera.data.type = "PANO"
    line = errors_of(capfd, scene, lambda: render(scene, tmp_path / "picture.png"))
    assert "the camera camera is neither perspective nor orthographic" in line


def test_a_scene_that_cannot_be_saved_is_reported(scene, tmp_path, capfd):
    flood(scene)
    path = str(tmp_path / "away/scene.toml")
    (tmp_path / "away").write_text("a file where a folder is needed")
    errors_of(capfd, scene, lambda: bpy.ops.limpid.save_scene(filepath=path))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["away"]
    # The next render draws again.
    render(scene, tmp_path / "picture.png")


def test_what_is_left_out_is_reported(scene, tmp_path, capfd):
    flood(scene)
    light(scene, "AREA", 10).name = "panel"
    render(scene, tmp_path / "picture.png")
    assert "panel: left out, limpid has suns and point lights" in "".join(capfd.readouterr())


def test_blender_without_limpid_says_so(scene, tmp_path, capfd, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("limpid_render.")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("translate", "save"):
        monkeypatch.delattr(sys.modules["limpid_render"], name, raising=False)
    monkeypatch.setitem(sys.modules, "limpid", None)
    line = errors_of(capfd, scene, lambda: render(scene, tmp_path / "picture.png"))
    assert "Blender's Python has no module limpid" in line


class Layout:
    """A layout that knows whether what a panel shows is there."""

    def __init__(self):
        self.shown = []

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties
        self.shown.append(name)

    def operator(self, name):
        module, operator = name.split(".")
        getattr(getattr(bpy.ops, module), operator).get_rna_type()
        self.shown.append(name)

    def label(self, **_):
        raise AssertionError("limpid is there")


def test_the_panels_show_all_settings(scene, addon):
    shown = []
    for scene.limpid.tint in ("ABSORPTION", "COLOR"):
        for kind in addon.panel.CLASSES:
            drawn = SimpleNamespace(layout=Layout())
            kind.draw(drawn, SimpleNamespace(scene=scene))
            shown += drawn.layout.shown
    settings = set(addon.LimpidSettings.bl_rna.properties.keys()) - {"rna_type", "name"}
    assert settings | {"film_transparent", "limpid.save_scene"} == set(shown)


def test_blender_shows_its_own_panels_too(addon):
    names = ("RENDER_PT_format", "DATA_PT_lens", "DATA_PT_EEVEE_light", "EEVEE_MATERIAL_PT_surface")
    panels = [getattr(bpy.types, name) for name in names]
    assert all("LIMPID" in panel.COMPAT_ENGINES for panel in panels)
    addon.unregister()
    try:
        assert not any("LIMPID" in panel.COMPAT_ENGINES for panel in panels)
        assert not hasattr(bpy.types.Scene, "limpid")
    finally:
        addon.register()


def test_the_manifest_is_that_of_an_extension(addon):
    manifest = tomllib.loads((ADDON / "blender_manifest.toml").read_text())
    assert tuple(map(int, manifest["version"].split("."))) == addon.bl_info["version"]
    assert manifest["version"] == limpid.__version__
    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    tool = scripts / "addons_core/bl_pkg/cli/blender_ext.py"
    command = [sys.executable, tool, "validate", ADDON]
    checked = subprocess.run(command, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr


INSTALLED = """
import bpy, sys
kind, archive, particles, picture = sys.argv[1:]
if kind == "extension":
    bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True)
else:
    bpy.ops.preferences.addon_install(filepath=archive)
    bpy.ops.preferences.addon_enable(module="limpid_render")
scene = bpy.context.scene
scene.render.engine = "LIMPID"
scene.limpid.particles = particles
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.filepath = picture
bpy.ops.render.render(write_still=True)
"""


@pytest.mark.parametrize("kind", ["extension", "add-on"])
def test_the_zip_installs(tmp_path, kind):
    archive = shutil.make_archive(str(tmp_path / "limpid_render"), "zip", ADDON.parent, ADDON.name)
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    picture = tmp_path / "picture.png"
    done = subprocess.run(
        [sys.executable, "-c", INSTALLED, kind, archive, str(DAM), str(picture)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert picture.exists()
