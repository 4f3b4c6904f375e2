"""The render engine, and the operator that saves what it would draw."""

import os
import warnings

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper

from . import particles
from .axes import particles_y_up
from .errors import Problem, line, line_of
from .report import Report

# The renderer, whose pipelines serve all pictures: opened for the first.
_renderer = None

# Radii that were estimated, by file.
_radii = {}

# What is drawn otherwise than by Blender's own engines; said once, and again by the next render.
_report = Report()


@bpy.app.handlers.persistent
def begin(*_):
    """Begins a render, of one picture or of many; Blender calls it."""
    _report.forget()


def close():
    """Closes the renderer, if one is open."""
    global _renderer
    if _renderer is not None:
        _renderer.close()
        _renderer = None


class LimpidEngine(bpy.types.RenderEngine):
    """Draws the particles of a frame in the scene around them."""

    bl_idname = "LIMPID"
    bl_label = "limpid"
    bl_use_preview = False
    bl_use_eevee_viewport = True

    # Where to save the next scene, instead of drawing it.
    save_to = None

    def render(self, depsgraph):
        """Draws a view layer; Blender calls it."""
        try:
            try:
                from . import save, translate
            except ModuleNotFoundError as error:
                raise Problem(
                    f"Blender's Python has no module {error.name}: install limpid there"
                ) from error
            scene = depsgraph.scene
            size = (self.resolution_x, self.resolution_y)
            camera = self.camera_override or scene.camera
            self.update_stats("limpid", "Translating the scene")
            translation = translate.translate(depsgraph, camera, size, _report)
            if LimpidEngine.save_to is not None:
                frame = scene.frame_current
                save.save_scene(LimpidEngine.save_to, translation, scene.limpid, frame)
            else:
                self._draw(depsgraph, translation, translate)
            said = _report.take()
            if said:
                self.report({"WARNING"}, said)
        except Exception as error:
            # Blender would print a traceback, and save a black picture.
            self.report({"ERROR"}, line_of(error))

    def _draw(self, depsgraph, translation, translate):
        import limpid

        scene = depsgraph.scene
        settings = scene.limpid
        file = particles.file_of_frame(settings, scene.frame_current)
        self.update_stats("limpid", f"Reading {os.path.basename(file)}")
        liquid = limpid.read(file)
        if settings.up == "Z":
            liquid = particles_y_up(liquid)
        if self.test_break():
            return
        self.update_stats("limpid", f"Drawing {len(liquid)} particles")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", limpid.LimpidWarning)
            solids = [translate.solid_of(shape) for shape in translation.shapes]
            picture = _open_renderer().render(
                liquid,
                radius=_radius(settings, liquid),
                scene=translate.scene_of(translation, settings, solids),
                camera=translate.camera_of(translation.camera),
                size=translation.camera.size,
                samples=settings.samples,
                alpha=scene.render.film_transparent,
            )
            radiance = picture.radiance
        for warning in caught:
            if issubclass(warning.category, limpid.LimpidWarning):
                _report.add(line(warning.message))
        if not self.test_break():
            self._show(radiance, depsgraph)

    def _show(self, radiance, depsgraph):
        """Hands the part of the picture to Blender that it asks for, rows from the bottom."""
        pixels = np.ones((*radiance.shape[:2], 4), np.float32)
        pixels[..., : radiance.shape[2]] = radiance
        pixels = pixels[::-1]
        render = depsgraph.scene.render
        if render.use_border:
            # All of it was drawn: rays inside the liquid know nothing outside the picture.
            pixels = pixels[
                _between(render.border_min_y, render.border_max_y, pixels.shape[0]),
                _between(render.border_min_x, render.border_max_x, pixels.shape[1]),
            ]
        height, width = pixels.shape[:2]
        result = self.begin_result(0, 0, width, height, layer=depsgraph.view_layer.name)
        result.layers[0].passes["Combined"].rect.foreach_set(pixels.ravel())
        self.end_result(result)


class SaveScene(bpy.types.Operator, ExportHelper):
    """Write camera, lights, world and meshes as a scene file for the program limpid"""

    bl_idname = "limpid.save_scene"
    bl_label = "Save Scene for limpid"
    filename_ext = ".toml"
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return context.scene.render.engine == LimpidEngine.bl_idname

    def execute(self, context):
        # Only a render sees the scene as it is rendered: with what is hidden in the viewport, and
        # with the modifiers' settings for renders.
        LimpidEngine.save_to = bpy.path.abspath(self.filepath)
        try:
            bpy.ops.render.render(layer=context.view_layer.name, scene=context.scene.name)
        except RuntimeError as error:
            self.report({"ERROR"}, line(str(error).removeprefix("Error: ")))
            return {"CANCELLED"}
        finally:
            LimpidEngine.save_to = None
        self.report({"INFO"}, f"Saved {self.filepath}")
        return {"FINISHED"}


def _between(low, high, size):
    """The pixels between two shares of a size, rounded as Blender does: in 32 bits, down."""
    return slice(int(np.float32(low) * np.float32(size)), int(np.float32(high) * np.float32(size)))


def _open_renderer():
    import limpid

    global _renderer
    if _renderer is None:
        _renderer = limpid.Renderer()
    return _renderer


def _radius(settings, liquid):
    """The radius to draw with; `None` where the particles have theirs."""
    import limpid

    if settings.radius > 0.0:
        return settings.radius
    if liquid.radii is not None or liquid.radius is not None:
        return None
    # Estimated once for all frames of a sequence, or the liquid would swell and shrink.
    file = particles.first_file(settings)
    key = (file, os.stat(file).st_mtime_ns)
    if key not in _radii:
        _radii[key] = _open_renderer().render(limpid.read(file), size=(16, 16)).radius
    return _radii[key]
