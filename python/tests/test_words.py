"""Words: signatures, errors of arguments, representations."""

from __future__ import annotations

import inspect
import pydoc
import warnings

import numpy as np
import pytest

import limpid
from conftest import SMALL

CAMERA = ((0, 1, 4), (0, 0, 0))


def test_solids_tell_what_all_solids_have():
    for solid in (limpid.Plane, limpid.Box, limpid.Sphere, limpid.Mesh):
        text = inspect.getdoc(solid)
        for name in inspect.signature(solid).parameters:
            assert f"{name}" in text, f"{solid.__name__}: {name}"


def test_suns_from_below_are_told():
    with pytest.warns(limpid.LimpidWarning, match="shines upwards.*y points up"):
        limpid.Sun((-1, 1, -2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        limpid.Sun((-1, -1, -2))


def test_help_has_every_argument():
    for function in (limpid.render, limpid.Renderer.render, limpid.Scene, limpid.Camera, limpid.Camera.orbit):
        signature = inspect.signature(function)
        assert "Ellipsis" not in str(signature)
        text = inspect.getdoc(function)
        for name in signature.parameters:
            assert name == "self" or name in text, f"{function.__name__}: {name}"
    assert "Particle radius, m" in pydoc.render_doc(limpid.render)
    assert str(inspect.signature(limpid.Camera)) == "(eye, target, fov_y=40.0, up=(0.0, 1.0, 0.0), near=None)"


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: limpid.Camera("a", "b"), "eye is 'a'; expected 3 numbers, as (0, 1, 0)"),
        (lambda: limpid.Camera((0, 0, 1), None), "target is None; expected 3 numbers, as (0, 1, 0)"),
        (lambda: limpid.Camera((0, 0), (0, 0, 0)), "eye is (0, 0); expected 3 numbers, as (0, 1, 0)"),
        (lambda: limpid.Camera(*CAMERA, 200), "fov_y is 200; expected above 0 and below 180 degrees"),
        (lambda: limpid.Camera(*CAMERA, "40"), "fov_y is '40'; expected above 0 and below 180 degrees"),
        (lambda: limpid.Camera(*CAMERA, near=-1), "near is -1; expected a length above 0 m"),
        (lambda: limpid.Camera.orthographic(*CAMERA, 0), "height is 0; expected a length above 0 m"),
        (lambda: limpid.Camera.orbit((0, 0, 0), 1, 0, 91), "elevation is 91; expected degrees, -90 to 90"),
        (lambda: limpid.Camera.fit([]), "points is []; expected an array of shape (n, 3) of finite numbers, not empty"),
        (lambda: limpid.Scene(ior=9), "ior is 9; expected a number from 0.3 to 3"),
        (lambda: limpid.Scene(ior="1"), "ior is '1'; expected a number from 0.3 to 3"),
        (lambda: limpid.Scene(floor="low"), "floor is 'low'; expected a height in metres, or \"none\""),
        (lambda: limpid.Scene(camera=3), "camera is 3; expected a limpid.Camera"),
        (
            lambda: limpid.Scene(solids=[limpid.Sphere((0, 0, 0), "1")]),
            "solids[0].radius is '1'; expected a number",
        ),
        (
            lambda: limpid.Scene(solids=limpid.Mesh("a.obj")),
            "solids is Mesh(",
        ),
        (
            lambda: limpid.Scene(environment="daylight"),
            "environment is 'daylight', which is a look and no file; expected sky=\"daylight\" for its sky, or "
            'look="daylight" for all of it',
        ),
    ],
)
def test_errors_name_the_argument_and_what_came(make, text):
    with pytest.raises(ValueError) as caught:
        make()
    assert str(caught.value).startswith(text)


def test_colors_of_bytes_are_likely_a_slip():
    with pytest.warns(limpid.LimpidWarning, match=r"solids\[0\].color is \(255.0, 0.0, 0.0\)") as caught:
        limpid.Scene(solids=[limpid.Sphere((0, 0, 0), 1, color=(255, 0, 0))])
    assert caught[0].filename == __file__
    with pytest.warns(limpid.LimpidWarning, match="checker.odd"):
        limpid.Scene(solids=[limpid.Plane(checker=limpid.Checker(1, odd=(0, 0, 200)))])


def test_settings_that_do_not_exist_have_a_neighbour():
    with pytest.raises(KeyError, match="did you mean 'refract.samples'"):
        limpid.Scene().settings["refract.sample"]
    assert {"refract.samples", "preset"} <= set(limpid.Scene().settings._ipython_key_completions_())


def test_classes_of_errors_are_those_of_the_package():
    for kind in (limpid.Error, limpid.SceneError, limpid.FileError, limpid.NoAdapter, limpid.LimpidWarning):
        assert f"{kind.__module__}.{kind.__qualname__}" == f"limpid.{kind.__name__}"
    assert issubclass(limpid.SceneError, ValueError) and issubclass(limpid.FileError, OSError)


def test_numbers_have_their_own_digits(renderer, ball):
    scene = limpid.Scene(ior=1.1, absorption=(0.1, 0.2, 0.3))
    assert scene.ior == 1.1 and scene.absorption == (0.1, 0.2, 0.3)
    assert repr(scene) == "<limpid.Scene, look='studio', ior=1.1, absorption=(0.1, 0.2, 0.3)>"
    assert scene.settings["refract.structure"] == 0.1
    camera = limpid.Camera((0.1, 0, 0), (0, 0.2, 0.3), 35.1, up=(0.1, 0.9, 0), near=0.1)
    assert (camera.fov_y, camera.up, camera.near) == (35.1, (0.1, 0.9, 0.0), 0.1)
    assert repr(camera) == "Camera((0.1, 0, 0), (0, 0.2, 0.3), fov_y=35.1, up=(0.1, 0.9, 0), near=0.1)"
    picture = renderer.render(ball, radius=0.1, values=ball[:, 0], range=(0.1, 0.3), aovs=["all"], size=SMALL)
    assert picture.radius == 0.1 and picture.range == (0.1, 0.3)
    assert len(repr(picture.aov)) < 3000 and "'depth': (72, 96)" in repr(picture.aov)


def test_radii_may_be_a_column(renderer, ball):
    radii = np.linspace(0.04, 0.06, len(ball))
    a, b = (renderer.render(ball, radius=r, size=SMALL).rgba for r in (radii, radii[:, None]))
    assert np.array_equal(a, b)
