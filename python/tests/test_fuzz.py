"""Calls with anything: they end in a picture or in one of the documented exceptions."""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest

import limpid

hypothesis = pytest.importorskip("hypothesis")
from hypothesis import HealthCheck, given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

#: Calls; 100,000 make a long run.
CALLS = int(os.environ.get("LIMPID_CALLS", "1000"))

numbers = st.one_of(
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.sampled_from([0, 1, -1, 1e-30, 1e30, float("nan"), float("inf"), 2**31, 2**63]),
)
junk = st.one_of(
    st.none(),
    st.booleans(),
    numbers,
    st.text(max_size=8),
    st.binary(max_size=8),
    st.lists(numbers, max_size=4),
    st.lists(st.lists(numbers, max_size=4), max_size=4),
    st.dictionaries(st.text(max_size=3), numbers, max_size=2),
    st.builds(object),
    st.builds(
        lambda shape, kind, value: np.full(shape, value).astype(kind),
        st.lists(st.integers(0, 4), max_size=4),
        st.sampled_from(["f2", "f4", "f8", ">f4", "i1", "i8", "u8", "?", "c8", "S3", "O"]),
        st.sampled_from([0, 1, 7]),
    ),
)
arguments = st.fixed_dictionaries(
    {"positions": junk},
    optional={
        name: junk
        for name in (
            "radius velocities ids ellipsoids colors values colormap range scene camera size samples aovs alpha up frame".split()
        )
    },
)
scenes = st.fixed_dictionaries(
    {},
    optional={
        name: junk
        for name in "ior absorption color solids lights environment background camera look settings".split()
    },
)
solids = st.one_of(
    st.builds(limpid.Plane, junk, junk, half_extent=junk, color=junk, tile=junk, texture=junk, keys=junk),
    st.builds(limpid.Sphere, junk, junk, lit=junk, checker=junk),
    st.builds(limpid.Box, junk, junk, ground=junk),
    st.builds(limpid.Mesh, junk, vertices=junk, faces=junk, rotate=junk, coordinates=junk),
)

ALLOWED = (ValueError, TypeError, OSError, KeyError, OverflowError, MemoryError, limpid.Error)


@pytest.fixture(autouse=True)
def quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def fuzz(share):
    return settings(
        max_examples=max(1, CALLS // share),
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )


def ends(call):
    try:
        call()
    except ALLOWED:
        pass


@fuzz(2)
@given(arguments)
def test_render(renderer, arguments):
    keywords = {"size": (16, 12), **arguments}
    size = keywords["size"]
    if isinstance(size, list) and len(size) == 2:
        # A picture that takes memory for minutes is no error.
        keywords["size"] = [n if not isinstance(n, (int, float)) or n < 64 else -n for n in size]
    ends(lambda: renderer.render(**keywords))


@fuzz(4)
@given(scenes, st.lists(solids, max_size=2))
def test_scene(renderer, given_arguments, given_solids):
    keywords = {**({"solids": given_solids} if given_solids else {}), **given_arguments}
    ends(lambda: renderer.render([], scene=limpid.Scene(**keywords), size=(16, 12)))


@fuzz(4)
@given(junk, junk, junk, junk)
def test_others(a, b, c, d):
    for call in (
        lambda: limpid.Camera(a, b, c, d),
        lambda: limpid.Camera.from_matrices(a, b),
        lambda: limpid.flip(a, b),
        lambda: limpid.write("/nowhere/a.vtk", a, velocities=b, radius=c, ids=d),
        lambda: limpid.read("/nowhere" if isinstance(a, (str, bytes)) else a),
        lambda: limpid.Scene().settings.__setitem__(a, b),
        lambda: limpid.bake(a, b),
        lambda: limpid.Particles(a, b, c, d),
    ):
        ends(call)
