"""The panels of limpid, and those of Blender that serve it too."""

import importlib.util

import bpy

from .engine import LimpidEngine, SaveScene

# Panels of other engines whose values limpid reads; Blender renamed some between its versions.
_SHARED = (
    "DATA_PT_EEVEE_light",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
)
# Panels for every engine that offer what limpid does not do.
_UNSHARED = ("DATA_PT_light", "VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes")


class _Panel(bpy.types.Panel):
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {LimpidEngine.bl_idname}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


class RENDER_PT_limpid_particles(_Panel):
    bl_label = "Particles"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.limpid
        if importlib.util.find_spec("limpid") is None:
            layout.label(text="Blender's Python has no limpid", icon="ERROR")
        layout.prop(settings, "source", expand=True)
        of_file = ("particles", "offset", "radius", "up")
        for name in of_file if settings.source == "FILE" else ("object", "radius"):
            layout.prop(settings, name)


class RENDER_PT_limpid_liquid(_Panel):
    bl_label = "Liquid"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.limpid
        layout.prop(settings, "ior")
        layout.prop(settings, "tint", expand=True)
        layout.prop(settings, "absorption" if settings.tint == "ABSORPTION" else "color")
        layout.prop(settings, "attribute")
        if settings.attribute:
            layout.prop(settings, "colormap")
            layout.prop(settings, "range")


class RENDER_PT_limpid_picture(_Panel):
    bl_label = "Picture"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.scene.limpid, "samples")
        layout.prop(context.scene.render, "film_transparent", text="Transparent")
        layout.operator(SaveScene.bl_idname)


class VIEWLAYER_PT_limpid_passes(_Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        column = layout.column(heading="Include")
        for name in ("use_pass_z", "use_pass_normal", "use_pass_vector"):
            column.prop(context.view_layer, name)


CLASSES = (
    RENDER_PT_limpid_particles,
    RENDER_PT_limpid_liquid,
    RENDER_PT_limpid_picture,
    VIEWLAYER_PT_limpid_passes,
)


def share_panels(shared):
    """Shows Blender's own panels of camera, material, light and world with limpid, or no longer."""
    for kind in bpy.types.Panel.__subclasses__():
        engines = getattr(kind, "COMPAT_ENGINES", ())
        common = "BLENDER_RENDER" in engines and kind.__name__ not in _UNSHARED
        if common or kind.__name__ in _SHARED:
            if shared:
                engines.add(LimpidEngine.bl_idname)
            else:
                engines.discard(LimpidEngine.bl_idname)
