"""The add-on, registered, and scenes for it. Without `bpy` no test uses them: see `blender_tools`."""

import importlib
import sys

import numpy as np
import pytest

import limpid

@pytest.fixture(scope="module", autouse=True)
def addon():
    from blender_tools import ADDON

    sys.path.insert(0, str(ADDON.parent))
    module = importlib.import_module(ADDON.name)
    module.register()
    yield module
    module.unregister()
    sys.path.remove(str(ADDON.parent))


@pytest.fixture
def scene(addon):
    """An empty scene with a camera that looks along +y from 5 m, drawn by limpid at 320x240."""
    import bpy
    from blender_tools import DAM, aim

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
