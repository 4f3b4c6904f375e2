"""Image textures of surfaces beside those of Cycles."""

import math

import numpy as np
import pytest

from blender_tools import (
    aim,
    difference,
    in_cycles,
    light,
    material,
    program_picture,
    render,
    world,
)

# After the tools, which skip these tests without it.
import bpy


def picture(name, floats=False, space="sRGB"):
    """An image that differs at all its sides."""
    height, width = 32, 48
    rows, columns = np.indices((height, width))
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., 0] = 0.1 + 0.8 * (columns / width)
    pixels[..., 1] = 0.1 + 0.8 * (rows / height)
    pixels[..., 2] = ((columns // 8 + rows // 8) % 2) * 0.8
    image = bpy.data.images.new(name, width, height, float_buffer=floats)
    image.colorspace_settings.name = space
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    return image


def textured(name, image, node="ShaderNodeBsdfDiffuse"):
    """A material of an image; returns it with its texture node."""
    paint = material(name, (0.5, 0.5, 0.5), node)
    tree = paint.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    shader = next(n for n in tree.nodes if n.type not in {"TEX_IMAGE", "OUTPUT_MATERIAL"})
    socket = shader.inputs.get("Base Color") or shader.inputs["Color"]
    tree.links.new(texture.outputs["Color"], socket)
    return paint, texture


def coordinates(paint, texture, kind, output, **mapping):
    """Coordinates of a texture, from a node of this kind, after a mapping."""
    tree = paint.node_tree
    node = tree.nodes.new(kind)
    turned = tree.nodes.new("ShaderNodeMapping")
    for name, value in mapping.items():
        turned.inputs[name].default_value = value
    tree.links.new(node.outputs[output], turned.inputs["Vector"])
    tree.links.new(turned.outputs["Vector"], texture.inputs["Vector"])
    return node


def board(paint):
    """A square in the x-z plane, of 2 m, which faces the camera."""
    bpy.ops.mesh.primitive_plane_add(size=2, rotation=(math.pi / 2, 0, 0))
    thing = bpy.context.object
    thing.data.materials.append(paint)
    return thing


# Between pixels in sRGB, Cycles interpolates the bytes, and limpid the light they stand for.
IMAGES = {
    "sRGB": ({}, 0.05),
    "floats": ({"floats": True, "space": "Non-Color"}, 0.02),
    "numbers": ({"space": "Non-Color"}, 0.02),
}


@pytest.mark.parametrize(("values", "tolerance"), IMAGES.values(), ids=IMAGES.keys())
def test_an_image_lies_where_cycles_has_it(dry, tmp_path, values, tolerance):
    board(textured("paint", picture("picture", **values))[0])
    light(dry, "SUN", math.pi, rotation=(math.pi / 2, 0, 0)).data.angle = 0.0
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3]
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3]
    print(f"differs by {difference(truth, drawn):.4f}")
    assert difference(truth, drawn) < tolerance


def test_an_image_is_turned_and_repeated_as_in_cycles(dry, tmp_path):
    image = picture("picture", space="Non-Color")
    paint, texture = textured("paint", image, "ShaderNodeBsdfPrincipled")
    coordinates(
        paint, texture, "ShaderNodeTexCoord", "UV",
        Rotation=(0, 0, 0.4), Scale=(2, 3, 1), Location=(0.3, 0.1, 0),
    )
    paint.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.0
    board(paint)
    light(dry, "SUN", math.pi, rotation=(math.pi / 2, 0, 0)).data.angle = 0.0
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3]
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3]
    print(f"differs by {difference(truth, drawn):.4f}")
    assert difference(truth, drawn) < 0.04


def test_images_lie_on_curved_surfaces_and_by_named_maps(dry, tmp_path):
    paint, texture = textured("paint", picture("picture"))
    node = coordinates(paint, texture, "ShaderNodeUVMap", "UV")
    node.uv_map = "other"
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=1.2)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    ball.data.materials.append(paint)
    other = ball.data.uv_layers.new(name="other")
    places = np.empty(2 * len(ball.data.loops), np.float32)
    ball.data.uv_layers[0].uv.foreach_get("vector", places)
    other.uv.foreach_set("vector", 2.0 * places)
    ball.scale = (-1, 1, 1)
    light(dry, "SUN", 3.0, rotation=(1.2, 0.3, 0)).data.angle = 0.0
    aim(dry.camera, (2, -4, 1.5), (0, 0, 0))
    truth = in_cycles(dry, tmp_path / "cycles.exr")[..., :3]
    drawn = render(dry, tmp_path / "limpid.exr")[..., :3]
    print(f"differs by {difference(truth, drawn):.4f}")
    assert difference(truth, drawn) < 0.05
    _, program = program_picture(dry, tmp_path)
    assert difference(program, drawn) < 0.002


def test_several_images_and_colours_are_on_one_object(dry, tmp_path, capfd):
    world(dry, (0.5, 0.5, 0.5))
    thing = board(textured("left", picture("left"))[0])
    thing.data.materials.append(textured("right", picture("right"))[0])
    thing.data.materials.append(material("red", (0.9, 0.1, 0.1)))
    thing.modifiers.new("cut", "SUBSURF").subdivision_type = "SIMPLE"
    thing.modifiers["cut"].render_levels = 1
    bpy.ops.object.modifier_apply(modifier="cut")
    for number, face in enumerate(thing.data.polygons):
        face.material_index = number % 3
    pixels = render(dry, tmp_path / "parts.exr")[..., :3]
    red = np.abs(pixels - (0.45, 0.05, 0.05)).max(axis=-1) < 1e-3
    assert 0.2 < red.sum() / np.count_nonzero(pixels[..., 0] != 0.5) < 0.3
    # Without lights, a picture is as bright as the world lets it be.
    assert pixels[pixels[..., 0] != 0.5].max() < 0.5
    line = "objects with several textures, or some light, have no dry inside: Plane"
    assert line in "".join(capfd.readouterr())


@pytest.mark.parametrize("way", ["Generated", "box", "no UVs"])
def test_other_textures_are_drawn_in_their_mean_colour(dry, tmp_path, capfd, way):
    world(dry, (1, 1, 1))
    image = picture("picture", floats=True)
    paint, texture = textured("paint", image)
    thing = board(paint)
    if way == "Generated":
        coordinates(paint, texture, "ShaderNodeTexCoord", way)
    elif way == "box":
        texture.projection = "BOX"
    else:
        thing.data.uv_layers.remove(thing.data.uv_layers[0])
    pixels = render(dry, tmp_path / "mean.exr")
    values = np.array(image.pixels).reshape(-1, 4)[:, :3]
    assert np.allclose(pixels[120, 160, :3], values.mean(axis=0), rtol=1e-3)
    line = "textures that do not lie on UVs are drawn in their mean colour: Plane"
    assert line in "".join(capfd.readouterr())


def test_images_that_end_are_reported(dry, tmp_path, capfd):
    paint, texture = textured("paint", picture("picture"))
    texture.extension = "CLIP"
    board(paint)
    line = "images that end at their edge are repeated: image picture (Plane)"
    render(dry, tmp_path / "inside.png")
    assert line not in "".join(capfd.readouterr())
    coordinates(paint, texture, "ShaderNodeTexCoord", "UV", Scale=(2, 2, 2))
    render(dry, tmp_path / "outside.png")
    assert line in "".join(capfd.readouterr())
