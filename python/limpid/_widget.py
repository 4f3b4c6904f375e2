"""A picture in a notebook that is turned by the mouse."""

from __future__ import annotations

import importlib
import io
from collections.abc import Callable
from typing import Any

import numpy as np

from ._limpid import Camera
from ._picture import Picture

#: How near to straight up or down the camera comes, degrees.
_STEEPEST = 89.0

_SCRIPT = """
function render({ model, el }) {
    const image = document.createElement("img");
    image.draggable = false;
    image.style.cssText = "max-width: 100%; cursor: grab; touch-action: none";
    image.width = model.get("width");
    image.title = "Drag to turn, scroll to come nearer, double-click to go back";
    el.append(image);

    const show = () => {
        URL.revokeObjectURL(image.src);
        image.src = URL.createObjectURL(new Blob([model.get("picture")], { type: "image/jpeg" }));
    };
    model.on("change:picture", show);
    show();

    // Gathers motion while a picture is drawn, and asks for the next one with all of it.
    let right = 0, up = 0, nearer = 0, back = false, held = false, stale = false, drawing = false;
    const ask = () => {
        const moved = right || up || nearer || back;
        if (drawing || !(moved || (stale && !held))) return;
        drawing = true;
        stale = moved && held;
        model.send({ right, up, nearer, back, coarse: Boolean(stale) });
        right = up = nearer = 0;
        back = false;
    };
    model.on("msg:custom", () => { drawing = false; ask(); });

    image.addEventListener("pointerdown", (event) => {
        held = true;
        image.setPointerCapture(event.pointerId);
    });
    image.addEventListener("pointermove", (event) => {
        if (!held) return;
        right += event.movementX;
        up += event.movementY;
        ask();
    });
    const release = () => { held = false; ask(); };
    image.addEventListener("pointerup", release);
    image.addEventListener("pointercancel", release);
    image.addEventListener("wheel", (event) => {
        event.preventDefault();
        nearer -= event.deltaY;
        ask();
    }, { passive: false });
    image.addEventListener("dblclick", () => { back = true; ask(); });
}
export default { render };
"""


def orbited(camera: Camera, right: float, up: float, nearer: float) -> Camera:
    """The camera after its picture was dragged by so many pixels and scrolled nearer by so many: half a degree and 0.1 % a
    pixel."""
    target, axis = np.array(camera.target, float), np.array(camera.up, float)
    axis /= np.linalg.norm(axis)
    offset = np.subtract(camera.eye, target)
    distance = float(np.linalg.norm(offset))
    height = float(np.degrees(np.arcsin(np.clip(offset @ axis / distance, -1, 1))))
    level = offset - (offset @ axis) * axis
    if np.linalg.norm(level) < 1e-9 * distance:
        level = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    level /= np.linalg.norm(level)
    turn, height = np.radians(-right / 2), np.radians(np.clip(height + up / 2, -_STEEPEST, _STEEPEST))
    level = level * np.cos(turn) + np.cross(axis, level) * np.sin(turn)
    scale = float(np.exp(-np.clip(nearer, -2000, 2000) / 1000))
    if camera.height is None:
        distance *= scale
    eye = list(target + distance * (np.cos(height) * level + np.sin(height) * axis))
    if camera.height is not None:
        return Camera.orthographic(eye, list(target), camera.height * scale, list(axis), camera.near)
    assert camera.fov_y is not None
    return Camera(eye, list(target), camera.fov_y, list(axis), camera.near)


class Orbiting:
    """Attributes beside those of anywidget: `shown` is the `Picture`, `camera` its camera."""

    picture: bytes
    send: Callable[[Any], None]
    on_msg: Callable[[Any], None]

    def __init__(self, draw: Callable[[Camera | None, bool], Picture]) -> None:
        self._draw = draw
        self.shown = draw(None, False)
        self.camera = self._first = self.shown.camera
        if self.camera.target is None:
            raise ValueError("camera has matrices and no target to turn about; give a limpid.Camera(eye, target)")
        super().__init__(picture=_jpeg(self.shown), width=self.shown.shape[1])  # type: ignore[call-arg]
        self.on_msg(self._moved)

    def _moved(self, _: Any, message: dict[str, Any], __: Any) -> None:
        """Draws the picture that the page has asked for."""
        try:
            right, up, nearer = (float(message.get(name, 0)) for name in ("right", "up", "nearer"))
            self.camera = self._first if message.get("back") else orbited(self.camera, right, up, nearer)
            self.shown = self._draw(self.camera, bool(message.get("coarse")))
            self.picture = _jpeg(self.shown)
        finally:
            # Whatever happens, the page may ask again.
            self.send({})


def orbiting(draw: Callable[[Camera | None, bool], Picture]) -> Any:
    """A widget of pictures that `draw` makes from a camera, which is ``None`` at first, coarse ones while it is dragged."""
    try:
        base: Any = importlib.import_module("anywidget").AnyWidget
        traits: Any = importlib.import_module("traitlets")
    except ImportError:
        raise ImportError("pictures that turn need anywidget: pip install anywidget") from None
    members = {
        "__module__": __name__,
        "_esm": _SCRIPT,
        "picture": traits.Bytes().tag(sync=True),
        "width": traits.Int().tag(sync=True),
    }
    return type(base)("View", (Orbiting, base), members)(draw)


def _jpeg(picture: Picture) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, format="jpg")
    return buffer.getvalue()
