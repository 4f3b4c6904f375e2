"""Pictures of the add-on beside those of Blender's cameras and of the program."""

import math
import shutil
import tomllib

import numpy as np
import pytest

import limpid

from blender_tools import (
    DAM,
    aim,
    difference,
    flood,
    material,
    program_picture,
    render,
    sphere,
    world,
)

# After the tools, which skip these tests without it.
import bpy
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector


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
