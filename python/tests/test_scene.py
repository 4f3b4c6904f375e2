"""Scenes are drawn as they are given, and problems of those that cannot be drawn are named."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import limpid
from conftest import SMALL

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([face for a, b, c, d in QUADS for face in ((a, b, c), (a, c, d))])


def obj(path):
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    path.write_text("\n".join(lines))


def test_meshes_from_arrays_are_meshes_from_files(renderer, ball, tmp_path):
    obj(tmp_path / "cube.obj")
    more = dict(color=(0.7, 0.2, 0.2), translate=(0.9, 0, 0.5), scale=0.3)

    def drawn(mesh):
        scene = limpid.Scene(look=None, environment=(0.7, 0.8, 0.9), solids=[mesh], camera=limpid.Camera((0, 1, 4), (0, 0, 0)))
        return renderer.render(ball, radius=0.05, scene=scene, size=SMALL).rgba

    a = drawn(limpid.Mesh(tmp_path / "cube.obj", **more))
    b = drawn(limpid.Mesh(vertices=CUBE, faces=FACES, **more))
    assert np.array_equal(a, b)
    empty = limpid.Scene(look=None, environment=(0.7, 0.8, 0.9), camera=limpid.Camera((0, 1, 4), (0, 0, 0)))
    assert not np.array_equal(a, renderer.render(ball, radius=0.05, scene=empty, size=SMALL).rgba)


def test_environment_maps_from_arrays_have_minus_z_in_the_middle(renderer):
    pixels = np.zeros((32, 64, 3), np.float32)
    pixels[12:20, 28:36] = (1, 0, 0)
    pixels[:4] = (0, 1, 0)
    camera = limpid.Camera((0, 0, 0), (0, 0, -1))
    scene = limpid.Scene(look=None, environment=pixels, camera=camera)
    picture = renderer.render([], scene=scene, size=SMALL)
    assert picture.radiance[36, 48].tolist() == pytest.approx([1, 0, 0], abs=1e-3)
    up = renderer.render([], scene=scene, camera=limpid.Camera((0, 0, 0), (0, 1, 0), up=(0, 0, 1)), size=SMALL)
    assert up.radiance[36, 48].tolist() == pytest.approx([0, 1, 0], abs=1e-3)


def test_textures_from_arrays_are_drawn(renderer):
    texture = np.zeros((4, 4, 3), np.uint8)
    texture[..., 2] = 255
    plane = limpid.Plane((0, 0, 0), half_extent=2, texture=texture)
    scene = limpid.Scene(look=None, environment=(1, 1, 1), solids=[plane], camera=limpid.Camera((0, 3, 3), (0, 0, 0)))
    picture = renderer.render([], scene=scene, size=SMALL)
    assert picture.rgba[36, 48, 2] > 150 and picture.rgba[36, 48, 0] < 20


def test_settings_are_a_mapping(renderer, ball, scene):
    own = limpid.Scene(look=None, environment=(1, 1, 1), settings={"refract.samples": 2})
    assert own.settings["refract.samples"] == 2
    own.settings["refract.solver"] = "march"
    own.settings.update({"smooth.iterations": 1, "classify.on": "cpu"})
    assert own.settings["refract.solver"] == "march" and own.settings["classify.on"] == "cpu"
    assert len(list(own.settings)) == len(own.settings) == len(dict(own.settings))
    with pytest.raises(limpid.SceneError, match="did you mean `samples`"):
        own.settings["refract.sample"] = 1
    with pytest.raises(limpid.SceneError):
        own.settings["refract.samples"] = 1000
    assert own.settings["refract.samples"] == 2, "a bad value changes nothing"
    with pytest.raises(KeyError):
        own.settings["refract.nothing"]
    own.settings["preset"] = "imai2016"
    assert own.settings["refract.solver"] != "march"


BAD = {
    "absorption": dict(absorption=(-1, 0, 0)),
    "ior": dict(ior=9),
    r"^solids\[1\]: radius must be above 0": dict(
        solids=[limpid.Plane(), limpid.Sphere((0, 0, 0), -1)]
    ),
    r"^Scene: solid at most 512": dict(solids=[limpid.Plane()] * 513),
    r"^solids\[0\].vertices: row 1 is \[nan": dict(
        solids=[limpid.Mesh(vertices=[(0, 0, 0), (np.nan, 0, 0), (0, 1, 0)], faces=[(0, 1, 2)])]
    ),
    r"^solids\[0\]: .*triangle": dict(
        solids=[limpid.Mesh(vertices=np.zeros((3, 3)), faces=[(0, 1, 2)])]
    ),
    "ior is '1.5'": dict(ior="1.5"),
    "settings is": dict(settings=["a"]),
    "is not the name of a setting": dict(settings={"refract.samples=4\nx": 1}),
    "a Mesh takes a file, or vertices": dict(solids=[limpid.Mesh()]),
    "faces: face 0 is": dict(solids=[limpid.Mesh(vertices=CUBE, faces=[(0, 1, 9)])]),
    "faces has the dtype": dict(solids=[limpid.Mesh(vertices=CUBE, faces=[(0.5, 1, 2)])]),
    r"solids\[0\] is 7": dict(solids=[7]),
    "solids is 7": dict(solids=7),
    r"lights\[0\] is 'sun'": dict(lights=["sun"]),
    "direction": dict(lights=[limpid.Sun((0, 0, 0))]),
    "environment": dict(environment=np.full((2, 4, 3), np.nan)),
    "look": dict(look="dusk"),
    "absorption is .* expected 3 numbers": dict(absorption=(1, 2, 3, 4)),
    r"solids\[0\].checker is 0.2; expected a limpid.Checker": dict(solids=[limpid.Plane(checker=0.2)]),
    r"solids\[1\].color is 'blue'; expected 3 numbers": dict(
        solids=[limpid.Plane(), limpid.Plane(color="blue")]
    ),
    r"lights\[0\].irradiance is 3.0": dict(lights=[limpid.Sun((0, -1, 0), 3.0)]),
    r"solids\[0\].keys has 4; expected a limpid.Key": dict(solids=[limpid.Plane(keys=[4])]),
    "takes one of absorption and color": dict(absorption=(1, 2, 3), color=(1, 1, 1)),
    "takes one of color, checker": dict(solids=[limpid.Plane(color=(1, 1, 1), checker=limpid.Checker(1))]),
    "printable": dict(look="a\nb"),
}


@pytest.mark.parametrize("problem", BAD)
def test_bad_scenes_are_named(problem):
    with pytest.raises(ValueError, match=problem) as caught:
        limpid.Scene(**BAD[problem])
    text = str(caught.value)
    assert "\n" not in text and "--" not in text
    assert not any(word in text for word in ("line ", "[[", "f32", "u32", "struct"))


def test_files_that_are_missing_are_os_errors(tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        limpid.Scene.load(tmp_path / "none.toml")
    assert caught.value.filename == str(tmp_path / "none.toml")
    with pytest.raises(FileNotFoundError):
        limpid.Scene(solids=[limpid.Mesh(tmp_path / "none.obj")])
    with pytest.raises(limpid.FileError):
        (tmp_path / "bad.obj").write_text("v 1 2\n")
        limpid.Scene(solids=[limpid.Mesh(tmp_path / "bad.obj")])
    (tmp_path / "bad.toml").write_text("[liquid]\niour = 2\n")
    with pytest.raises(limpid.SceneError, match="line 2.*did you mean `ior`"):
        limpid.Scene.load(tmp_path / "bad.toml")


def test_scenes_are_pickled(renderer, ball):
    scene = limpid.Scene(
        look=None,
        environment=np.full((4, 8, 3), 0.5, np.float32),
        solids=[limpid.Mesh(vertices=CUBE, faces=FACES, scale=0.2, translate=(1, 0, 0), color=(0.2, 0.3, 0.4))],
        camera=limpid.Camera((0, 1, 4), (0, 0, 0)),
        settings={"refract.interfaces": 2},
    )
    scene.settings["smooth.iterations"] = 1
    picture = renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    for copy in (pickle.loads(pickle.dumps(scene)), pickle.loads(pickle.dumps(picture)).scene):
        again = renderer.render(ball, radius=0.05, scene=copy, size=SMALL)
        assert np.array_equal(picture.rgba, again.rgba)


def test_values_of_a_scene_change_and_copies_do_not():
    scene = limpid.Scene(ior=1.4)
    other = scene.copy()
    other.ior = 1.5
    other.absorption = np.array([1.0, 2.0, 3.0])
    other.settings["refract.samples"] = 4
    assert (round(scene.ior, 3), round(other.ior, 3)) == (1.4, 1.5)
    assert other.absorption == (1, 2, 3) and scene.absorption != other.absorption
    assert scene.settings["refract.samples"] == 1
    with pytest.raises(limpid.SceneError, match="ior"):
        other.ior = 7


def test_solids_move_by_keys(renderer):
    keys = [limpid.Key(0, translate=(0, 0, 0)), limpid.Key(10, translate=(2, 0, 0))]
    scene = limpid.Scene(
        look=None,
        environment=(1, 1, 1),
        solids=[limpid.Sphere((-1, 0, 0), 0.4, color=(0, 0, 0), keys=keys)],
        camera=limpid.Camera((0, 0, 5), (0, 0, 0)),
    )
    first = renderer.render([], scene=scene, size=SMALL, frame=0).rgba[36, :, 0]
    last = renderer.render([], scene=scene, size=SMALL, frame=10).rgba[36, :, 0]
    assert first.argmin() < 48 < last.argmin()


def test_cameras_are_values():
    camera = limpid.Camera((1, 2, 3), (0, 0, 0), 35, up=(0, 0, 1))
    assert camera == limpid.Camera(np.array([1, 2, 3.0]), [0, 0, 0], fov_y=35, up=(0, 0, 1))
    assert camera != camera.turned(90) and hash(camera) == hash(pickle.loads(pickle.dumps(camera)))
    assert pickle.loads(pickle.dumps(camera)) == camera
    assert eval(repr(camera), {"Camera": limpid.Camera}) == camera
    parallel = limpid.Camera.orthographic((0, 0, 5), (0, 0, 0), 3)
    assert parallel.height == 3 and parallel.fov_y is None and pickle.loads(pickle.dumps(parallel)) == parallel
    for bad in (dict(eye=(0, 0, 0)), dict(fov_y=0), dict(fov_y=float("nan")), dict(up=(1, 2, 3)), dict(near=-1)):
        with pytest.raises(limpid.SceneError):
            limpid.Camera(**{"eye": (1, 2, 3), "target": (0, 0, 0), **bad})
    with pytest.raises(limpid.SceneError, match="rotation"):
        limpid.Camera.from_matrices(2 * np.eye(4), np.eye(4))
