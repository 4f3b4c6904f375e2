"""Looking at particles: a window in a process of its own, and a picture that the mouse turns."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import limpid
from conftest import SMALL
from limpid import _window
from limpid._drawing import Request
from limpid._widget import orbited


def arguments(source, folder, **keywords):
    return _window._arguments(source, Request(**{"size": SMALL, **keywords}), str(folder))


def test_a_window_is_given_the_particles(ball, tmp_path):
    keywords = dict(radius=0.05, velocities=ball, values=ball[:, 0], colormap="turbo", range=(-1, 1), up="z")
    given = arguments(ball, tmp_path, **keywords)
    path = tmp_path / "particles.npz"
    assert given[:2] == ["view", str(path)]
    options = {"--size=96x72", "--radius=0.05", "--up=z", "--color-by=values", "--colormap=turbo", "--range=-1.0:1.0"}
    assert set(given[2:]) == options
    (read,) = limpid.frames(path, values="values")
    assert np.array_equal(read.positions, ball) and np.array_equal(read.velocities, ball)
    assert np.array_equal(read.values, ball[:, 0])


def test_a_window_is_given_frames_files_and_scenes(ball, tmp_path):
    holed = ball.copy()
    holed[3] = np.nan
    frames = [limpid.Particles(ball, radii=np.full(len(ball), 0.05, np.float32)), holed]
    given = arguments(frames, tmp_path, colors=np.ones(ball.shape))
    assert given[1] == str(tmp_path / "frame_{}.npz") and "--color-by=color" in given
    first, second = limpid.frames(given[1])
    assert np.array_equal(first.positions, ball) and np.allclose(first.radii, 0.05)
    assert len(second) == len(ball) - 1
    camera = limpid.Camera((0, 1, 3), (0, 0, 0))
    given = arguments("water_{}.bgeo", tmp_path, scene=limpid.Scene(ior=1.4), camera=camera, values="velocity")
    assert given[1] == "water_{}.bgeo" and "--color-by=velocity" in given
    loaded = limpid.Scene.load(tmp_path / "scene.toml")
    assert loaded.ior == pytest.approx(1.4) and loaded.camera == camera
    with pytest.raises(ValueError, match="values is an array"):
        arguments("water_{}.bgeo", tmp_path, values=[1, 2])


def test_the_program_knows_the_arguments(ball, tmp_path, program, monkeypatch):
    """Those that a window shares with pictures."""
    given = arguments(ball, tmp_path, radius=0.05, values=ball[:, 0], colormap="turbo", range=(-1, 1), up="y")
    program("render", *given[1:], "-o", tmp_path / "a.png")


@pytest.mark.skipif(sys.platform != "linux", reason="only there can a display be taken away")
def test_a_window_that_cannot_be_opened_says_why(ball, monkeypatch, tmp_path):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.setattr(_window, "_PATIENCE", 60)
    with pytest.raises(limpid.Error, match="window|display"):
        limpid.view(ball, radius=0.05)
    assert list(tmp_path.iterdir()) == [], "nothing is left"


def test_a_window_lives_in_a_process_of_its_own(ball, monkeypatch):
    monkeypatch.setattr(_window, "_PATIENCE", 0.1)
    monkeypatch.setattr(_window, "_SCRIPT", "import time; time.sleep(60)")
    with limpid.view(ball, window=True) as window:
        assert window.is_open and "open" in repr(window)
        with pytest.raises(TimeoutError):
            window.wait(0.1)
        assert os.path.exists(os.path.join(window._folder, "particles.npz"))
    assert not window.is_open and not os.path.exists(window._folder)


def test_dragging_orbits():
    camera = limpid.Camera((0, 1, 3), (0, 0, 0), 35)
    right = orbited(camera, 90, 0, 0)
    assert np.allclose(right.eye, camera.turned(-45).eye) and right.fov_y == 35
    above = orbited(camera, 0, 1000, 0)
    assert above.eye[1] == pytest.approx(np.sqrt(10) * np.sin(np.radians(89))), "not over the top"
    assert np.allclose(orbited(above, 90, 0, 0).target, (0, 0, 0))
    nearer = orbited(camera, 0, 0, 1000)
    assert np.linalg.norm(nearer.eye) == pytest.approx(np.sqrt(10) / np.e)
    z = limpid.Camera((0, -3, 1), (0, 0, 0), up=(0, 0, 1))
    assert orbited(z, 0, -60, 0).eye[2] < 0
    flat = limpid.Camera.orthographic((0, 0, 5), (0, 0, 0), 3.0)
    assert orbited(flat, 0, 0, 1000).height == pytest.approx(3 / np.e)
    straight = limpid.Camera((0, 3, 1e-3), (0, 0, 0))
    assert np.isfinite(orbited(straight, 10, 10, 0).eye).all()


PAGE = """
const handlers = {}, on = {}, sent = [];
const image = { style: {}, addEventListener: (name, act) => handlers[name] = act, setPointerCapture() {} };
globalThis.document = { createElement: () => image };
const model = { get: () => 1, on: (name, act) => on[name] = act, send: (message) => sent.push(message) };
URL.createObjectURL = URL.revokeObjectURL = () => {};
const widget = (await import("./widget.mjs")).default;
widget.render({ model, el: { append() {} } });
const drawn = () => on["msg:custom"]();
handlers.pointerdown({ pointerId: 1 });
handlers.pointermove({ movementX: 3, movementY: 1 });
handlers.pointermove({ movementX: 4, movementY: 2 });
handlers.pointermove({ movementX: 5, movementY: 0 });
drawn(); drawn();
handlers.pointerup(); drawn(); drawn();
handlers.wheel({ deltaY: 10, preventDefault() {} }); drawn();
handlers.dblclick(); drawn();
console.log(JSON.stringify(sent.map((m) => [m.right, m.up, m.nearer, m.back, m.coarse])));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs Node.js")
def test_the_page_gathers_motion_while_a_picture_is_drawn(tmp_path):
    from limpid._widget import _SCRIPT

    (tmp_path / "widget.mjs").write_text(_SCRIPT)
    (tmp_path / "page.mjs").write_text(PAGE)
    done = subprocess.run(["node", "page.mjs"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [
        [3, 1, 0, False, True],
        [9, 2, 0, False, True],
        # A fine picture as the mouse is let go.
        [0, 0, 0, False, False],
        [0, 0, -10, False, False],
        [0, 0, 0, True, False],
    ]


def test_without_anywidget_its_installation_is_named(ball, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(ImportError, match="pip install anywidget"):
        limpid.view(ball, radius=0.05, window=False)


def test_the_mouse_turns_a_picture(ball, monkeypatch):
    pytest.importorskip("anywidget")
    image = pytest.importorskip("PIL.Image")
    widget = limpid.view(ball, radius=0.05, values=ball[:, 0], window=False, size=(96, 72))
    sent = []
    monkeypatch.setattr(widget, "send", sent.append)
    first, before = widget.camera, widget.picture
    assert image.open(io.BytesIO(before)).size == (96, 72)
    widget._moved(widget, {"right": 90, "up": 0, "nearer": 0, "coarse": True}, [])
    assert np.allclose(widget.camera.eye, first.turned(-45).eye) and widget.picture != before
    assert image.open(io.BytesIO(widget.picture)).size == (48, 36), "coarse while it is dragged"
    assert widget.shown.range is not None
    ranges = {widget.shown.range}
    widget._moved(widget, {"back": True}, [])
    assert widget.camera == first and image.open(io.BytesIO(widget.picture)).size == (96, 72)
    assert ranges == {widget.shown.range}, "colours do not change as it turns"
    assert len(sent) == 2
    with pytest.raises(TypeError):
        widget._moved(widget, {"right": None}, [])
    assert len(sent) == 3, "the page may go on"
    assert "export default" in str(widget._esm)


def test_the_mouse_turns_files(root, ball):
    pytest.importorskip("anywidget")
    path = root / "sims" / "demo.bgeo"
    widget = limpid.view(path, values="velocity", window=False, size=SMALL)
    assert np.array_equal(widget.shown.rgba, limpid.render(path, values="velocity", size=SMALL).rgba)
    first = widget.shown
    widget._moved(widget, {"right": 90}, [])
    turned = limpid.render(path, values="velocity", camera=widget.camera, scene=first.scene, size=SMALL)
    assert widget.shown.camera == turned.camera != first.camera
    assert limpid.flip(widget.shown, turned)[0] < 0.01
    with pytest.raises(ValueError, match="several frames"):
        limpid.view(limpid.frames(path), window=False)
