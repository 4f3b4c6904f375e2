"""Pictures: those of the program, bit by bit, and what can be done with them."""

from __future__ import annotations

import io
import pickle
import sys

import numpy as np
import pytest

import limpid
from conftest import SMALL


def chunks(path):
    """The chunks of a PNG without its notes."""
    data = path.read_bytes()
    at, found = 8, []
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        kind = data[at + 4 : at + 8]
        if kind not in (b"tEXt", b"iTXt"):
            found.append(data[at : at + 12 + length])
        at += 12 + length
    return found


def assert_same_png(a, b):
    """Equal files but for the notes by which the program knows its own pictures again."""
    assert chunks(a) == chunks(b)


CASES = {
    "nothing given": ((), dict()),
    "a radius": (("--radius", "0.03"), dict(radius=0.03)),
    "samples": (("--samples", "4"), dict(samples=4)),
    "coverage": (("--alpha",), dict(alpha=True)),
    "an axis": (("--up", "z"), dict(up="z")),
}


@pytest.mark.parametrize("case", CASES)
def test_pictures_are_those_of_the_program(renderer, program, dam, tmp_path, case):
    arguments, keywords = CASES[case]
    np.save(tmp_path / "dam.npy", dam)
    program("render", tmp_path / "dam.npy", "--size", "160x120", *arguments, "-o", tmp_path / "a.png")
    picture = renderer.render(dam, size=(160, 120), **keywords)
    picture.save(tmp_path / "b.png")
    assert_same_png(tmp_path / "a.png", tmp_path / "b.png")


def test_a_picture_from_another_camera_is_that_of_a_new_renderer(dam):
    """What the last picture left behind serves only the same particles, solids and lights."""
    middle = dam.mean(axis=0)
    first = limpid.Camera(middle + (1.5, 1.2, 1.8), middle)
    scene = limpid.Scene(look="daylight")
    stone = limpid.Scene(look="daylight", solids=[limpid.Sphere(middle + (0, 0.3, 0), 0.2)])
    moved = dam + np.float32([0, 0.01, 0])
    asked = [
        (dam, dict(scene=scene, camera=first)),
        (dam, dict(scene=scene, camera=first.turned(40))),
        (dam, dict(scene=scene, camera=first.turned(40))),
        (dam, dict(scene=stone, camera=first.turned(40))),
        (moved, dict(scene=stone, camera=first.turned(40))),
        (moved, dict(scene=stone, camera=first, radius=0.03)),
        (moved, dict(scene=stone, camera=first, samples=4)),
        (moved, dict(scene=stone, camera=first, values=dam[:, 1], range=(0, 1))),
    ]
    with limpid.Renderer() as kept:
        for i, (positions, keywords) in enumerate(asked):
            picture = kept.render(positions, size=(48, 36), **keywords)
            with limpid.Renderer() as new:
                assert np.array_equal(picture, new.render(positions, size=(48, 36), **keywords)), i


def test_views_are_pictures_from_each_camera(renderer, dam):
    """With and without coverage, and in a world of z up."""
    for up, axis in (("y", (0, 1, 0)), ("z", (0, 0, 1))):
        middle = dam.mean(axis=0)
        first = limpid.Camera(middle + (1.5, 1.2, 1.8), middle, up=axis)
        cameras = [first, first.turned(40) if up == "y" else first, limpid.Camera(middle + (2, 1, 1), middle, up=axis)]
        scene = renderer.render(dam, camera=first, size=(32, 32), up=up).scene
        for alpha in (False, True):
            keywords = dict(scene=scene, size=(80, 60), up=up, alpha=alpha)
            pictures = renderer.render_views(dam, cameras, **keywords)
            assert pictures.shape == (3, 60, 80, 4) and pictures.dtype == np.uint8
            for camera, picture in zip(cameras, pictures):
                alone = renderer.render(dam, camera=camera, **keywords)
                assert np.array_equal(np.asarray(alone.rgba), picture)
    assert renderer.render_views(dam, [], size=(8, 6)).shape == (0, 6, 8, 4)
    with pytest.raises(ValueError, match="number 0 is 3"):
        renderer.render_views(dam, [3])
    with pytest.raises(ValueError, match="expected cameras"):
        renderer.render_views(dam, 3)


def test_scenes_are_those_of_the_program(renderer, program, root, tmp_path):
    """A scene file with solids, lights and settings, and its radiance."""
    dam = limpid.read(root / "sims" / "demo.bgeo").positions.astype(np.float64)
    np.save(tmp_path / "dam.npy", dam)
    scene = limpid.Scene(
        ior=1.4,
        absorption=(2.0, 0.5, 0.2),
        solids=[
            limpid.Plane((0, 0, 0), color=(0.6, 0.6, 0.55), lit=True),
            limpid.Sphere((0.5, 0.3, 0.2), 0.2, color=(0.8, 0.2, 0.1), lit=True),
            limpid.Box((-1, 0, -1), (-0.8, 0.6, -0.8), checker=limpid.Checker(0.1)),
        ],
        lights=[limpid.Sun((0.3, -1, -0.2), (2.5, 2.4, 2.2))],
        look=None,
        environment=limpid.Gradient((0.3, 0.5, 0.9), (0.8, 0.85, 0.9)),
        camera=limpid.Camera((1, 2, 4), (0, 0.4, 0), 35),
    )
    scene.settings["refract.interfaces"] = 3
    scene.settings["smooth.iterations"] = 2
    scene.save(tmp_path / "scene.toml")
    size = ("--size", "160x120", "--radius", "0.025")
    for name in ("a.png", "a.exr"):
        program(
            "render", tmp_path / "dam.npy", "--scene", tmp_path / "scene.toml", *size, "-o", tmp_path / name
        )
    picture = renderer.render(dam, radius=0.025, scene=scene, size=(160, 120))
    picture.save(tmp_path / "b.png")
    picture.save(tmp_path / "b.exr")
    assert_same_png(tmp_path / "a.png", tmp_path / "b.png")
    again = renderer.render(dam, radius=0.025, scene=str(tmp_path / "scene.toml"), size=(160, 120))
    assert np.array_equal(again.rgba, picture.rgba)
    assert np.array_equal(again.radiance, picture.radiance)


def test_the_scene_of_a_picture_keeps_the_view(renderer, dam):
    picture = renderer.render(dam, size=SMALL)
    again = renderer.render(dam, scene=picture.scene, size=SMALL)
    assert again.scene._project.text() == picture.scene._project.text(), "nothing was missing in it"
    assert np.array_equal(picture.rgba, again.rgba)
    assert again.camera == picture.camera
    part = renderer.render(dam[: len(dam) // 2], scene=picture.scene, size=SMALL)
    assert part.camera == picture.camera and part.radius == picture.radius


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_camera_of_a_picture_is_in_the_world_of_the_positions(renderer, dam, up):
    """Without a scene, liquid and camera turn together, whichever axis is up."""
    positions = dam if up == "y" else dam[:, [0, 2, 1]] * np.float32([1, -1, 1])
    picture = renderer.render(positions, up=up, size=SMALL)
    again = renderer.render(positions, camera=picture.camera, size=SMALL)
    assert limpid.flip(picture, again)[0] < 1e-3
    expected = renderer.render(dam, up="y", size=SMALL)
    assert limpid.flip(picture, expected)[0] < 1e-3
    in_scene = renderer.render(positions, scene=picture.scene, camera=picture.camera, size=SMALL)
    assert limpid.flip(picture, in_scene)[0] < 1e-3
    assert in_scene.camera == picture.camera


def test_matrices_show_what_the_camera_shows(renderer, dam):
    camera = limpid.Camera((1.5, 1.2, 3.5), (0, 0.4, 0), 40)
    forward = np.subtract(camera.target, camera.eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = right, np.cross(right, forward), -forward
    view[:3, 3] = -view[:3, :3] @ camera.eye
    f, aspect, near, far = 1 / np.tan(np.radians(20)), SMALL[0] / SMALL[1], 0.004, 100.0
    opengl = np.array(
        [
            [f / aspect, 0, 0, 0],
            [0, f, 0, 0],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )
    webgpu = opengl.copy()
    webgpu[2] = [0, 0, -far / (far - near), -far * near / (far - near)]
    scene = limpid.Scene(look=None, environment=(0.5, 0.6, 0.8))
    expected = renderer.render(dam, scene=scene, camera=camera, size=SMALL)
    for projection, is_opengl in ((opengl, True), (webgpu, False)):
        seen = limpid.Camera.from_matrices(view, projection, opengl=is_opengl)
        assert np.allclose(seen.eye, camera.eye)
        picture = renderer.render(dam, scene=scene, camera=seen, size=SMALL)
        assert limpid.flip(expected, picture)[0] < 1e-3
        assert pickle.loads(pickle.dumps(seen)) == seen
    other = limpid.Camera.from_matrices(view @ np.diag([-1, 1, -1, 1]), webgpu)
    assert limpid.flip(expected, renderer.render(dam, scene=scene, camera=other, size=SMALL))[0] > 0.01


def test_orthographic_cameras_do_not_shrink_what_is_far(renderer):
    points = np.array([[-0.8, 0, 2], [0.8, 0, -2]])
    scene = limpid.Scene(look=None, environment=(1, 1, 1))
    camera = limpid.Camera.orthographic((0, 0, 5), (0, 0, 0), 3.0)
    picture = renderer.render(
        points, radius=0.3, scene=scene, camera=camera, size=(120, 90), aovs=["coverage"]
    )
    coverage = picture.aov["coverage"]
    left, right = coverage[:, :60].sum(), coverage[:, 60:].sum()
    assert left > 100 and abs(left - right) < 0.03 * left


def test_images_have_shapes_and_units(renderer, ball, scene):
    picture = renderer.render(
        ball, radius=0.05, velocities=np.tile([3.0, 0, 0], (len(ball), 1)), scene=scene, size=SMALL, aovs=["all"]
    )
    aov = picture.aov
    plane = {"depth", "front.depth", "back.depth", "coverage", "solid_depth", "inside", "iterations"}
    assert plane <= set(aov)
    assert {aov[name].shape for name in plane} == {(72, 96)}
    assert aov["normal"].shape == aov["front.normal"].shape == aov["radiance"].shape == (72, 96, 3)
    assert aov["motion"].shape == (72, 96, 2)
    # The ball of radius 0.7 m, seen from 4.12 m.
    assert aov["depth"][36, 48] == pytest.approx(np.hypot(4, 1) - 0.7, abs=0.05)
    assert np.allclose(np.linalg.norm(aov["normal"][36, 48]), 1, atol=1e-4)
    assert aov["inside"][36, 48] == pytest.approx(1.4, abs=0.2)
    # A thirtieth of a second at 3 m/s, to the right.
    assert aov["motion"][36, 48, 0] > 1 and abs(aov["motion"][36, 48, 1]) < 0.2
    with pytest.raises(KeyError, match="front.smooth"):
        aov["front.smooth"]
    one = renderer.render(ball, radius=0.05, scene=scene, size=SMALL, aovs=["front.depth"])
    assert set(one.aov) == {"front.depth"}
    assert np.array_equal(one.aov["front.depth"], aov["front.depth"])
    assert np.array_equal(one.rgba, picture.rgba), "images change no picture"


def test_radiance_is_kept_for_four_pictures(renderer, ball, scene):
    pictures = [renderer.render(ball, radius=0.05, scene=scene, size=SMALL) for _ in range(5)]
    assert pictures[-1].radiance.shape == (72, 96, 3)
    assert np.array_equal(pictures[-4].radiance, pictures[-1].radiance)
    with pytest.raises(limpid.Error, match="not kept"):
        pictures[0].radiance
    covered = renderer.render(ball, radius=0.05, scene=scene, size=SMALL, alpha=True)
    assert covered.radiance.shape == (72, 96, 4)
    assert set(np.unique(covered.rgba[..., 3])) >= {0, 255}
    assert (pictures[0].rgba[..., 3] == 255).all()


def test_pictures_are_arrays_files_and_notebook_outputs(renderer, ball, scene, tmp_path):
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    assert np.shares_memory(np.asarray(picture), picture.rgba) and picture.shape == picture.rgba.shape == (72, 96, 4)
    assert np.asarray(picture, dtype=np.float32).dtype == np.float32
    assert np.array(picture) is not picture.rgba
    assert picture._repr_png_().startswith(b"\x89PNG")
    for name in ("a.png", "a.jpg", "a.webp", "a.exr"):
        picture.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 100
    with pytest.raises(ValueError, match="ends in .png"):
        picture.save(tmp_path / "a.bmp")
    with pytest.raises(FileNotFoundError):
        picture.save(tmp_path / "no" / "a.png")
    with pytest.raises(OSError, match="dev"):
        picture.save("/dev/full")
    copy = pickle.loads(pickle.dumps(picture))
    assert np.array_equal(copy.rgba, picture.rgba)
    assert np.array_equal(copy.radiance, picture.radiance)
    image = pytest.importorskip("PIL.Image")
    assert np.array_equal(np.asarray(image.open(io.BytesIO(picture._repr_png_()))), picture.rgba[..., :3])
    assert np.array_equal(np.asarray(image.open(tmp_path / "a.png")), picture.rgba[..., :3])


def test_pictures_are_those_of_pillow(renderer, ball, scene):
    image = pytest.importorskip("PIL.Image")
    for alpha, mode in ((False, "RGB"), (True, "RGBA")):
        picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL, alpha=alpha)
        converted = picture.to_pil()
        assert converted.mode == mode and converted.size == SMALL
        assert np.array_equal(np.asarray(converted), picture.rgba[..., : len(mode)])
        assert np.array_equal(np.asarray(image.fromarray(picture)), picture.rgba)


def test_without_pillow_its_installation_is_named(renderer, ball, scene, monkeypatch):
    for name in ("PIL", "PIL.Image"):
        monkeypatch.setitem(sys.modules, name, None)
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    with pytest.raises(ImportError, match="pip install pillow"):
        picture.to_pil()


def test_file_objects_get_what_files_get(renderer, ball, scene, tmp_path):
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    for kind in ("png", "jpg", "webp"):
        picture.save(tmp_path / f"a.{kind}")
        buffer = io.BytesIO()
        picture.save(buffer, format=kind)
        assert buffer.getvalue() == (tmp_path / f"a.{kind}").read_bytes(), kind
    plain = io.BytesIO()
    picture.save(plain)
    assert plain.getvalue() == (tmp_path / "a.png").read_bytes(), "PNG by default"
    with open(tmp_path / "b.jpg", "wb") as file:
        picture.save(file)
    assert (tmp_path / "b.jpg").read_bytes() == (tmp_path / "a.jpg").read_bytes(), "by the file's name"
    picture.save(tmp_path / "picture", format="PNG")
    assert (tmp_path / "picture").read_bytes() == plain.getvalue()
    exr = io.BytesIO()
    picture.save(exr, format="exr")
    assert exr.getvalue().startswith(b"\x76\x2f\x31\x01")
    for wrong in ("bmp", 3, ""):
        with pytest.raises(ValueError, match="picture ends in|format is 3"):
            picture.save(io.BytesIO(), format=wrong)
    with pytest.raises(ValueError, match="holds no coverage"):
        renderer.render(ball, scene=scene, size=SMALL, alpha=True).save(io.BytesIO(), format="jpg")


def channels(path):
    """The parts of an OpenEXR file: their names, with the names of their channels."""
    data = path.read_bytes()
    at, parts = 8, []
    several = int.from_bytes(data[4:8], "little") & 0x1000
    while True:
        part, names = "", []
        while data[at] != 0:
            name, kind = (data[at:].split(b"\0", 2)[i].decode() for i in (0, 1))
            at += len(name) + len(kind) + 2
            size = int.from_bytes(data[at : at + 4], "little")
            value = data[at + 4 : at + 4 + size]
            at += 4 + size
            if name == "name":
                part = value.decode()
            elif name == "channels":
                while value[0] != 0:
                    names.append(value.split(b"\0", 1)[0].decode())
                    value = value[len(names[-1]) + 17 :]
        at += 1
        parts.append((part, names))
        if not several or data[at] == 0:
            return parts


def test_images_are_saved_with_the_radiance(renderer, program, root, tmp_path):
    """By the names that the program gives them."""
    source = root / "sims" / "demo.bgeo"
    program("render", source, "--size", "96x72", "--aov", "all", "-o", tmp_path / "a.png")
    expected = channels(tmp_path / "a.aov.exr")
    picture = renderer.render(source, size=SMALL, aovs="all")
    picture.save(tmp_path / "b.exr")
    (first, names), *others = channels(tmp_path / "b.exr")
    assert {"R", "G", "B"} < set(names)
    assert [(first, sorted(set(names) - {"R", "G", "B"})), *others] == expected
    picture = renderer.render(source, size=SMALL, aovs=["front.depth", "normal"], alpha=True)
    picture.save(tmp_path / "c.exr")
    ((_, names),) = channels(tmp_path / "c.exr")
    layers = [f"normal.{layer}.{axis}" for layer in ("aggregate_back", "aggregate_front") for axis in "XYZ"]
    assert {"A", "R", "depth.aggregate_front", "normal.X", *layers} <= set(names)
    picture.aov["front.depth"] = 3
    with pytest.raises(ValueError, match="aov.*was replaced"):
        picture.save(tmp_path / "d.exr")
    OpenEXR = pytest.importorskip("OpenEXR")
    with OpenEXR.File(str(tmp_path / "b.exr"), separate_channels=True) as file:
        pixels = file.channels()["depth.Z"].pixels
    assert np.array_equal(pixels, renderer.render(source, size=SMALL, aovs="depth").aov["depth"])


def test_radiance_can_be_kept(renderer, ball, scene):
    first = renderer.render(ball, radius=0.05, scene=scene, size=SMALL, keep_radiance=True)
    for _ in range(6):
        last = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    assert first.radiance.dtype == np.float32 and np.array_equal(first.radiance, last.radiance)


def test_pictures_are_shown_by_the_system(renderer, ball, scene, tmp_path, monkeypatch):
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    viewer = tmp_path / ("open" if sys.platform == "darwin" else "xdg-open")
    viewer.write_text(f'#!/bin/sh\ncp "$1" "{tmp_path}/seen.png"\n')
    viewer.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    picture.show()
    picture.save(tmp_path / "saved.png")
    assert (tmp_path / "seen.png").read_bytes() == (tmp_path / "saved.png").read_bytes()
    monkeypatch.setenv("PATH", "")
    with pytest.raises(limpid.Error, match="save it with"):
        picture.show()


def test_drawing_tells_how_far_it_is_and_can_be_stopped(renderer, dam):
    told = []
    renderer.render(dam, size=(320, 240), progress=lambda *x: told.append(x))
    assert told[-1] == (1, 1) and set(told[:-1]) <= {(0, 1)}
    views = [limpid.Camera((0, 1, 4), (0, 0, 0))] * 2
    renderer.render_views(dam, views, size=SMALL, progress=lambda *x: told.append(x))
    assert told[-1] == (2, 2)
    large = dict(size=(2048, 1536), samples=16)
    with pytest.raises(limpid.Cancelled):
        renderer.render(dam, **large, progress=lambda done, total: False)

    def fail(done, total):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        renderer.render(dam, **large, progress=fail)
    assert renderer.render(dam, size=SMALL).particles == len(dam), "the renderer goes on"


def test_flip_is_that_of_the_program(renderer, program, ball, scene, tmp_path):
    a = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    b = renderer.render(ball * 1.05, radius=0.05, scene=scene, size=SMALL)
    mean, image = limpid.flip(a, b)
    assert image.shape == (72, 96) and image.mean() == pytest.approx(mean, rel=1e-5) and mean > 0
    assert limpid.flip(a, a.rgba[..., :3])[0] == 0
    a.save(tmp_path / "a.png")
    b.save(tmp_path / "b.png")
    assert limpid.flip(tmp_path / "a.png", tmp_path / "b.png")[0] == mean
    text = program("compare", tmp_path / "a.png", tmp_path / "b.png").stdout
    assert f"mean FLIP {mean:.4f}" in text
    with pytest.raises(ValueError, match="size"):
        limpid.flip(a, b.rgba[:10])


def test_a_scene_of_a_picture_is_its_own(renderer, ball):
    scene = limpid.Scene(look=None, environment=(1, 1, 1), camera=limpid.Camera((0, 1, 4), (0, 0, 0)))
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    again = renderer.render(ball, scene=picture.scene, size=SMALL)
    picture.scene.ior = 2.0
    assert scene.ior != 2.0 and again.scene.ior != 2.0


def test_a_camera_with_z_up_says_so_from_the_front(renderer, dam):
    """As people look at a simulation of z up: along y, where the liquid's surface may not tell the axis."""
    positions = dam[:, [0, 2, 1]] * np.float32([1, -1, 1])
    camera = limpid.Camera((0, -5, 0.2), (0, 0, 0.2), up=(0, 0, 1))
    picture = renderer.render(positions, camera=camera, size=SMALL)
    expected = renderer.render(positions, camera=camera, up="z", size=SMALL)
    assert np.array_equal(picture.rgba, expected.rgba)
    other = renderer.render(positions, camera=camera, up="y", size=SMALL)
    assert limpid.flip(picture, other)[0] > 0.02


def test_the_unit_of_a_scene_s_files_is_not_that_of_arrays(renderer, ball, tmp_path):
    text = 'camera = { eye = [0, 1, 4], target = [0, 0, 0], fov_y = 40 }\nenvironment = { radiance = [1, 1, 1] }\n'
    (tmp_path / "m.toml").write_text(text)
    (tmp_path / "mm.toml").write_text(text + "[particles]\nscale = 0.001\n")
    a, b = (renderer.render(ball, radius=0.05, scene=tmp_path / f"{n}.toml", size=SMALL) for n in ("m", "mm"))
    assert np.array_equal(a.rgba, b.rgba) and a.camera == b.camera


def test_replaced_pixels_are_refused(renderer, ball, scene, tmp_path):
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL, alpha=True)
    for wrong in (picture.rgba[..., :3], picture.rgba[0], picture.rgba.astype(float), None):
        picture.rgba = wrong
        with pytest.raises(ValueError, match="rgba"):
            picture.save(tmp_path / "a.png")
        with pytest.raises(ValueError, match="rgba"):
            picture._repr_png_()


def test_a_good_picture_does_not_silence_the_next(renderer, dam):
    camera = limpid.Camera((0, 50, 5), (0, 90, 0))
    scene = limpid.Scene(look=None, environment=(1, 1, 1), camera=limpid.Camera((0, 1, 4), (0, 0, 0)))
    for keywords in (dict(), dict(scene=scene)):
        renderer.render(dam, size=SMALL, **keywords)
        with pytest.warns(limpid.LimpidWarning, match="move the camera") as caught:
            renderer.render(dam, camera=camera, size=SMALL, **keywords)
        assert caught[0].filename == __file__
    for _ in range(2):
        with pytest.warns(limpid.LimpidWarning, match="multiply them"):
            renderer.render(dam[::8], radius=1.5, scene=limpid.Scene(), size=SMALL)


def test_a_wrong_unit_is_told_once(renderer, dam):
    scene = limpid.Scene()
    with pytest.warns(limpid.LimpidWarning, match="multiply them by the unit's length") as caught:
        for _ in range(3):
            scene = renderer.render(dam[::8], radius=1.5, scene=scene, size=SMALL).scene
    assert len(caught) == 1
    with pytest.warns(limpid.LimpidWarning, match="move the camera"):
        renderer.render(dam, camera=limpid.Camera((0, 50, 5), (0, 90, 0)), size=SMALL)
