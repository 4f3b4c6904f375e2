"""Sequences, reports, panels and installation of the add-on."""

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

from blender_tools import ADDON, DAM, flood, render

# After the tools, which skip these tests without it.
import bpy


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
    """Return the report of an action that fails: one line, and no traceback."""
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

    def column(self, **_):
        return self

    def operator(self, name):
        module, operator = name.split(".")
        getattr(getattr(bpy.ops, module), operator).get_rna_type()
        self.shown.append(name)

    def label(self, **_):
        raise AssertionError("limpid is there")


def test_the_panels_show_all_settings(scene, addon):
    shown = []
    context = SimpleNamespace(scene=scene, view_layer=scene.view_layers[0])
    scene.limpid.attribute = "heat"
    for scene.limpid.source, scene.limpid.tint in (("FILE", "ABSORPTION"), ("OBJECT", "COLOR")):
        for kind in addon.panel.CLASSES:
            drawn = SimpleNamespace(layout=Layout())
            kind.draw(drawn, context)
            shown += drawn.layout.shown
    settings = set(addon.LimpidSettings.bl_rna.properties.keys()) - {"rna_type", "name"}
    passes = {"use_pass_z", "use_pass_normal", "use_pass_vector"}
    assert settings | passes | {"film_transparent", "limpid.save_scene"} == set(shown)


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
