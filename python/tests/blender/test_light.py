"""World, lights, materials and surfaces of the add-on beside those of Cycles."""

import math

import numpy as np
import pytest

import limpid

from blender_tools import (
    DAM,
    aim,
    difference,
    flood,
    floor,
    in_cycles,
    light,
    material,
    program_picture,
    render,
    sphere,
    world,
)

# After the tools, which skip these tests without it.
import bpy
from mathutils import Euler


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


SPREADS = {
    "square": {"shape": "SQUARE", "size": 0.2},
    "rectangle": {"shape": "RECTANGLE", "size": 0.2, "size_y": 0.1},
    "disk": {"shape": "DISK", "size": 0.2},
    "spread": {"shape": "ELLIPSE", "size": 0.01, "size_y": 0.02, "spread": 1.2},
    "of each square metre": {"shape": "DISK", "size": 0.2, "normalize": False},
}


@pytest.mark.parametrize("values", SPREADS.values(), ids=SPREADS.keys())
def test_area_lights_are_as_bright_ahead_as_in_cycles(dry, tmp_path, values):
    floor(20, 0, (0.8, 0.8, 0.8))
    aim(dry.camera, (0.01, 0, 8), (0, 0, 0))
    dry.camera.data.type, dry.camera.data.ortho_scale = "ORTHO", 0.05
    lamp = light(dry, "AREA", 100, location=(0, 0, 2))
    lamp.scale = (2, 1, 1)
    for name, value in values.items():
        if hasattr(lamp.data, name):
            setattr(lamp.data, name, value)
    # From above the light, which only shines down.
    truth = in_cycles(dry, tmp_path / "cycles.exr", samples=64)[..., :3].mean(axis=(0, 1))
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3].mean(axis=(0, 1))
    print(truth, drawn)
    assert np.allclose(truth, drawn, rtol=0.04)


def test_spot_lights_are_as_bright_ahead_as_in_cycles(dry, tmp_path):
    floor(20, 0, (0.8, 0.8, 0.8))
    aim(dry.camera, (0.01, 0, 8), (0, 0, 0))
    dry.camera.data.type, dry.camera.data.ortho_scale = "ORTHO", 0.05
    lamp = light(dry, "SPOT", 100, location=(0, 0, 2))
    lamp.data.shadow_soft_size = 0.0
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3].mean(axis=(0, 1))
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3].mean(axis=(0, 1))
    print(truth, drawn)
    assert np.allclose(truth, drawn, rtol=0.02)


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


def sky_texture(scene):
    """A world of a Sky Texture, behind a node that limpid does not know."""
    background = world(scene, (0, 0, 0), 0.1)
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexSky")
    texture.sun_elevation, texture.sun_rotation, texture.sun_size = 0.7, 1.0, 0.1
    curves = tree.nodes.new("ShaderNodeHueSaturation")
    curves.inputs["Saturation"].default_value = 0.8
    tree.links.new(texture.outputs["Color"], curves.inputs["Color"])
    tree.links.new(curves.outputs["Color"], background.inputs["Color"])
    return texture


def test_a_sky_texture_is_that_of_cycles(dry, tmp_path):
    texture = sky_texture(dry)
    texture.sun_disc = False
    dry.camera.data.lens = 18
    for turn in ((1.7, 0, 0.4), (2.2, 0, -2.0)):
        dry.camera.rotation_euler = Euler(turn)
        truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3]
        drawn = render(dry, tmp_path / "limpid.exr")[..., :3]
        print(f"differs by {difference(truth, drawn):.4f}")
        assert difference(truth, drawn) < 0.02
    _, program = program_picture(dry, tmp_path)
    assert difference(program, drawn) < 0.002


def test_the_sun_of_a_sky_texture_lights_the_scene(dry, tmp_path, capfd):
    sky_texture(dry)
    floor(20, 0, (0.8, 0.6, 0.4))
    sphere("ball", (0.3, 0.5, 0.5), 0.3, material("ball", (0.2, 0.5, 0.7)))
    aim(dry.camera, (0, -4, 6), (0, 0, 0))
    dry.render.resolution_x, dry.render.resolution_y = 160, 120
    sunny = render(dry, tmp_path / "sunny.exr")[..., :3]
    assert "the sun of the sky lights the scene" in "".join(capfd.readouterr())
    with_sun = in_cycles(dry, tmp_path / "cycles.exr", samples=64)[..., :3]
    texture = next(n for n in dry.world.node_tree.nodes if n.type == "TEX_SKY")
    texture.sun_disc = False
    without = in_cycles(dry, tmp_path / "without.exr", samples=64)[..., :3]
    # The sky's own light differs: in limpid it is the same for all surfaces.
    sky = render(dry, tmp_path / "cloudy.exr")[..., :3]
    share = difference(with_sun - without, sunny - sky)
    print(f"differs by {share:.4f}")
    assert share < 0.03


def test_a_world_that_cannot_be_drawn_is_grey(dry, tmp_path, capfd, monkeypatch):
    from limpid_render import bake

    sky_texture(dry)
    monkeypatch.setattr(bake, "_last", (None, None))
    monkeypatch.setattr(bake, "__file__", str(tmp_path / "none.py"))
    pixels = render(dry, tmp_path / "grey.exr")
    assert np.allclose(pixels[..., :3], 0.5)
    assert "drawn grey, as Cycles could not draw the world" in "".join(capfd.readouterr())


def test_a_world_is_drawn_once_until_it_changes(dry, tmp_path, monkeypatch):
    from limpid_render import bake

    texture = sky_texture(dry)
    drawn = []

    def fake(*arguments):
        drawn.append(arguments)
        return np.ones((8, 16, 3), np.float32), []

    monkeypatch.setattr(bake, "_drawn", fake)
    monkeypatch.setattr(bake, "_last", (None, None))
    dry.frame_start, dry.frame_end = 1, 3
    dry.render.filepath = str(tmp_path / "w")
    bpy.ops.render.render(animation=True)
    assert len(drawn) == 1
    texture.altitude += 100.0
    bpy.ops.render.render()
    bpy.ops.render.render()
    assert len(drawn) == 2
    texture.keyframe_insert("altitude", frame=1)
    texture.altitude += 100.0
    texture.keyframe_insert("altitude", frame=3)
    bpy.ops.render.render(animation=True)
    # The first frame is as the last picture was.
    assert len(drawn) == 4


def test_a_render_stops_while_cycles_draws_the_world(dry, addon, monkeypatch):
    from limpid_render import bake

    sky_texture(dry)
    children = []
    popen = bake.subprocess.Popen

    def recorded(*arguments, **options):
        children.append(popen(*arguments, **options))
        return children[-1]

    monkeypatch.setattr(bake, "_last", (None, None))
    monkeypatch.setattr(bake.subprocess, "Popen", recorded)
    monkeypatch.setattr(addon.engine.LimpidEngine, "_watch", lambda *_: bool(children))
    bpy.ops.render.render()
    assert len(children) == 1 and children[0].returncode not in (None, 0)


def test_colours_are_animated(dry, tmp_path):
    background = world(dry, (0.2, 0.2, 0.2))
    ball = sphere("ball", (0, 0, 0), 1, material("ball", (1, 1, 1), "ShaderNodeEmission"))
    shader = ball.material_slots[0].material.node_tree.nodes["Emission"]
    for frame, value in ((1, 0.25), (3, 0.75)):
        for socket in (background.inputs["Strength"], shader.inputs["Strength"]):
            socket.default_value = value
            socket.keyframe_insert("default_value", frame=frame)
    for frame, value in ((1, 0.25), (2, 0.5), (3, 0.75)):
        dry.frame_set(frame)
        pixels = render(dry, tmp_path / "frame.exr")
        assert np.allclose(pixels[0, 0, :3], 0.2 * value, rtol=0.01)
        assert np.allclose(pixels[120, 160, :3], value, rtol=0.01)
