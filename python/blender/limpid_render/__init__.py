"""Blender draws particle liquids with limpid: a render engine and its settings."""

import bpy

from . import engine, panel
from .properties import LimpidSettings

# Blender reads this of an add-on, and blender_manifest.toml of an extension.
bl_info = {
    "name": "limpid",
    "description": "Draws clear liquid straight from particle files",
    "author": "limpid",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "Properties > Render > Render Engine",
    "category": "Render",
}

_CLASSES = (LimpidSettings, engine.LimpidEngine, engine.SaveScene, *panel.CLASSES)


def register():
    for kind in _CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.limpid = bpy.props.PointerProperty(type=LimpidSettings)
    panel.share_panels(True)
    bpy.app.handlers.render_init.append(engine.begin)


def unregister():
    bpy.app.handlers.render_init.remove(engine.begin)
    panel.share_panels(False)
    del bpy.types.Scene.limpid
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)
    engine.close()
