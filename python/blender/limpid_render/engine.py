"""The render engine, and the operator that saves what it would draw."""

import sys

import bpy
import numpy as np
from bpy_extras.io_utils import ExportHelper

from . import passes
from .errors import Problem, Stopped, line, line_of
from .report import Report

# Differences from Blender's own engines; said once, and again by the next render.
_report = Report()

# Shares of a picture's time that are shown as done before it is drawn, and after.
_BEFORE, _AFTER = 0.05, 0.95


@bpy.app.handlers.persistent
def begin(*_):
    """Begins a render, of one picture or of many; Blender calls it."""
    _report.forget()
    if _drawing() is not None:
        _drawing().forget()


def close():
    """Closes the renderer, if one is open."""
    if _drawing() is not None:
        _drawing().close()


def _drawing():
    """The module that draws, which only exists with limpid and after the first picture."""
    return sys.modules.get(f"{__package__}.drawing")


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
            self._render(depsgraph)
        except Stopped:
            return
        except ModuleNotFoundError as error:
            missing = Problem(f"Blender's Python has no module {error.name}: install limpid there")
            self.report({"ERROR"}, line_of(missing))
        except Exception as error:
            # Blender would print a traceback, and save a black picture.
            self.report({"ERROR"}, line_of(error))

    def _render(self, depsgraph):
        from . import save, translate

        camera = self.camera_override or depsgraph.scene.camera
        size = (self.resolution_x, self.resolution_y)
        self._step(0.0, "Translating the scene")
        cameras = None
        if depsgraph.view_layer.use_pass_vector and self.save_to is None:
            cameras = self._cameras(depsgraph, camera, size)
        translation = translate.translate(depsgraph, camera, size, self._wait, _report)
        if self.save_to is not None:
            save.save_scene(self.save_to, translation, depsgraph, _report)
        else:
            self._draw(depsgraph, translation, cameras or [translation.camera])
        said = _report.take()
        if said:
            self.report({"WARNING"}, said)

    def update_render_passes(self, scene, renderlayer):
        """Tells which passes a view layer gets; Blender calls it."""
        for name, channels, letters, kind in passes.offered(renderlayer):
            self.register_pass(scene, renderlayer, name, channels, letters, kind)

    def _step(self, share, text):
        """Shows the next step, unless the user has asked to stop."""
        self.update_stats("limpid", text)
        if self._watch(share):
            raise Stopped

    def _watch(self, share):
        """Shows the share that is done; returns whether the user has asked to stop."""
        self.update_progress(share)
        return self.test_break()

    def _wait(self):
        """Fails if the user has asked to stop."""
        if self._watch(0.0):
            raise Stopped

    def _draw(self, depsgraph, translation, cameras):
        from . import drawing, source, translate

        scene, layer = depsgraph.scene, depsgraph.view_layer
        settings = scene.limpid
        self._step(0.5 * _BEFORE, f"Reading {source.name_of(settings, scene.frame_current)}")
        liquid = source.liquid_of(depsgraph, _report)
        drawn = f"Drawing {len(liquid.particles)} particles"
        self._step(_BEFORE, drawn)
        picture, radiance = drawing.draw(
            liquid,
            settings,
            lambda share: self._watch(_BEFORE + (_AFTER - _BEFORE) * share),
            _report,
            scene=translate.scene_of(translation, settings),
            camera=translate.camera_of(translation.camera),
            size=translation.camera.size,
            aovs=passes.images(layer),
            alpha=scene.render.film_transparent,
        )
        self._step(_AFTER, "Making the passes")
        rate = scene.render.fps / scene.render.fps_base
        self._show(passes.made(layer, picture, radiance, cameras, rate), scene.render, layer)

    def _show(self, made, render, layer):
        """Hands the part of the passes to Blender that it asks for, rows from the bottom."""
        height, width = made["Combined"].shape[:2]
        rows, columns = slice(0, height), slice(0, width)
        if render.use_border:
            # All of it was drawn: rays inside the liquid know nothing outside the picture.
            rows = _between(render.border_min_y, render.border_max_y, height)
            columns = _between(render.border_min_x, render.border_max_x, width)
        width, height = len(range(width)[columns]), len(range(height)[rows])
        result = self.begin_result(0, 0, width, height, layer=layer.name)
        for name, pixels in made.items():
            part = np.ascontiguousarray(pixels[::-1][rows, columns], np.float32)
            result.layers[0].passes[name].rect.foreach_set(part.ravel())
        self.end_result(result)

    def _cameras(self, depsgraph, camera, size):
        """The cameras of this, the last and the next frame."""
        from . import translate

        scene = depsgraph.scene
        frame, part = scene.frame_current, scene.frame_subframe
        found = [translate.camera_at(depsgraph, camera, size)]
        for other in (frame - 1, frame + 1):
            self.frame_set(other, part)
            found.append(translate.camera_at(depsgraph, camera, size))
        self.frame_set(frame, part)
        return found


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


