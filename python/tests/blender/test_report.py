"""The report of what limpid draws otherwise than Blender."""

import re

import pytest

from blender_tools import flood, light, material, render, sphere

# After the tools, which skip these tests without it.
import bpy


def said(capfd, scene, path, **options):
    """Reports of a render, without what Blender itself prints."""
    capfd.readouterr()
    if options:
        scene.render.filepath = str(path)
        bpy.ops.render.render(**options)
    else:
        render(scene, path)
    return "".join(capfd.readouterr())


def principled(name, **values):
    """A material of a Principled BSDF with these inputs, on a ball."""
    paint = material(name, (0.5, 0.5, 0.5), "ShaderNodeBsdfPrincipled")
    for key, value in values.items():
        node = paint.node_tree.nodes["Principled BSDF"]
        node.inputs[key.replace("_", " ")].default_value = value
    return sphere(f"{name} ball", (0, 0, 0), 0.1, paint)


def soft_lamp(scene):
    light(scene, "SPOT", 10).data.shadow_soft_size = 0.5


def noise(_):
    paint = principled("noise").material_slots[0].material
    texture = paint.node_tree.nodes.new("ShaderNodeTexNoise")
    shader = paint.node_tree.nodes["Principled BSDF"]
    paint.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    paint.node_tree.links.new(texture.outputs["Color"], shader.inputs["Normal"])


def hidden(_):
    principled("hidden").visible_camera = False


def depth_of_field(scene):
    scene.camera.data.dof.use_dof = True


def motion_blur(scene):
    scene.render.use_motion_blur = True


def override(_):
    bpy.context.view_layer.material_override = material("clay", (1, 1, 1))


def catcher(_):
    principled("catcher").is_shadow_catcher = True


def bare(name, node):
    return lambda _: sphere(f"{name} ball", (0, 0, 0), 0.1, material(name, (1, 1, 1), node))


OMISSIONS = {
    "glass": (
        lambda _: principled("ice", Transmission_Weight=1.0),
        "glass is drawn opaque: material ice (ice ball)",
    ),
    "glass alone": (
        bare("cup", "ShaderNodeBsdfGlass"),
        "glass is drawn opaque: material cup (cup ball)",
    ),
    "metal": (
        lambda _: principled("tin", Metallic=1.0),
        "metal and gloss are drawn matt: material tin (tin ball)",
    ),
    "gloss": (
        lambda _: principled("wax", Roughness=0.05),
        "metal and gloss are drawn matt: material wax (wax ball)",
    ),
    "alpha": (
        lambda _: principled("veil", Alpha=0.5),
        "transparency is drawn opaque: material veil (veil ball)",
    ),
    "glowing colour": (
        lambda _: principled("lamp", Emission_Strength=2.0),
        "light of surfaces that also have a colour is left out: material lamp (lamp ball)",
    ),
    "textures": (
        noise,
        "drawn in the viewport colour, as limpid does not know the node Noise Texture: "
        "material noise (noise ball)",
    ),
    "bumps": (
        noise,
        "displacement and bumps are left out: material noise (noise ball)",
    ),
    "hidden from rays": (
        hidden,
        "objects that are hidden from some rays are drawn for all: hidden ball",
    ),
    "depth of field": (
        depth_of_field,
        "all is drawn sharp, without depth of field: camera camera",
    ),
    "motion blur": (motion_blur, "all is drawn without motion blur: scene Scene"),
    "override": (override, "objects keep their materials: view layer ViewLayer"),
    "catcher": (
        catcher,
        "holdouts and shadow catchers are drawn as surfaces: catcher ball",
    ),
    "spot light": (soft_lamp, "spot lights shine to all sides: light spot"),
    "soft lamp": (soft_lamp, "soft shadows are drawn hard: light spot"),
}


@pytest.mark.parametrize(("make", "line"), OMISSIONS.values(), ids=OMISSIONS.keys())
def test_what_is_drawn_otherwise_is_said(dry, tmp_path, capfd, make, line):
    make(dry)
    text = said(capfd, dry, tmp_path / "picture.png")
    assert text.count(line) == 1, text
    # The next render says it again.
    assert said(capfd, dry, tmp_path / "picture.png").count(line) == 1


def test_one_report_says_all_of_an_animation(dry, tmp_path, capfd):
    principled("ice", Transmission_Weight=1.0)
    principled("cup", Transmission_Weight=1.0, Metallic=1.0)
    for _ in range(8):
        principled("tin", Metallic=0.5)
    dry.camera.data.dof.use_dof = True
    dry.frame_start, dry.frame_end = 1, 3
    text = said(capfd, dry, tmp_path / "w", animation=True)
    print(text)
    assert len(list(tmp_path.glob("w0*.png"))) == 3
    assert text.count("limpid draws some of this otherwise") == 1
    lines = [line for line in text.splitlines() if re.search("drawn|without", line)]
    assert len(lines) == 3
    assert "glass is drawn opaque: material cup (cup ball), material ice (ice ball)" in text
    assert "and 3 more" in lines[-1]


def test_a_plain_scene_is_drawn_without_a_word(scene, tmp_path, capfd):
    flood(scene)
    text = said(capfd, scene, tmp_path / "picture.png")
    assert "limpid draws" not in text and "Warning" not in text, text


def test_of_many_lights_the_strongest_are_drawn(dry, tmp_path, capfd):
    for number in range(20):
        light(dry, "POINT", 100.0 - number).name = f"lamp {number}"
    text = said(capfd, dry, tmp_path / "picture.png")
    names = ", ".join(f"light lamp {number}" for number in (16, 17, 18, 19))
    assert f"of more than 16 lights, the weakest are left out: {names}" in text
