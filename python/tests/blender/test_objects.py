"""Particles of objects: particle systems, point clouds, Geometry Nodes and vertices."""

import numpy as np
import pytest

import limpid

from blender_tools import DAM, difference, flood, material, program_picture, render, sphere

# After the tools, which skip these tests without it.
import bpy

TURN = (0.3, -0.2, 0.5)


@pytest.fixture
def drawn(monkeypatch):
    """The calls of `Renderer.render`."""
    calls = []
    draw = limpid.Renderer.render

    def recorded(self, positions, **options):
        calls.append((positions, options))
        return draw(self, positions, **options)

    monkeypatch.setattr(limpid.Renderer, "render", recorded)
    return calls


def points(name, positions, **attributes):
    """A mesh object of vertices alone, moved and turned, with float and vector attributes."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, row)) for row in positions], [], [])
    for key, rows in attributes.items():
        rows = np.asarray(rows, np.float32)
        kind, field = ("FLOAT_VECTOR", "vector") if rows.ndim == 2 else ("FLOAT", "value")
        if rows.ndim == 2 and rows.shape[1] == 4:
            kind, field = "FLOAT_COLOR", "color"
        mesh.attributes.new(key, kind, "POINT").data.foreach_set(field, rows.ravel())
    thing = bpy.data.objects.new(name, mesh)
    thing.location, thing.rotation_euler, thing.scale = (0.1, 0.2, 0.3), TURN, (2, 2, 2)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.limpid.source = "OBJECT"
    bpy.context.scene.limpid.object = thing
    return thing


def in_limpid(thing, rows, moved=True):
    """Positions, or directions, of an object in limpid's world."""
    bpy.context.view_layer.update()
    matrix = np.array(thing.matrix_world)
    world = np.asarray(rows) @ matrix[:3, :3].T + moved * matrix[:3, 3]
    return world[:, [0, 2, 1]] * (1, 1, -1)


def nodes(thing, build):
    """A Geometry Nodes modifier; `build` makes its nodes from the input's socket."""
    group = bpy.data.node_groups.new("nodes", "GeometryNodeTree")
    for side in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=side, socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    made = build(group, start.outputs[0])
    group.links.new(made, end.inputs[0])
    thing.modifiers.new("nodes", "NODES").node_group = group


def to_points(group, geometry):
    node = group.nodes.new("GeometryNodeMeshToPoints")
    node.inputs["Radius"].default_value = 0.03
    group.links.new(geometry, node.inputs[0])
    return node.outputs[0]


def to_balls(group, geometry):
    node = group.nodes.new("GeometryNodeInstanceOnPoints")
    ball = group.nodes.new("GeometryNodeMeshIcoSphere")
    ball.inputs["Radius"].default_value = 0.04
    ball.inputs["Subdivisions"].default_value = 3
    group.links.new(geometry, node.inputs["Points"])
    group.links.new(ball.outputs[0], node.inputs["Instance"])
    return node.outputs[0]


SOURCES = {"vertices": (None, None), "points": (to_points, 0.06), "instances": (to_balls, 0.08)}


@pytest.mark.parametrize(("build", "radius"), SOURCES.values(), ids=SOURCES.keys())
def test_what_an_object_is_made_of_is_the_liquid(scene, tmp_path, drawn, build, radius):
    flood(scene)
    places = np.random.default_rng(1).uniform(-0.3, 0.3, (200, 3))
    thing = points("water", places, velocity=np.tile((0, 0, -2.0), (200, 1)))
    scene.limpid.radius = 0.0 if radius else 0.05
    if build:
        nodes(thing, build)
    render(scene, tmp_path / "picture.exr")
    found, options = drawn[-1]
    assert np.allclose(found.positions, in_limpid(thing, places), atol=1e-6)
    if build is not to_balls:
        velocities = in_limpid(thing, np.tile((0, 0, -2.0), (200, 1)), moved=False)
        assert np.allclose(found.velocities, velocities, atol=1e-6)
    if radius:
        assert np.allclose(found.radii, radius, rtol=0.02)
    # Its surface is no obstacle: the head and the floor are.
    assert len(scene_meshes(scene, tmp_path)) == 2


def scene_meshes(scene, folder):
    assert bpy.ops.limpid.save_scene(filepath=str(folder / "scene.toml")) == {"FINISHED"}
    return sorted(path.name for path in (folder / "scene_meshes").iterdir())


def test_an_object_is_drawn_as_its_file_is(scene, tmp_path):
    flood(scene)
    scene.limpid.radius = 0.0
    expected = render(scene, tmp_path / "file.exr")
    dam = limpid.read(DAM)
    thing = points("water", dam.positions[:, [0, 2, 1]] * np.float32([1, -1, 1]))
    thing.matrix_world.identity()
    thing.location, thing.rotation_euler, thing.scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    drawn = render(scene, tmp_path / "object.exr")
    print(difference(expected, drawn))
    assert difference(expected, drawn) < 1e-3
    png, program = program_picture(scene, tmp_path)
    assert difference(program, drawn[..., :3]) < 0.002
    assert (tmp_path / "scene_particles.npz").exists()


def emitter(scene, count, velocity):
    """A particle system that has sent all its particles along +x by frame 1."""
    bpy.ops.mesh.primitive_plane_add(size=0.5, rotation=(0, np.pi / 2, 0))
    thing = bpy.context.object
    thing.modifiers.new("drops", "PARTICLE_SYSTEM")
    settings = thing.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end = count, 1, 1.0
    settings.lifetime, settings.normal_factor = 100, velocity
    settings.effector_weights.gravity = 0.0
    scene.limpid.source, scene.limpid.object = "OBJECT", thing
    scene.limpid.radius = 0.05
    return thing


@pytest.mark.parametrize("rate", [24, 50])
def test_a_particle_system_is_the_liquid(scene, tmp_path, drawn, rate):
    scene.render.fps = rate
    emitter(scene, 30, 1.5)
    for frame in (1, 2, 3, 4, 5):
        scene.frame_set(frame)
        render(scene, tmp_path / "drops.png")
    (before, _), (found, _) = drawn[-2:]
    assert len(found) == 30
    moved = (found.positions - before.positions) * rate
    print(moved.mean(axis=0), found.velocities.mean(axis=0))
    assert np.allclose(moved, found.velocities, rtol=1e-3, atol=1e-3)
    assert found.velocities[:, 0].mean() == pytest.approx(1.5 * 0.04 * rate, rel=0.02)


def test_before_any_particles_there_is_no_liquid(scene, tmp_path, capfd):
    flood(scene)
    thing = emitter(scene, 30, 1.5)
    settings = thing.particle_systems[0].settings
    settings.frame_end = settings.frame_start = 10
    settings.frame_end = 20
    scene.frame_set(1)
    render(scene, tmp_path / "dry.png")
    printed = "".join(capfd.readouterr())
    assert "no liquid, as the object has no particles at this frame: Plane" in printed


def test_attributes_colour_the_liquid(scene, tmp_path, drawn):
    flood(scene)
    dam = limpid.read(DAM).positions
    rows = dam[:, [0, 2, 1]] * np.float32([1, -1, 1])
    paint = np.where(dam[:, :1] > 0.0, (1.0, 0.1, 0.1, 1.0), (0.1, 0.1, 1.0, 1.0))
    thing = points("water", rows, heat=20 + 60 * dam[:, 1], paint=paint)
    thing.location, thing.rotation_euler, thing.scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    settings = scene.limpid
    settings.radius, settings.attribute, settings.colormap = 0.025, "heat", "TURBO"
    settings.range = (20, 50)
    render(scene, tmp_path / "heat.png")
    _, options = drawn[-1]
    assert options["colormap"] == "turbo" and tuple(options["range"]) == (20, 50)
    assert np.allclose(options["values"], 20 + 60 * dam[:, 1], rtol=1e-5)
    settings.attribute = "paint"
    render(scene, tmp_path / "paint.png")
    assert np.allclose(drawn[-1][1]["colors"], paint[:, :3], atol=1e-5)
    settings.attribute = "head"
    with pytest.raises(RuntimeError, match="no attribute head; there are: .*heat, paint"):
        render(scene, tmp_path / "none.png")
    limpid.write(tmp_path / "v.npz", dam, velocities=dam)
    settings.source, settings.particles = "FILE", str(tmp_path / "v.npz")
    settings.attribute = "velocity"
    render(scene, tmp_path / "velocity.png")
    assert np.allclose(drawn[-1][1]["values"], dam)


def test_the_radius_of_an_animation_is_that_of_its_first_frame(scene, tmp_path, drawn):
    flood(scene)
    dam = limpid.read(DAM).positions
    thing = points("water", dam[:, [0, 2, 1]] * np.float32([1, -1, 1]))
    for frame, scale in ((1, 1.0), (2, 1.5)):
        thing.scale = (scale, scale, scale)
        thing.keyframe_insert("scale", frame=frame)
    scene.limpid.radius = 0.0
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.filepath = str(tmp_path / "w")
    bpy.ops.render.render(animation=True)
    assert drawn[0][1]["radius"] is None and 0.01 < drawn[1][1]["radius"] < 0.04
    # The next render starts anew.
    bpy.ops.render.render()
    assert drawn[2][1]["radius"] is None


def test_an_object_that_gives_nothing_is_reported(scene, tmp_path):
    scene.limpid.source = "OBJECT"
    with pytest.raises(RuntimeError, match="no particles: choose an object"):
        render(scene, tmp_path / "none.png")
    thing = points("water", [(0, 0, 0), (1, 0, 0)], radius=[0.1, 0.0])
    with pytest.raises(RuntimeError, match="water: 1 particles have no radius"):
        render(scene, tmp_path / "none.png")
    sphere("other", (0, 0, 0), 0.2, material("other", (1, 1, 1)))
    thing.hide_render = True
    render(scene, tmp_path / "hidden.png")
