"""Parts of scenes can be read and assigned, absent ones are automatic, and nothing is lost silently."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest

import limpid
from conftest import SMALL
from test_scene import CUBE, FACES


def ground(scene):
    return [solid for solid in scene.solids if solid.ground is not None]


@pytest.mark.parametrize(
    ("target", "name", "meant"),
    [
        (limpid.Scene(), "lok", "look"),
        (limpid.Scene(), "iro", "ior"),
        (limpid.Particles(np.zeros((1, 3))), "velocity", "velocities"),
        (limpid.Scene().settings, "samples", None),
        (limpid.Scene().solids, "colour", None),
        (limpid.Sphere((0, 0, 0), 1), "radius", None),
        (limpid.Sphere((0, 0, 0), 1), "colour", None),
        (limpid.Sun((0, -1, 0)), "direktion", None),
        (limpid.Camera((0, 0, 1), (0, 0, 0)), "fov", None),
        (limpid.Camera((0, 0, 1), (0, 0, 0)), "eye", None),
    ],
)
def test_attributes_that_do_not_exist_cannot_be_assigned(target, name, meant):
    with pytest.raises(AttributeError) as caught:
        setattr(target, name, 3)
    assert name in str(caught.value)
    assert meant is None or f"did you mean {meant!r}" in str(caught.value)


def test_every_part_is_read_as_it_was_given():
    """Numbers without the noise of 32-bit floats."""
    texture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    given = dict(
        look="night",
        sky="daylight",
        floor=-0.1,
        ior=1.4,
        absorption=(0.1, 0.2, 0.3),
        tint_thickness=0.7,
        solids=[
            limpid.Sphere((0.1, 1, 0), 0.3, color=(0.1, 0.2, 0.3), lit=True),
            limpid.Box((0, 0, 0), (1, 1, 1), texture=texture, tile=0.3),
            limpid.Plane((0, 0.1, 0), (0, 1, 0), 2, checker=limpid.Checker(0.1)),
        ],
        lights=[limpid.Sun((0, -1, 0), (3, 2.9, 2.8)), limpid.PointLight((0, 1, 0), (1, 2, 0.1))],
        background=texture,
        camera=limpid.Camera((0.1, 1, 4), (0, 0, 0), 35.1),
        settings={"refract.samples": 4, "tonemap.exposure": 0.1},
    )
    scene = limpid.Scene(**given)
    for name in ("look", "sky", "floor", "ior", "absorption", "tint_thickness", "camera"):
        assert getattr(scene, name) == given[name], name
    assert [type(solid) for solid in scene.solids] == [limpid.Sphere, limpid.Box, limpid.Plane]
    assert scene.solids[0] == given["solids"][0]
    assert np.array_equal(scene.solids[1].texture[..., :3], texture) and scene.solids[1].tile == 0.3
    assert scene.solids[2].checker == limpid.Checker(0.1)
    assert list(scene.lights) == given["lights"]
    assert np.array_equal(scene.background[..., :3], texture)
    assert scene.settings["refract.samples"] == 4 and scene.settings["tonemap.exposure"] == 0.1
    for environment in (
        limpid.Gradient((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0, 0, 0.1)),
        limpid.Sky((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0, 0, 0.1), (limpid.Glow((0, 1, 0), (3, 3, 0.1), 20.1),)),
        (0.1, 0.2, 0.3),
    ):
        assert limpid.Scene(environment=environment).environment == environment
    pixels = np.random.default_rng(1).random((4, 8, 3), np.float32)
    assert np.array_equal(limpid.Scene(environment=pixels).environment, pixels)


def test_assigning_is_giving(renderer, ball):
    """A part that is assigned makes the scene that it makes if it is given."""
    mesh = limpid.Mesh(vertices=CUBE, faces=FACES, scale=0.2, translate=(1, 0, 0))
    pixels = np.random.default_rng(1).random((4, 8, 3), np.float32)
    for name, value in {
        "look": "night",
        "sky": "pool",
        "floor": -1.5,
        "ior": 1.5,
        "absorption": (0.1, 0.2, 0.3),
        "color": (0.1, 0.2, 0.3),
        "tint_thickness": 0.1,
        "solids": [mesh],
        "lights": [limpid.Sun((0, -1, 0))],
        "environment": pixels,
        "camera": limpid.Camera((0, 1, 4), (0, 0, 0)),
        "settings": {"refract.samples": 4},
    }.items():
        given, assigned = limpid.Scene(**{name: value}), limpid.Scene()
        assert given != assigned, name
        setattr(assigned, name, value)
        assert given == assigned, name
        assert pickle.loads(pickle.dumps(assigned)) == given, name
        if name not in ("ior", "settings", "solids"):
            setattr(assigned, name, None)
            assert assigned == limpid.Scene(), name
    with pytest.raises(limpid.SceneError, match="ior is 9; expected a number from 0.3 to 3"):
        assigned.ior = 9


def test_solids_and_lights_are_lists():
    scene = limpid.Scene()
    scene.solids.append(limpid.Sphere((0, 0, 0), 0.1))
    scene.solids += [limpid.Mesh(vertices=CUBE, faces=FACES), limpid.Mesh(vertices=2 * CUBE, faces=FACES)]
    scene.solids.insert(0, limpid.Plane())
    assert [type(solid).__name__ for solid in scene.solids] == ["Plane", "Sphere", "Mesh", "Mesh"]
    with pytest.raises(ValueError, match="read-only"):
        scene.solids[2].vertices[0] = 7
    assert list(scene._arrays.meshes) == ["mesh-array-1", "mesh-array-2"], "arrays are kept once"
    del scene.solids[2]
    assert np.array_equal(scene.solids[2].vertices, 2 * CUBE) and len(scene.solids) == 3
    scene.solids[1] = limpid.Sphere((0, 0, 0), 0.2)
    assert scene.solids[1].radius == 0.2
    with pytest.raises(ValueError, match=r"solids\[3\] is 7"):
        scene.solids.append(7)
    assert len(scene.solids) == 3, "a bad value changes nothing"
    scene.lights.append(limpid.Sun((0, -1, 0)))
    assert scene.lights == [limpid.Sun((0, -1, 0))]
    scene.solids.clear()
    assert not scene.solids


def test_absent_parts_are_automatic(renderer, ball):
    """One solid, light, sky or setting leaves the rest of the look; only without one the scene is complete."""
    for keywords in (
        dict(solids=[limpid.Sphere((1, 0, 0), 0.2)]),
        dict(lights=[limpid.Sun((0, -1, 0))]),
        dict(sky="daylight"),
        dict(settings={"tonemap.exposure": 1}),
        dict(environment=(1, 1, 1), solids=[limpid.Sphere((1, 0, 0), 0.2)]),
        dict(environment=(1, 1, 1), floor=-0.8),
    ):
        used = renderer.render(ball, radius=0.05, scene=limpid.Scene(**keywords), size=SMALL).scene
        assert len(ground(used)) == 1 and len(used.lights) == 1, keywords
        assert used.settings["tonemap.curve"] == "aces", keywords
    assert used.floor == -0.8
    for keywords in (dict(environment=(1, 1, 1), look=None), dict(floor="none")):
        used = renderer.render(ball, radius=0.05, scene=limpid.Scene(**keywords), size=SMALL).scene
        assert not ground(used), keywords
    day, night = (
        renderer.render(ball, radius=0.05, scene=limpid.Scene(look="night", sky=sky), size=SMALL).scene
        for sky in ("daylight", None)
    )
    assert day.environment.zenith != night.environment.zenith and day.lights == night.lights
    with pytest.raises(limpid.SceneError, match="sky"):
        limpid.Scene(sky="daylight", environment=(1, 1, 1))


def test_a_finished_scene_gets_another_look_floor_or_solid(renderer, ball):
    used = renderer.render(ball, radius=0.05, size=SMALL).scene
    scene = used.copy()
    scene.solids.append(limpid.Sphere((1, 0, 0), 0.2))
    assert len(ground(scene)) == 1 and len(scene.solids) == 2 and scene.environment == used.environment
    scene.floor = -2
    assert [solid.origin[1] for solid in ground(scene)] == [-2] and scene.floor == -2
    scene.floor = "none"
    assert not ground(scene) and len(scene.solids) == 1
    scene = used.copy()
    scene.look = "night"
    night = renderer.render(ball, radius=0.05, scene=scene, size=SMALL).scene
    expected = renderer.render(ball, radius=0.05, scene=limpid.Scene(look="night"), size=SMALL).scene
    assert night.environment == expected.environment and night.lights == expected.lights
    assert len(ground(night)) == 1 and night.camera == used.camera
    for clear in (scene, night):
        clear.look = "paint"
        assert renderer.render(ball, radius=0.05, scene=clear, size=SMALL).scene.absorption is None, "it is opaque"


def test_values_that_are_assigned_to_automatic_scenes_are_drawn(renderer, ball):
    """Those that the look would provide, too."""
    scene = limpid.Scene()
    scene.absorption = (0, 0, 7)
    scene.settings["tonemap.exposure"] = 1.5
    scene.settings["caustics.blur"] = 0.5
    used = renderer.render(ball, radius=0.05, scene=scene, size=SMALL).scene
    assert used.absorption == (0, 0, 7)
    assert used.settings["tonemap.exposure"] == 1.5 and used.settings["tonemap.curve"] == "aces"
    assert used.settings["caustics.blur"] == 0.5


def test_arrays_become_files_beside_a_saved_scene(renderer, ball, tmp_path):
    rng = np.random.default_rng(3)
    texture = rng.integers(0, 256, (4, 4, 4), np.uint8)
    coordinates = rng.random((len(CUBE), 2))
    cube = dict(vertices=CUBE / 3, faces=FACES, coordinates=coordinates)
    scene = limpid.Scene(
        look=None,
        environment=rng.random((4, 8, 3), np.float32),
        background=texture,
        solids=[
            limpid.Mesh(**cube, texture=texture, scale=0.5, translate=(1, 0, 0)),
            limpid.Mesh(vertices=CUBE / 7, faces=FACES, translate=(-1, 0, 0), color=(0.1, 0.2, 0.3)),
            limpid.Plane((0, -1, 0), half_extent=2, texture=texture),
        ],
        camera=limpid.Camera((0, 1, 4), (0, 0, 0)),
    )
    for _ in "it is replaced", "the second time":
        scene.save(tmp_path / "a.toml")
    files = {path.name for path in tmp_path.iterdir()}
    assert {"a.toml", "a.environment.exr", "a.mesh-1.ply", "a.mesh-2.ply", "a.texture-1.png"} <= files
    loaded = limpid.Scene.load(tmp_path / "a.toml")
    assert "mesh-array" not in (tmp_path / "a.toml").read_text()
    a, b = (renderer.render(ball, radius=0.05, scene=s, size=SMALL) for s in (scene, loaded))
    assert np.array_equal(a.rgba, b.rgba)


def test_scenes_are_text_tables_and_values(renderer, ball, tmp_path):
    scene = limpid.Scene(
        look="pool", ior=1.4, solids=[limpid.Sphere((0, 1, 0), 0.1)], camera=limpid.Camera((0, 1, 4), (0, 0, 0))
    )
    text = scene.to_toml()
    assert "0.1\n" in text and "0.10000000" not in text
    (tmp_path / "a.toml").write_text(text)
    assert limpid.Scene.load(tmp_path / "a.toml") == scene == scene.copy()
    scene.save(tmp_path / "b.toml")
    assert "00000" not in (tmp_path / "b.toml").read_text()
    tables = {
        "look": "pool",
        "liquid": {"ior": 1.4},
        "solid": [{"shape": "sphere", "center": [0, 1, 0], "radius": np.float64(0.1)}],
        "camera": {"eye": np.array([0, 1, 4]), "target": (0, 0, 0), "fov_y": 40, "up": [0, 1, 0]},
    }
    assert limpid.Scene.from_dict(tables) == scene
    drawn = [renderer.render(ball, radius=0.05, scene=s, size=SMALL).rgba for s in (scene, tables)]
    assert np.array_equal(*drawn)
    assert limpid.Scene.from_dict(json.loads(json.dumps({"look": "night"}))) == limpid.Scene(look="night")
    assert scene != limpid.Scene(look="pool") and scene != 3
    with pytest.raises(limpid.SceneError, match="iour"):
        limpid.Scene.from_dict({"liquid": {"iour": 1.3}})
    with pytest.raises(ValueError, match="the tables of a scene file"):
        renderer.render(ball, scene=3)
    with pytest.raises(ValueError, match="save writes"):
        limpid.Scene(solids=[limpid.Mesh(vertices=CUBE, faces=FACES)]).to_toml()


class Trimesh:
    vertices, faces = CUBE, FACES


class Open3d:
    vertices, triangles = CUBE, FACES


class PyVista:
    points = CUBE
    is_all_triangles = True
    faces = np.column_stack([np.full(len(FACES), 3), FACES]).ravel()


class Grid:
    """As PyVista's UnstructuredGrid, which has no faces of its own."""

    points = CUBE

    def extract_surface(self):
        return PyVista()


@pytest.mark.parametrize("kind", [Trimesh, Open3d, PyVista, Grid])
def test_meshes_of_other_packages_are_meshes(kind):
    scene = limpid.Scene(solids=[limpid.Mesh(kind(), color=(1, 0, 0))])
    assert scene == limpid.Scene(solids=[limpid.Mesh(vertices=CUBE, faces=FACES, color=(1, 0, 0))])
    with pytest.raises(ValueError, match=r"solids\[0\].file is <object.*expected a path, or a mesh of trimesh"):
        limpid.Scene(solids=[limpid.Mesh(object())])


def test_meshes_take_vertices_and_faces_in_this_order():
    assert limpid.Scene(solids=[limpid.Mesh(CUBE, FACES)]) == limpid.Scene(
        solids=[limpid.Mesh(vertices=CUBE, faces=FACES)]
    )
    # As PyVista writes triangles.
    counted = np.insert(np.array(FACES), 0, 3, axis=1).ravel()
    for mesh, problem in (
        (limpid.Mesh(FACES, np.array(CUBE, float)), r"faces has the dtype float64; .*vertices before faces"),
        (limpid.Mesh(CUBE, np.zeros((6, 4), int)), r"faces has the shape \(6, 4\); .*three for each triangle.*\(f, 3\)$"),
        (limpid.Mesh(CUBE, counted), r"faces has the shape \(48,\); .*, as faces.reshape\(-1, 4\)\[:, 1:\]"),
        (limpid.Mesh(np.array(CUBE).T, FACES), r"vertices has the shape \(3, 8\); expected \(v, 3\)"),
        (limpid.Mesh(CUBE), "a Mesh takes vertices and faces together"),
        (limpid.Mesh(CUBE, FACES, coordinates=[(0, 0)]), "coordinates has 1 rows for 8 vertices; expected as many"),
    ):
        with pytest.raises(ValueError, match=rf"solids\[0\].*{problem}"):
            limpid.Scene(solids=[mesh])


def test_meshes_of_pyvista_are_meshes():
    pyvista = pytest.importorskip("pyvista")
    for shape in (pyvista.Cube(), pyvista.Cube().triangulate(), pyvista.Cube().cast_to_unstructured_grid()):
        scene = limpid.Scene(solids=[limpid.Mesh(shape)])
        assert np.shape(scene.solids[0].faces) == (12, 3)
