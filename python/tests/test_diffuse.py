"""Foam, spray, bubbles and dust beside the particles: which arrays they take, and what is refused; in pictures and films."""

import numpy as np
import pytest

import limpid
from conftest import SMALL
from limpid._diffuse import diffuse_arrays

PLACES = [[0.0, 0.5, 0.0], [0.1, 0.5, 0.0]]


def test_positions_alone_are_foam():
    arrays = diffuse_arrays(PLACES)
    assert arrays["positions"].shape == (2, 3)
    assert all(arrays[name] is None for name in ("velocities", "radii", "kinds", "ages", "lifetimes"))
    assert diffuse_arrays(None) is None


def test_a_fourth_number_is_the_lifetime():
    arrays = diffuse_arrays(np.array([[0, 0, 0, 2], [1, 0, 0, -1]], np.float32))
    assert arrays["positions"].tolist() == [[0, 0, 0], [1, 0, 0]]
    assert arrays["lifetimes"].tolist() == [[2], [-1]]


def test_one_radius_and_one_kind_stand_for_all():
    arrays = diffuse_arrays({"positions": PLACES, "radius": 0.25, "kinds": "bubbles", "ages": [1, 2]})
    assert arrays["radii"].tolist() == [[0.25], [0.25]]
    assert arrays["kinds"].tolist() == [2, 2]
    assert arrays["ages"].tolist() == [[1], [2]]
    assert diffuse_arrays({"positions": PLACES, "kinds": [1, 3]})["kinds"].tolist() == [1, 3]


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"radius": 1}, "no positions"),
        ({"positions": PLACES, "color": 1}, "'color'"),
        ({"positions": PLACES, "kinds": "snow"}, "snow"),
        ({"positions": PLACES, "ages": [1]}, "diffuse ages"),
        ({"positions": PLACES, "velocities": [[1, 2]]}, "diffuse velocities"),
        ([[1, 2]], "diffuse positions"),
    ],
)
def test_other_arrays_are_refused(wrong, problem):
    with pytest.raises(ValueError, match=problem):
        diffuse_arrays(wrong)


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"positions": PLACES, "kinds": [0, 4]}, "kinds: particle 1"),
        ({"positions": PLACES, "radius": [1, 0]}, "radius: particle 1"),
        ({"positions": PLACES, "ages": [-1, 0]}, "ages: particle 0"),
    ],
)
def test_values_out_of_range_are_refused(wrong, problem):
    with limpid.Renderer() as renderer, pytest.raises(ValueError, match=problem):
        renderer.render(np.zeros((4, 3)), radius=0.1, diffuse=wrong)


CAMERA = limpid.Camera((0, 1, 3), (0, 0, 0))
RINGS = [[[0.5 * np.cos(t), 0.75, 0.5 * np.sin(t)] for t in np.arange(start, 6.28, 0.2)] for start in (0.0, 2.0, 4.0)]
FOAM = [{"positions": ring, "radius": 0.04} for ring in RINGS]


def test_each_picture_has_its_own_foam(renderer, ball):
    """Pictures of the same particles need them classified once, but not with the foam of the last picture."""
    keywords = dict(radius=0.05, camera=CAMERA, size=SMALL)
    plain, first, other, again = (
        renderer.render(ball, diffuse=diffuse, **keywords).rgba for diffuse in (None, FOAM[0], FOAM[1], None)
    )
    assert not np.array_equal(plain, first) and not np.array_equal(first, other)
    assert np.array_equal(plain, again)


def test_views_have_foam(renderer, ball):
    keywords = dict(radius=0.05, size=SMALL)
    cameras = [CAMERA, CAMERA.turned(90)]
    views = renderer.render_views(ball, cameras, diffuse=FOAM[0], **keywords)
    assert not np.array_equal(views, renderer.render_views(ball, cameras, **keywords))
    alone = renderer.render(ball, camera=CAMERA, diffuse=FOAM[0], **keywords)
    assert limpid.flip(views[0], alone.rgba)[0] < 1e-3


@pytest.mark.parametrize("kind", [list, iter])
def test_each_frame_of_a_film_has_its_own_foam(renderer, ball, tmp_path, kind):
    keywords = dict(radius=0.05, camera=CAMERA, size=SMALL)
    foam = [FOAM[0], None, np.array(RINGS[1])]
    film = list(renderer.film([ball] * 3, tmp_path / "a.gif", diffuse=kind(foam), **keywords))
    for picture, diffuse in zip(film, foam):
        alone = renderer.render(ball, diffuse=diffuse, scene=film[0].scene, **keywords)
        assert np.array_equal(picture.rgba, alone.rgba)
    assert not np.array_equal(film[0].rgba, film[1].rgba)


def test_one_frame_of_several_cameras_has_its_foam(renderer, ball, tmp_path):
    keywords = dict(radius=0.05, camera=[CAMERA] * 2, size=SMALL)
    foam, plain = (
        next(renderer.film(ball, tmp_path / "a.gif", diffuse=diffuse, **keywords)).rgba for diffuse in (FOAM[0], None)
    )
    assert not np.array_equal(foam, plain)


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        (FOAM[0], "diffuse is one mapping; expected one for each frame"),
        (np.array(RINGS[0]), r"diffuse has the shape \(32, 3\); expected one array for each frame, as \[diffuse, ...\]"),
        (FOAM[:2], "diffuse has 2 entries for 3 frames; expected one array for each frame"),
    ],
)
def test_foam_of_a_film_is_one_for_each_frame(renderer, ball, tmp_path, wrong, problem):
    with pytest.raises(ValueError, match=problem):
        renderer.film([ball] * 3, tmp_path / "a.gif", radius=0.05, size=SMALL, diffuse=wrong)
    limpid.write(tmp_path / "ball.npz", ball)
    with pytest.raises(ValueError, match="diffuse is given, and files have their own"):
        renderer.film(tmp_path / "ball.npz", tmp_path / "a.gif", size=SMALL, diffuse=FOAM[:1])
