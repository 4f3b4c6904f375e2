"""Report of what a scene has and limpid does not draw, beside materials, lights and the world."""

# Objects that Blender draws and limpid does not.
_LEFT_OUT = {
    "CURVES": "hair is left out",
    "POINTCLOUD": "point clouds that are no source of particles are left out",
    "VOLUME": "volumes are left out",
    "GPENCIL": "grease pencil is left out",
    "GREASEPENCIL": "grease pencil is left out",
}

# Kinds of rays that an object may be hidden from.
_RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


def say_of_scene(depsgraph, camera, report):
    """Reports what the settings of camera, scene and view layer ask for in vain."""
    data = camera.data
    if data.dof.use_dof:
        report.add("all is drawn sharp, without depth of field", f"camera {camera.name}")
    scene, layer = depsgraph.scene, depsgraph.view_layer
    if scene.render.use_motion_blur:
        report.add("all is drawn without motion blur", f"scene {scene.name}")
    if scene.render.use_multiview:
        report.add("one view is drawn, without stereoscopy", f"scene {scene.name}")
    if layer.material_override is not None:
        report.add("objects keep their materials", f"view layer {layer.name}")


def say_of_object(thing, report):
    """Reports what limpid does not draw of an object, or does not leave out of it."""
    if thing.type in _LEFT_OUT:
        report.add(_LEFT_OUT[thing.type], thing.name)
    if any(system.settings.render_type == "PATH" for system in thing.particle_systems):
        report.add("hair is left out", thing.name)
    if thing.type != "MESH":
        return
    if thing.is_holdout or thing.is_shadow_catcher:
        report.add("holdouts and shadow catchers are drawn as surfaces", thing.name)
    if not all(getattr(thing, f"visible_{ray}") for ray in _RAYS):
        report.add("objects that are hidden from some rays are drawn for all", thing.name)
