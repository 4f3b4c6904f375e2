"""Arguments: every kind of array that holds the same numbers gives the same picture, and others are refused with
the argument's name, what came and what was expected."""

from __future__ import annotations

import ctypes
import re
import subprocess

import numpy as np
import pytest

import limpid
from conftest import SMALL


def test_orders_strides_and_types_do_not_matter(renderer, ball, scene):
    expected = renderer.render(ball, scene=scene, radius=0.05, size=SMALL).rgba
    wide = np.zeros((len(ball), 7), np.float32)
    wide[:, 1:6:2] = ball
    backwards = ball[::-1].copy()[::-1]
    record = np.zeros(len(ball), np.dtype([("tag", "u1"), ("x", "f4", 3)]))
    record["x"] = ball
    same = {
        "float64": ball.astype(np.float64),
        "Fortran order": np.asfortranarray(ball),
        "strided": wide[:, 1:6:2],
        "negative strides": backwards,
        "unaligned": record["x"],
        "big-endian": ball.astype(">f4"),
        "read-only": np.broadcast_to(ball, ball.shape),
        "list": ball.tolist(),
        "float64, Fortran order": np.asfortranarray(ball.astype(np.float64)),
        "Particles": limpid.Particles(ball),
    }
    for kind, positions in same.items():
        drawn = renderer.render(positions, scene=scene, radius=0.05, size=SMALL).rgba
        assert np.array_equal(drawn, expected), kind
    other = renderer.render(ball + 0.01, scene=scene, radius=0.05, size=SMALL).rgba
    assert not np.array_equal(other, expected)


class OnlyDLPack:
    """An array without NumPy's own protocols."""

    def __init__(self, array, device=(1, 0)):
        self.array, self.device = array, device

    def __dlpack__(self, *, stream=None, **_):
        # Some libraries take any number for a stream.
        assert stream is None
        return self.array.__dlpack__()

    def __dlpack_device__(self):
        return self.device


class OnCard:
    """An array of CUDA, as of PyTorch, CuPy, Numba and Warp: NumPy's own protocol refuses it."""

    def __init__(self, array):
        self.array = array

    @property
    def __cuda_array_interface__(self):
        return {**self.array.__array_interface__, "version": 2}

    def __array__(self, *_, **__):
        raise TypeError("a card's memory")


def test_arrays_of_other_libraries_are_read_where_they_are(renderer, ball, scene):
    from limpid._arrays import numbers

    shared = OnlyDLPack(ball)
    assert np.shares_memory(numbers("positions", shared, ("n", 3)), ball)
    expected = renderer.render(ball, scene=scene, radius=0.05, size=SMALL).rgba
    assert np.array_equal(renderer.render(shared, scene=scene, radius=0.05, size=SMALL).rgba, expected)
    pinned = OnlyDLPack(ball, device=(3, 0))
    assert np.array_equal(renderer.render(pinned, scene=scene, radius=0.05, size=SMALL).rgba, expected)


# A driver whose card is the processor's memory, with CUDA's signatures. It refuses what a card would: work before `cuInit` or
# without a context; and a copy before all other work is done.
DRIVER = """
#include <string.h>
static int begun, device, context, own, current, idle;
int cuInit(unsigned flags) { begun = 1; return flags; }
int cuPointerGetAttribute(void *data, int attribute, unsigned long long pointer) {
    if (!begun || !pointer) return 1;
    if (attribute == 1) *(void **)data = own ? &context : 0;
    else if (attribute == 9) *(int *)data = 3;
    else return 1;
    return 0;
}
int cuDeviceGet(int *found, int ordinal) { *found = 7; return ordinal == 3 ? 0 : 101; }
int cuDevicePrimaryCtxRetain(void **found, int wanted) { device = wanted; *found = &context; return device == 7 ? 0 : 101; }
int cuDevicePrimaryCtxRelease_v2(int given) { device = 0; return given == 7 ? 0 : 101; }
int cuCtxPushCurrent_v2(void *given) { current = given == &context; return current ? 0 : 201; }
int cuCtxPopCurrent_v2(void **found) { *found = &context; current = idle = 0; return 0; }
int cuCtxSynchronize(void) { idle = current; return current ? 0 : 201; }
int cuMemcpyDtoH_v2(void *to, unsigned long long from, size_t bytes) {
    if (!idle) return 201;
    memcpy(to, (void *)from, bytes);
    return 0;
}
int retained(void) { return device || current; }
void belong(int whether) { own = whether; }
"""


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    folder = tmp_path_factory.mktemp("driver")
    (folder / "cuda.c").write_text(DRIVER)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", "libcuda.so.1", "cuda.c"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "libcuda.so.1"))


def test_arrays_on_a_card_are_copied(renderer, ball, scene, driver, monkeypatch):
    from limpid import _cuda
    from limpid._arrays import integers, numbers

    monkeypatch.setattr(_cuda.ctypes, "CDLL", lambda name: {"libcuda.so.1": driver}[name])
    rows = np.zeros((len(ball), 7), np.float32)
    rows[:, 2:5] = ball
    same = {
        "an array": OnCard(ball),
        "columns": OnCard(rows[:, 2:5]),
        "backwards": OnCard(ball[::-1].copy()[::-1]),
        "DLPack": OnlyDLPack(ball, device=(2, 0)),
        "columns of DLPack": OnlyDLPack(rows[:, 2:5], device=(2, 0)),
    }
    # Memory of a context, and of none.
    for has_context in [True, False]:
        driver.belong(has_context)
        for kind, array in same.items():
            copy = numbers("positions", array, ("n", 3))
            assert np.array_equal(copy, ball), kind
            assert not np.shares_memory(copy, array.array), kind
        assert driver.retained() == 0
    assert np.array_equal(integers("ids", OnCard(np.arange(8)), ("n",)), np.arange(8))
    assert numbers("positions", OnCard(np.zeros((0, 3), np.float32)), ("n", 3)).shape == (0, 3)
    expected = renderer.render(ball, scene=scene, radius=0.05, size=SMALL).rgba
    assert np.array_equal(renderer.render(OnCard(ball), scene=scene, radius=0.05, size=SMALL).rgba, expected)
    # The driver's own refusals are errors.
    monkeypatch.setattr(_cuda, "_DEVICE_ORDINAL", 8)
    with pytest.raises(ValueError, match="cuPointerGetAttribute of NVIDIA's driver failed with code 1"):
        renderer.render(OnCard(ball), radius=0.05, size=SMALL)


@pytest.mark.parametrize("device", [2, 10])
def test_arrays_on_a_card_say_how_to_copy_them(renderer, ball, monkeypatch, device):
    from limpid import _cuda

    def no_driver(name):
        raise OSError(name)

    monkeypatch.setattr(_cuda.ctypes, "CDLL", no_driver)
    array = OnlyDLPack(ball, device=(device, 0))
    with pytest.raises(ValueError, match=r"^positions is in memory of a graphics card.*positions\.cpu\(\)"):
        renderer.render(array, radius=0.05, size=SMALL)
    with pytest.raises(ValueError, match=r"^ids is in memory of a graphics card"):
        renderer.render(limpid.Particles(ball, ids=array), radius=0.05, size=SMALL)


class Tensor:
    """A tensor of PyTorch that records gradients."""

    def __init__(self, array):
        self.array = array

    def __array__(self, *_, **__):
        raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")

    def detach(self):
        return self.array


class Half:
    """A tensor of PyTorch of a type that NumPy lacks."""

    def __array__(self, *_, **__):
        raise TypeError("Got unsupported ScalarType BFloat16")


def test_tensors_with_gradients_are_read(ball):
    from limpid._arrays import numbers

    assert np.shares_memory(numbers("positions", Tensor(ball), ("n", 3)), ball)
    with pytest.raises(ValueError, match=r"^positions has the dtype bfloat16; .*positions\.float\(\)$"):
        limpid.render(Half())


def test_fields_are_vectors(ball):
    """Structured arrays as of PLY files."""
    from limpid._arrays import numbers

    names = ["z", "id", "x", "y", "vx", "vy", "vz"]
    record = np.zeros(len(ball), np.dtype([(name, "i4" if name == "id" else "f4") for name in names]))
    record["x"], record["y"], record["z"] = ball.T
    record["vx"], record["vy"], record["vz"] = 2 * ball.T
    assert np.array_equal(numbers("positions", record, ("n", 3)), ball)
    assert np.array_equal(numbers("velocities", record, ("n", 3)), 2 * ball)
    assert np.array_equal(numbers("positions", record.view(np.recarray), ("n", 3)), ball)
    whole = np.zeros(3, np.dtype([("tag", "u1"), ("place", "f4", 3)]))
    with pytest.raises(ValueError, match=re.escape('fields tag, place; expected plain numbers, as positions["place"]')):
        limpid.render(whole)
    other = np.zeros(3, np.dtype([("px", "f4"), ("py", "f4"), ("pz", "f4")]))
    with pytest.raises(ValueError, match="structured_to_unstructured") as caught:
        limpid.render(other)
    import numpy.lib.recfunctions

    line = str(caught.value).split(", as ", 1)[1]
    assert eval(line, {"numpy": numpy, "positions": other}).shape == (3, 3), "the line works"
    with pytest.raises(ValueError, match=re.escape('as radius["px"]')):
        limpid.render(np.zeros((3, 3)), radius=other)


def test_generators_and_dictionaries_say_how_to_convert_them(ball):
    def simulation():
        raise AssertionError("must not run")
        yield

    with pytest.raises(ValueError, match=re.escape("positions is a generator; expected an array, as numpy.array(list(")):
        limpid.render(simulation())
    columns = dict(zip("xyz", ball.T))
    with pytest.raises(ValueError, match="positions is a dict") as caught:
        limpid.render(columns)
    line = str(caught.value).split(", as ", 1)[1]
    assert np.array_equal(eval(line, {"numpy": np, "positions": columns}), ball)


def test_tables_of_pandas_are_read(ball):
    pandas = pytest.importorskip("pandas")
    from limpid._arrays import integers, numbers

    table = pandas.DataFrame(ball.astype(np.float64), columns=list("xyz"))
    for kind in ("float64", "Float64", "Float32"):
        assert np.allclose(numbers("positions", table.astype(kind), ("n", 3)), ball), kind
    holed = table.astype("Float64")
    holed.loc[3, "y"] = pandas.NA
    read = numbers("positions", holed, ("n", 3))
    assert np.isnan(read[3, 1]) and np.isfinite(np.delete(read, 3, axis=0)).all()
    large = pandas.Series([2**62 + 1, 7, None], dtype="Int64")
    assert integers("ids", large[:2], ("n",)).tolist() == [2**62 + 1, 7]
    with pytest.raises(ValueError, match="ids has the dtype Int64") as caught:
        integers("ids", large, ("n",))
    line = str(caught.value).rsplit(", as ", 1)[1]
    assert eval(line, {"ids": large}).tolist() == [2**62 + 1, 7, -1]
    with pytest.raises(ValueError, match=re.escape('positions has the columns x, y, z, name')) as caught:
        limpid.render(table.assign(name="a"))
    line = str(caught.value).rsplit(", as ", 1)[1]
    assert np.allclose(eval(line, {"positions": table.assign(name="a")}), ball)


def test_tables_of_polars_are_read(ball):
    polars = pytest.importorskip("polars")
    from limpid._arrays import integers, numbers

    table = polars.DataFrame(dict(zip("xyz", ball.T)))
    assert np.array_equal(numbers("positions", table, ("n", 3)), ball)
    assert integers("ids", polars.Series([3, 4]), ("n",)).tolist() == [3, 4]
    with pytest.raises(ValueError, match="missing ones") as caught:
        integers("ids", polars.Series([3, None]), ("n",))
    line = str(caught.value).rsplit(", as ", 1)[1]
    assert eval(line, {"ids": polars.Series([3, None])}).tolist() == [3, -1]


def test_half_floats_and_integers_are_numbers(renderer, scene):
    grid = np.stack(np.meshgrid(*3 * [np.arange(-2, 3)]), axis=-1).reshape(-1, 3)
    whole = renderer.render(grid, scene=scene, radius=0.5, size=SMALL).rgba
    half = renderer.render(grid.astype(np.float16), scene=scene, radius=0.5, size=SMALL).rgba
    assert np.array_equal(whole, half)


def test_arrays_are_not_changed_or_kept(renderer, ball, scene):
    positions = ball.copy()
    renderer.render(positions, scene=scene, radius=0.05, size=SMALL)
    assert np.array_equal(positions, ball)
    positions.resize((3, 3), refcheck=True)


def test_particles_without_a_place_are_left_out(renderer, ball, scene):
    """Their rows of other arrays go with them, and a warning counts them."""
    whole = dict(scene=scene, radius=np.full(len(ball), 0.05), colors=np.linspace(0.1, 0.9, 3 * len(ball)).reshape(-1, 3))
    expected = renderer.render(ball, **whole, size=SMALL).rgba
    for nothing in (np.nan, -np.inf, 1e30):
        holed = {k: np.insert(v, 3, v[0], axis=0) if k != "scene" else v for k, v in whole.items()}
        with pytest.warns(limpid.LimpidWarning, match="particles have no finite position.*particle 3"):
            drawn = renderer.render(np.insert(ball, 3, nothing, axis=0), **holed, size=SMALL).rgba
            renderer._drawing._issued.clear()
        assert np.array_equal(drawn, expected), nothing


def test_places_far_from_the_origin_keep_their_digits(renderer, ball):
    """A float64 array far away draws what the same array draws near the origin."""
    far = ball.astype(np.float64) + np.array([3e5, -2e5, 1e5])
    near = renderer.render(ball.astype(np.float64), radius=0.05, size=SMALL)
    drawn = renderer.render(far, radius=0.05, size=SMALL)
    mean, _ = limpid.flip(near, drawn)
    assert mean < 0.02
    coarse = renderer.render(far.astype(np.float32), radius=0.05, size=SMALL)
    assert limpid.flip(near, coarse)[0] > mean


N = 9
GOOD = np.arange(3 * N, dtype=np.float32).reshape(N, 3)
NAN = GOOD.copy()
NAN[4, 1] = np.nan
MOSTLY_NAN = GOOD.copy()
MOSTLY_NAN[:5, 0] = np.nan

BAD = {
    "positions has the shape (9, 2); expected (n, 3)": dict(positions=GOOD[:, :2]),
    "positions has the shape (3,); expected (n, 3)": dict(positions=[1.0, 2.0, 3.0]),
    "positions has the dtype <U1; expected float32 or float64": dict(positions=[["a", "b", "c"]]),
    "positions has the dtype bool": dict(positions=np.ones((N, 3), bool)),
    "positions has the dtype complex64": dict(positions=GOOD.astype(np.complex64)),
    "positions has the dtype object": dict(positions=None),
    "positions: particle 0 has [nan, 1.0, 2.0]; expected finite numbers": dict(positions=MOSTLY_NAN),
    "positions: particle 0 has [inf": dict(positions=[[np.inf, 0, 0]]),
    "positions: particle 0 has [1e30": dict(positions=[[1e30, 0, 0]]),
    "radius is -1.0; expected 1e-12 to 1e12 m": dict(radius=-1),
    "radius is nan": dict(radius=float("nan")),
    "radius is 'x'": dict(radius="x"),
    "radius has 8 rows for 9 positions; expected as many": dict(radius=np.ones(N - 1)),
    "radius: particle 2 has -1.0; expected 0 or more": dict(radius=[1, 1, -1, 1, 1, 1, 1, 1, 1]),
    "radius has the shape (9, 2); expected (n,)": dict(radius=np.ones((N, 2))),
    "velocities has 4 rows for 9 positions": dict(velocities=GOOD[:4]),
    "velocities: particle 4 has": dict(velocities=NAN),
    "ids has the dtype float32; expected integers": dict(ids=np.ones(N, np.float32)),
    "ids has 3 rows for 9 positions": dict(ids=[1, 2, 3]),
    "ellipsoids has the shape (9, 3); expected (n, 3, 3)": dict(ellipsoids=GOOD),
    "colors: particle 0 has [0.0, 1.0, 2.0]; expected numbers from 0 to 1": dict(colors=GOOD),
    "colors: particle 4 has [": dict(colors=NAN / 99),
    "colors has the shape (9, 5); expected (n, 3) or (n, 4)": dict(colors=np.ones((N, 5))),
    "colors has 8 rows": dict(colors=np.ones((N - 1, 3), np.uint8)),
    "colors and values: give one of them": dict(colors=np.ones((N, 3)), values=np.ones(N)),
    "values: particle 4 has nan; expected finite numbers": dict(values=NAN[:, 1]),
    "values: particle 4 has [12.0, nan, 14.0]; expected finite numbers": dict(values=NAN),
    "values: particle 0 has 1e+300; expected finite": dict(values=np.full(N, 1e300)),
    "values has the shape (9, 5); expected (n,), (n, 2) or (n, 3)": dict(values=np.ones((N, 5))),
    "values has 8 rows for 9 positions": dict(values=np.ones(N - 1)),
    "values has the dtype bool": dict(values=np.ones(N, bool)),
    "values is masked": dict(values=np.ma.masked_equal(np.arange(9.0), 3)),
    "colormap: there is no color map virdis (is it viridis?); there are viridis, plasma, inferno": dict(
        values=np.ones(N), colormap="virdis"
    ),
    "colormap is 3; expected a name": dict(values=np.ones(N), colormap=3),
    "range is (80, 20); expected (low, high), the smaller one first": dict(values=np.ones(N), range=(80, 20)),
    "range is (5, 5)": dict(values=np.ones(N), range=(5, 5)),
    "range is (0, inf)": dict(values=np.ones(N), range=(0, float("inf"))),
    "range is 'all'": dict(values=np.ones(N), range="all"),
    "colormap and range show values; give values": dict(range=(0, 1)),
    "size is (0, 10)": dict(size=(0, 10)),
    "size is 7": dict(size=7),
    "size is (1.5, 10)": dict(size=(1.5, 10)),
    "samples is 0; expected 1 to 64": dict(samples=0),
    "samples is 65; expected 1 to 64": dict(samples=65),
    "positions is masked; expected plain values": dict(
        positions=np.ma.masked_greater(GOOD, 20.0)
    ),
    "radius is masked": dict(radius=np.ma.masked_equal(np.arange(9.0), 3)),
    "radius is True": dict(radius=True),
    "radius is ragged": dict(radius=[[1], [1, 2]]),
    "size is {": dict(size={96, 72}),
    "up is 1": dict(up=1),
    "aovs is None": dict(aovs=None),
    "samples is 2.5; expected a whole number": dict(samples=2.5),
    "camera is 'front'; expected a limpid.Camera": dict(camera="front"),
    "scene is 4; expected a limpid.Scene": dict(scene=4),
    'up is \'x\'; expected "y" or "z"': dict(up="x"),
    "aov: no `colour`": dict(aovs=["colour"]),
    "aov: no `front.inside`": dict(aovs=["front.inside"]),
    "aov: no `splash_front.smooth_depth`": dict(aovs=["splash_front.smooth_depth"]),
}


@pytest.mark.parametrize("problem", BAD)
def test_bad_arguments_are_named(renderer, problem):
    arguments = {"positions": GOOD, "size": SMALL, **BAD[problem]}
    with pytest.raises(ValueError, match=re.escape(problem)) as caught:
        renderer.render(arguments.pop("positions"), **arguments)
    assert "\n" not in str(caught.value)
    assert "--" not in str(caught.value), "a flag of the program"


def test_no_particles_are_a_picture_of_the_scene(renderer, scene):
    for nothing in ([], np.zeros((0, 3))):
        picture = renderer.render(nothing, scene=scene, size=SMALL)
        assert picture.particles == 0
        assert picture.rgba.shape == (72, 96, 4)


def test_one_particle_needs_a_radius(renderer, scene):
    with pytest.raises(ValueError, match="give radius"):
        renderer.render([[0, 0, 0]], scene=scene, size=SMALL)
    renderer.render([[0, 0, 0]], radius=0.5, scene=scene, size=SMALL)


def test_colors_tint_the_particles(renderer, ball, scene):
    colors = np.where(ball[:, :1] < 0, [[1.0, 0.2, 0.2]], [[0.2, 0.2, 1.0]])
    picture = renderer.render(ball, radius=0.05, colors=colors, scene=scene, size=SMALL, aovs=["mask"])
    left, right = picture.rgba[36, 40].astype(int), picture.rgba[36, 56].astype(int)
    assert left[0] > left[2] + 30 and right[2] > right[0] + 30
    assert picture.aov["mask"].shape == (72, 96, 2)
    same = renderer.render(ball, radius=0.05, colors=np.ones((len(ball), 3)), scene=scene, size=SMALL)
    assert not np.array_equal(same.rgba, picture.rgba)


def test_many_colors_are_joined(renderer, ball, scene):
    rng = np.random.default_rng(3)
    colors = rng.uniform(0.1, 1.0, ball.shape)
    picture = renderer.render(ball, radius=0.05, colors=colors, scene=scene, size=SMALL, aovs=["mask"])
    assert picture.aov["mask"].shape[2] == 16


def test_ellipsoids_are_drawn(renderer, ball, scene):
    """Flat shapes at the top of the ball leave its front lower."""

    def top(shape):
        shapes = np.tile(shape, (len(ball), 1, 1))
        picture = renderer.render(
            ball, radius=0.05, ellipsoids=shapes, scene=scene, size=SMALL, aovs=["coverage"]
        )
        return int(np.argmax(picture.aov["coverage"][:, 48] > 0))

    assert top(np.diag([2.0, 0.5, 2.0])) > top(np.diag([2.0, 4.0, 2.0])) + 2
    turned = np.array([[0.0, -2.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 2.0]])
    assert top(turned) == top(np.diag([2.0, 0.5, 2.0])), "the sphere may be turned first"
