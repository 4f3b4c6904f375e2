"""Bridges to VTK and PyVista, with the real ones."""

from __future__ import annotations

import os

import numpy as np
import pytest

import limpid
from conftest import SMALL

if os.environ.get("LIMPID_REQUIRE_PYVISTA"):
    import pyvista
else:
    pyvista = pytest.importorskip("pyvista")


@pytest.fixture
def cloud(ball):
    cloud = pyvista.PolyData(ball)
    cloud.point_data["velocity"] = ball * 2
    cloud.point_data["radius"] = np.full(len(ball), 0.05)
    cloud.point_data["id"] = np.arange(len(ball), dtype=np.int32)
    cloud.point_data["temperature"] = np.ones(len(ball))
    return cloud


def test_points_and_their_arrays(renderer, ball, scene, cloud):
    particles = limpid.from_vtk(cloud)
    assert np.array_equal(particles.positions, ball)
    assert np.array_equal(particles.velocities, ball * 2)
    assert np.allclose(particles.radii, 0.05) and particles.ids.dtype == np.int64
    assert np.shares_memory(particles.positions, cloud.points), "nothing is copied before render"
    drawn = renderer.render(particles, scene=scene, size=SMALL)
    expected = renderer.render(ball, radius=np.full(len(ball), 0.05), scene=scene, size=SMALL)
    assert np.array_equal(drawn.rgba, expected.rgba)
    assert len(limpid.from_vtk(pyvista.PolyData())) == 0
    grid = cloud.cast_to_unstructured_grid()
    assert np.array_equal(limpid.from_vtk(grid).positions, ball)
    with pytest.raises(TypeError, match="has no points"):
        limpid.from_vtk("cloud")


def test_files_of_vtk(tmp_path, ball, cloud):
    cloud.save(tmp_path / "cloud.vtp")
    read = limpid.read(tmp_path / "cloud.vtp")
    assert np.array_equal(read.positions, ball)


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1)])
def test_the_plotter_s_camera_shows_the_same(renderer, parallel, up):
    """A ball is where PyVista's own picture has it."""
    size = (160, 120)
    plotter = pyvista.Plotter(off_screen=True, window_size=size)
    # A particle fills as much as a cube of twice its radius.
    radius = 0.2 * (6 / np.pi) ** (1 / 3)
    ball = pyvista.Sphere(radius=radius, center=(0.3, 0.1, 0.25), theta_resolution=64, phi_resolution=64)
    plotter.add_mesh(ball, color="black", lighting=False)
    plotter.background_color = "white"
    plotter.camera_position = [(2.0, 2.5, 1.5), (0.1, 0.0, 0.0), up]
    plotter.camera.view_angle = 35
    if parallel:
        plotter.enable_parallel_projection()
        plotter.camera.parallel_scale = 0.8
    try:
        theirs = np.asarray(plotter.screenshot(return_img=True))[..., 0] < 128
    except Exception as error:  # noqa: BLE001
        pytest.skip(f"PyVista draws nothing here: {error}")
    camera = limpid.from_pyvista_camera(plotter)
    plotter.close()
    picture = renderer.render(
        [[0.3, 0.1, 0.25]], radius=0.2, camera=camera, size=size, aovs=["coverage"]
    )
    ours = picture.aov["coverage"] > 0
    assert theirs.any() and ours.any()
    differ = (theirs != ours).sum() / theirs.sum()
    assert differ < 0.06, f"{differ:.3f} of the ball's pixels differ"
