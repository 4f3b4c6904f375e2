"""Colours of particles: of their own, and by values that a map shows."""

from __future__ import annotations

import numpy as np
import pytest

import limpid
from conftest import SMALL
from test_render import assert_same_png


@pytest.fixture(scope="module")
def painted():
    """A scene whose liquid is opaque."""
    return limpid.Scene(look="paint", camera=limpid.Camera((0, 1, 4), (0, 0, 0)))


@pytest.fixture
def draw(renderer, ball, painted):
    """Draws the ball."""

    def draw(positions=ball, **arguments):
        return renderer.render(positions, **{"radius": 0.05, "scene": painted, "size": SMALL, **arguments})

    return draw


def difference(a, b):
    return int(np.abs(a.rgba.astype(int) - b.rgba.astype(int)).max())


@pytest.mark.parametrize("legend", [False, True])
def test_values_are_drawn_as_by_the_program(renderer, program, ball, tmp_path, legend):
    """Without a scene, and over the usual range."""
    size = (320, 240) if legend else (96, 72)
    values = (ball[:, 0] + 7).astype(np.float32)
    table = np.column_stack([ball, values]).astype(np.float64)
    np.savetxt(tmp_path / "a.csv", table, "%.9g", ",", header="x,y,z,temperature", comments="")
    bar = ["--legend"] if legend else []
    more = ["--color-by", "temperature", "--colormap", "turbo", *bar, "--size", f"{size[0]}x{size[1]}"]
    program("render", tmp_path / "a.csv", *more, "-o", tmp_path / "a.png")
    picture = renderer.render(ball, values=values, colormap="turbo", size=size)
    (picture.legend("temperature") if legend else picture).save(tmp_path / "b.png")
    assert_same_png(tmp_path / "a.png", tmp_path / "b.png")


def test_equal_values_have_the_colors_of_the_map(draw, ball):
    """The ends of viridis, and the middle where a range has no length."""
    for values, of_range, byte in ((20, (20, 80), [68, 1, 84]), (80, (20, 80), [253, 231, 37]), (5, None, [33, 145, 140])):
        by_value = draw(values=np.full(len(ball), values), range=of_range)
        by_color = draw(colors=np.tile(np.uint8(byte), (len(ball), 1)))
        assert difference(by_value, by_color) <= 1
    assert by_value.range is None and by_value.colormap == "viridis"


def test_values_of_all_kinds_are_alike(draw, ball):
    whole = np.arange(len(ball))
    expected = draw(values=whole).rgba
    vectors = np.stack([0.6 * whole, -0.8 * whole, 0 * whole], axis=1)
    for values in (whole.astype(np.float32), whole.tolist(), whole[::-1].copy()[::-1]):
        assert np.array_equal(draw(values=values).rgba, expected)
    for values in (vectors, vectors[:, :2]):
        assert np.abs(draw(values=values).rgba.astype(int) - expected).max() <= 1, "lengths"
    particles = limpid.Particles(ball, values=whole)
    assert np.array_equal(draw(particles).rgba, expected)
    assert "values" in repr(particles)
    other = draw(particles, colors=np.full((len(ball), 3), 0.5))
    assert other.range is None and difference(other, draw(particles)) > 30, "arguments come first"


def test_values_stay_with_their_particles(draw, ball):
    """In another order, and beside particles without a place, which may lack values, too."""
    values = ball[:, 0] + 0.3 * ball[:, 1]
    expected = draw(values=values, range=(-0.7, 0.7))
    order = np.random.default_rng(5).permutation(len(ball))
    shuffled = draw(ball[order], values=values[order], range=(-0.7, 0.7))
    assert difference(expected, shuffled) <= 2
    with pytest.warns(limpid.LimpidWarning, match="no finite position"):
        holed = draw(
            np.insert(ball, 3, np.nan, axis=0), values=np.insert(values, 3, np.nan), range=(-0.7, 0.7)
        )
    assert np.array_equal(holed.rgba, expected.rgba)


def test_the_range_is_the_usual_one_and_can_be_kept(draw, ball):
    values = np.linspace(0, 100, len(ball))
    picture = draw(values=values)
    assert np.allclose(picture.range, (2, 98), atol=0.2)
    assert draw(values=values, range="auto").range == picture.range
    assert np.array_equal(draw(values=values, range=picture.range).rgba, picture.rgba)
    assert draw(values=values + 50, range=picture.range, colormap="Turbo").range == picture.range
    whole = draw(values=np.full(len(ball), 30.0), aovs=["value"])
    assert whole.aov["value"][36, 48] == pytest.approx(30, abs=0.01)


def test_values_make_clear_liquid_opaque(draw, renderer, ball, scene):
    values = ball[:, 0]
    picture = draw(values=values, scene=scene, aovs=["inside"])
    assert picture.aov["inside"].max() == 0
    again = draw(values=values, scene=picture.scene)
    assert np.array_equal(again.rgba, picture.rgba)
    # The scene does not insist on values.
    plain = draw(scene=picture.scene)
    assert plain.range is None and difference(plain, picture) > 30
    assert "opaque" not in scene._project.text()


def test_values_replace_those_of_a_scene(draw, ball, tmp_path):
    """They keep its map and its range."""
    (tmp_path / "a.toml").write_text(
        'look = "paint"\ncamera = { eye = [0, 1, 4], target = [0, 0, 0], fov_y = 40 }\n'
        '[liquid]\ncolor_by = "temperature"\ncolormap = "greys"\ncolor_range = [1, 2]\n'
    )
    values = ball[:, 0] + 1.5
    picture = draw(values=values, scene=tmp_path / "a.toml")
    assert (picture.colormap, picture.range) == ("greys", (1, 2))
    assert np.array_equal(picture.rgba, draw(values=values, colormap="greys", range=(1, 2)).rgba)
    with pytest.raises(ValueError, match="no temperature"):
        draw(scene=tmp_path / "a.toml")
    colors = np.full((len(ball), 3), 0.3)
    assert np.array_equal(draw(colors=colors, scene=tmp_path / "a.toml").rgba, draw(colors=colors).rgba)


def test_opaque_liquids_have_any_number_of_colors(draw, ball):
    """A ramp of as many colours as particles is smooth."""
    share = np.clip(ball[:, :1] / 1.6 + 0.5, 0, 1)
    ramp = share * [1, 0, 0] + (1 - share) * [0, 0, 1]
    row = draw(colors=ramp).rgba[36, 34:62].astype(int)
    difference = row[:, 0] - row[:, 2]
    assert (np.diff(difference) > 0).all() and len(set(difference)) > 20


def test_bytes_are_srgb_and_coverage_is_ignored(draw, ball, scene):
    rng = np.random.default_rng(7)
    some = rng.integers(0, 256, (len(ball), 3), np.uint8)
    share = some / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    covered = np.column_stack([some, np.zeros(len(ball), np.uint8)])
    for of in (scene, draw().scene):
        expected = draw(colors=linear, scene=of)
        for colors in (some, covered, np.column_stack([linear, np.full(len(ball), 7.0)])):
            assert np.array_equal(draw(colors=colors, scene=of).rgba, expected.rgba)


def test_views_show_values(renderer, ball, painted):
    cameras = [painted.camera, painted.camera.turned(90)]
    keywords = dict(radius=0.05, values=ball[:, 0], colormap="plasma", scene=painted, size=(32, 24))
    for camera, view in zip(cameras, renderer.render_views(ball, cameras, **keywords)):
        assert np.array_equal(renderer.render(ball, camera=camera, **keywords).rgba, view)


def test_legends_are_drawn_over_copies(draw, ball):
    picture = draw(values=ball[:, 0], size=(320, 240))
    before = picture.rgba.copy()
    with_legend = picture.legend("pressure [Pa]")
    changed = (with_legend.rgba != before).any(axis=2)
    assert changed[10:120, 240:].mean() > 0.5 and not changed[:, :200].any()
    assert np.array_equal(picture.rgba, before)
    assert np.array_equal(with_legend.radiance, picture.radiance)
    assert not np.array_equal(with_legend.rgba, picture.legend("pressure").rgba)
    small = draw(values=ball[:, 0])
    assert np.array_equal(small.legend().rgba, small.rgba)
    with pytest.raises(ValueError, match="give values"):
        draw().legend()
    with pytest.raises(ValueError, match="the title of a legend is 3"):
        picture.legend(3)


def test_films_keep_a_range(renderer, ball, painted, tmp_path):
    """It is that of the first frame whose values differ: emitters begin without particles."""
    heat = ball[:, 0] + 2
    frames = [limpid.Particles(np.zeros((0, 3)))]
    frames += [limpid.Particles(ball, values=v) for v in (np.full(len(ball), 5.0), heat, 2 * heat)]
    keywords = dict(radius=0.05, scene=painted, size=(320, 240))
    film = renderer.film(frames, tmp_path / "a.gif", colormap="turbo", legend="heat", **keywords)
    none, level, first, second = film
    assert none.colormap is None and level.range is None
    assert first.range == second.range == renderer.render(frames[2], **keywords).range
    expected = renderer.render(frames[3], colormap="turbo", range=first.range, **keywords).legend("heat")
    assert np.array_equal(second.rgba, expected.rgba)
    given = list(renderer.film(frames, tmp_path / "b.gif", range=(1, 3), **keywords))
    assert {picture.range for picture in given[1:]} == {(1, 3)}


def test_films_of_a_scene_with_an_attribute_keep_its_range(renderer, ball, tmp_path):
    (tmp_path / "a.toml").write_text(
        'look = "paint"\ncamera = { eye = [0, 1, 4], target = [0, 0, 0], fov_y = 40 }\n[liquid]\ncolor_by = "velocity"\n'
    )
    speeds = ball - ball.min() + 1
    frames = [limpid.Particles(ball, velocities=k * speeds) for k in (1, 2)]
    first, second = renderer.film(frames, tmp_path / "a.gif", radius=0.05, scene=tmp_path / "a.toml", size=SMALL)
    assert first.range is not None and first.range == second.range


def test_films_say_where_values_lack(renderer, ball, tmp_path):
    for keywords, problem in [
        (dict(colormap="virdis"), "is it viridis"),
        (dict(range=(2, 1)), "range is"),
        (dict(legend=3), "the title of a legend"),
    ]:
        with pytest.raises(ValueError, match=problem):
            renderer.film([ball], tmp_path / "a.gif", size=SMALL, **keywords)
    limpid.write(tmp_path / "a_1.npz", ball)
    with pytest.raises(ValueError, match="name an attribute of the files"):
        renderer.film(tmp_path / "a_{}.npz", tmp_path / "a.gif", colormap="turbo", size=SMALL)
    for keywords in (dict(range=(1, 2)), dict(legend=True)):
        with pytest.raises(ValueError, match="values"):
            renderer.film([ball], tmp_path / "a.gif", radius=0.05, size=SMALL, **keywords).run()
    assert not (tmp_path / "a.gif").exists()


def test_files_lose_colors_and_values(ball, tmp_path):
    particles = limpid.Particles(ball, colors=ball, values=ball[:, 0])
    with pytest.warns(limpid.LimpidWarning, match="does not hold colors, values"):
        limpid.write(tmp_path / "a.npz", particles)
