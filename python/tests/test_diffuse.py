"""Foam, spray, bubbles and dust beside the particles: which arrays they take, and what is refused."""

import numpy as np
import pytest

import limpid
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
