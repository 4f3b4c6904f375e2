"""Cameras by directions, and those that fit."""

from __future__ import annotations

import numpy as np
import pytest

import limpid


def projected(camera, points, aspect):
    """Places in the picture, from -1 to 1."""
    back = np.subtract(camera.eye, camera.target)
    back /= np.linalg.norm(back)
    right = np.cross(camera.up, back)
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, np.cross(back, right), -back]) @ (points - camera.eye).T
    assert (z > 0).all()
    tangent = np.tan(np.radians(camera.fov_y / 2))
    return x / z / tangent / aspect, y / z / tangent


def test_azimuth_and_elevation_turn_about_the_target():
    def at(*angles, **more):
        return np.round(limpid.Camera.orbit((1, 2, 3), 5, *angles, **more).eye, 6) - (1, 2, 3)

    assert np.allclose(at(0, 0), (0, 0, 5))
    assert np.allclose(at(90, 0), (5, 0, 0))
    assert np.allclose(at(0, 90), (0, 5, 0))
    assert np.allclose(at(0, -90), (0, -5, 0))
    z = dict(up=(0, 0, 1))
    assert np.allclose(at(0, 0, **z), (0, -5, 0))
    assert np.allclose(at(90, 0, **z), (5, 0, 0))
    assert np.allclose(at(0, 90, **z), (0, 0, 5))
    camera = limpid.Camera.orbit((0, 0, 0), 2, 10, 30, 35)
    assert camera.fov_y == 35 and camera.up == (0, 1, 0)
    assert np.allclose(camera.turned(15).eye, limpid.Camera.orbit((0, 0, 0), 2, 25, 30).eye)


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1)])
@pytest.mark.parametrize("angles", [(0, 0), (25, 20), (130, -40), (0, 90), (70, -90)])
@pytest.mark.parametrize("size", [(400, 300), (100, 300)])
def test_fitted_cameras_see_all_points_and_touch_the_margin(up, angles, size):
    points = np.random.default_rng(2).normal(size=(200, 3)) * (1, 2, 0.3) + (5, 6, -7)
    camera = limpid.Camera.fit(points, *angles, fov_y=50, up=up, size=size)
    x, y = projected(camera, points, size[0] / size[1])
    extent = np.array([x.min(), x.max(), y.min(), y.max()])
    assert (np.abs(extent) < 0.951).all()
    across, high = (np.allclose(np.abs(pair), 0.95, atol=1e-6) for pair in (extent[:2], extent[2:]))
    assert across or high
    assert limpid.Camera.fit(limpid.Particles(points), *angles, fov_y=50, up=up, size=size) == camera


def test_one_point_has_a_camera():
    camera = limpid.Camera.fit([(1, 2, 3)])
    assert np.allclose(camera.target, (1, 2, 3)) and camera.eye != camera.target


def test_cameras_look_at_other_points():
    camera = limpid.Camera((0, 1, 4), (0, 0, 0), 35, near=0.1).look_at((1, 1, 0))
    assert camera == limpid.Camera((0, 1, 4), (1, 1, 0), 35, near=0.1)
    with pytest.raises(limpid.SceneError, match="same point"):
        camera.look_at(camera.eye)
    with pytest.raises(ValueError, match="no target"):
        limpid.Camera.from_matrices(np.eye(4), np.diag([1, 1, -1, 1])).look_at((0, 0, 0))
