"""Depth, normal and motion passes beside those of Cycles, progress, and stopping."""

import threading

import numpy as np
import pytest

import limpid

from blender_tools import aim, floor, light, material, render, render_passes, sphere

# After the tools, which skip these tests without it.
import bpy

FAR = 1e9


@pytest.fixture
def layer(dry):
    """The view layer of a dry scene, with all passes."""
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_vector = True
    return layer


def place_solids(scene):
    floor(6, -0.4, (0.8, 0.6, 0.4))
    sphere("ball", (0.3, 0.5, 0.3), 0.5, material("ball", (0.2, 0.5, 0.7)))
    bpy.ops.object.shade_smooth()
    light(scene, "SUN", 3.0, rotation=(0.5, 0.3, 0))
    aim(scene.camera, (1, -4, 2), (0, 0, 0.3))


def in_cycles(scene, path):
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    passes = render_passes(scene, path)
    scene.render.engine = "LIMPID"
    return passes


LENSES = {
    "perspective": {},
    "shifted": {"shift_x": 0.1, "shift_y": -0.05},
    "orthographic": {"type": "ORTHO", "ortho_scale": 3.0},
}


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_passes_of_solids_are_those_of_cycles(dry, layer, tmp_path, lens):
    place_solids(dry)
    for name, value in lens.items():
        setattr(dry.camera.data, name, value)
    # The camera moves: so do all things in the picture.
    dry.frame_start, dry.frame_end = 1, 3
    for frame, offset in ((1, -0.1), (2, 0.0), (3, 0.1)):
        dry.camera.location = (1 + offset, -4, 2 + 0.5 * offset)
        dry.camera.keyframe_insert("location", frame=frame)
    for curve in curves(dry.camera):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    dry.frame_set(2)
    truth = in_cycles(dry, tmp_path / "cycles.exr")
    drawn = render_passes(dry, tmp_path / "limpid.exr")
    empty = truth["Depth"][..., 0] > FAR
    assert np.mean((drawn["Depth"][..., 0] > FAR) != empty) < 0.01
    assert drawn["Depth"].max() == truth["Depth"].max()
    seen = ~empty & (drawn["Depth"][..., 0] < FAR)
    # The normals of solids are those of their faces; Cycles has smooth ones.
    for name, tolerance in {"Depth": 1e-3, "Normal": 0.1, "Vector": 1e-3}.items():
        expected = truth[name]
        if name == "Vector" and lens.get("type") == "ORTHO":
            # Those of Cycles differ between places, as if the rays were not parallel.
            expected = moved_in_parallel(dry)
        error = np.quantile(np.abs(drawn[name] - expected)[seen], 0.9)
        print(f"{name}: 90 % of the errors are below {error:.2g}")
        assert error < tolerance
    assert not drawn["Normal"][empty].any()


def moved_in_parallel(scene):
    """The motion of all pixels before an orthographic camera that moves by the same each frame."""
    right, up, _ = np.array(scene.camera.matrix_world)[:3, :3].T
    moved = np.array([right @ (0.1, 0, 0.05), up @ (0.1, 0, 0.05)]) * 320 / 3.0
    return np.concatenate([moved, moved])


def curves(thing):
    action = thing.animation_data.action
    if bpy.app.version >= (5, 0):
        return action.layers[0].strips[0].channelbags[0].fcurves
    return action.fcurves


def pool(path, velocity):
    """A still block of water with its surface at z = 0, which moves as a whole."""
    side = np.arange(-1.0, 1.0, 0.05) + 0.025
    rows = np.stack(np.meshgrid(side, side, -0.025 - 0.05 * np.arange(8)), axis=-1).reshape(-1, 3)
    limpid.write(path, rows, velocities=np.tile(velocity, (len(rows), 1)), radius=0.025)


def test_the_surface_of_a_pool_has_the_depth_and_the_motion_of_its_plane(dry, layer, tmp_path):
    pool(tmp_path / "pool.npz", (0.6, 0.3, 0.0))
    dry.limpid.particles, dry.limpid.up = str(tmp_path / "pool.npz"), "Z"
    dry.render.fps = 50
    aim(dry.camera, (0, -2, 2), (0, 0, 0))
    passes = render_passes(dry, tmp_path / "pool.exr")
    rows, columns = slice(90, 150), slice(120, 200)
    # The plane z = 0, seen from 2 m above it at 45 degrees.
    focal = 50 / 36 * 320
    x = (np.arange(320) + 0.5 - 160) / focal
    y = (120 - np.arange(240) - 0.5)[:, None] / focal
    fall = (1.0 - y) / np.sqrt(2.0)
    depth = np.broadcast_to(2.0 / fall, (240, 320))
    error = np.abs(passes["Depth"][..., 0] - depth)[rows, columns]
    print("depth", error.max())
    assert error.max() < 0.02
    normals = passes["Normal"][rows, columns]
    print("normal", np.abs(normals - (0, 0, 1)).max(axis=(0, 1)))
    assert np.median(normals[..., 2]) > 0.995
    # What a place of the surface moves by in a frame, in pixels.
    across, up = (0.6, 0.3 * np.sqrt(0.5)) / np.float64(50)
    away = 0.3 * np.sqrt(0.5) / 50
    expected = np.stack(
        [focal * (across - x * away) / depth, focal * (up - y * away) / depth], axis=-1
    )[rows, columns]
    for vectors in (passes["Vector"][..., :2], passes["Vector"][..., 2:]):
        found = -vectors[rows, columns]
        print("vector", np.abs(found - expected).max(), expected.mean(axis=(0, 1)))
        assert np.allclose(found, expected, atol=0.05)


def test_passes_of_a_border_are_those_pixels(dry, layer, tmp_path):
    place_solids(dry)
    whole = render_passes(dry, tmp_path / "whole.exr")
    border = dry.render
    border.use_border, border.use_crop_to_border = True, True
    border.border_min_x, border.border_max_x = 0.25, 0.7
    border.border_min_y, border.border_max_y = 0.3, 0.9
    part = render_passes(dry, tmp_path / "part.exr")
    for name in ("Depth", "Normal", "Vector"):
        assert np.array_equal(part[name], whole[name][24:168, 80:224])


def test_passes_that_nobody_asks_for_are_not_made(dry, tmp_path):
    layer = bpy.context.view_layer
    layer.use_pass_z = False
    assert set(render_passes(dry, tmp_path / "plain.exr")) == {"Combined"}


def test_a_render_stops_while_it_draws(dry, addon, tmp_path, monkeypatch):
    stopped, drawing = threading.Event(), threading.Event()

    def slow(*_, **__):
        drawing.set()
        # Only the end of the render ends this: it would wait for ever.
        assert stopped.wait(60)

    monkeypatch.setattr(limpid.Renderer, "render", slow)
    monkeypatch.setattr(addon.engine.LimpidEngine, "_watch", lambda *_: drawing.is_set())
    dry.render.filepath = str(tmp_path / "stopped.png")
    bpy.ops.render.render()
    assert drawing.is_set() and not stopped.is_set()
    stopped.set()


def test_progress_only_grows(dry, addon, tmp_path, monkeypatch):
    shares, engine = [], addon.engine.LimpidEngine
    watch = engine._watch

    def watched(self, share):
        shares.append(share)
        return watch(self, share)

    monkeypatch.setattr(engine, "_watch", watched)
    for _ in range(2):
        shares.clear()
        render(dry, tmp_path / "picture.png")
        assert shares == sorted(shares) and 0.0 <= shares[0] and shares[-1] <= 1.0
        assert len(set(shares)) >= 4
