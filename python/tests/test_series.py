"""Properties that are guessed once, and hold for the pictures that follow."""

from __future__ import annotations

import numpy as np
import pytest

import limpid
from conftest import SMALL


def loop(renderer, frames, **keywords):
    """The loop of the manual."""
    scene, pictures = None, []
    for particles in frames:
        picture = renderer.render(particles, scene=scene, size=SMALL, **keywords)
        scene = picture.scene
        pictures.append(picture)
    return pictures


def grid(x, y, z, spacing=0.1):
    axes = [spacing * np.arange(n) for n in (x, y, z)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


SHADES = np.array([(0.9, 0.2, 0.1), (0.1, 0.3, 0.9)])


@pytest.mark.parametrize("of", ["colors", "values", "an attribute"])
def test_a_loop_draws_what_a_film_draws(renderer, tmp_path, of):
    """Emitters begin without particles, and their liquid grows, by which tints and ranges would change."""
    frames = []
    for length in (0, 4, 9, 14):
        places = grid(length, 5, 6)
        rows = np.arange(len(places))
        more = {
            "colors": dict(colors=SHADES[rows % 2]),
            "values": dict(values=rows.astype(float)),
            "an attribute": dict(velocities=places + length),
        }[of]
        frames.append(limpid.Particles(places, radius=0.05, **more))
    if of == "an attribute":
        (tmp_path / "a.toml").write_text('look = "paint"\n[liquid]\ncolor_by = "velocity"\n')
        frames = frames[1:]
        start = limpid.Scene.load(tmp_path / "a.toml")
    else:
        start = None
    film = list(renderer.film(frames, tmp_path / "a.gif", scene=start, size=SMALL))
    scene = start
    for particles, expected in zip(frames, film, strict=True):
        picture = renderer.render(particles, scene=scene, size=SMALL)
        scene = picture.scene
        assert np.array_equal(picture.rgba, expected.rgba)
        assert picture.range == expected.range
    if of == "colors":
        assert scene.tint_thickness == film[1].scene.tint_thickness > 0
        assert scene.tint_thickness != renderer.render(frames[-1], size=SMALL).scene.tint_thickness
        scene.save(tmp_path / "b.toml")
        assert limpid.Scene.load(tmp_path / "b.toml").tint_thickness == scene.tint_thickness
    if of == "values":
        alone = renderer.render(frames[1], size=SMALL)
        assert np.array_equal(alone.rgba, film[1].rgba), "a frame without particles is no scene"
        whole = renderer.render(frames[-1], scene=scene, range="auto", size=SMALL)
        assert whole.range != film[1].range == film[3].range
        plain = renderer.render(frames[-1].positions, scene=scene, size=SMALL)
        assert plain.range is None, "values are not needed"
        scene.save(tmp_path / "b.toml")
        assert "color_by" not in (tmp_path / "b.toml").read_text()


def test_pictures_tell_which_axis_points_up(renderer, dam):
    turned = dam[:, [0, 2, 1]] * np.float32([1, -1, 1])
    for positions, expected in ((dam, "y"), (turned, "z")):
        picture = renderer.render(positions, size=SMALL)
        assert picture.up == expected
        assert renderer.render(positions, scene=picture.scene, size=SMALL).up == expected
        # A look has no axis.
        assert renderer.render(positions, scene=limpid.Scene(look="night"), size=SMALL).up == expected
        assert renderer.render(positions, up="z", size=SMALL).up == "z"
    solid = limpid.Scene(solids=[limpid.Plane()])
    with pytest.warns(limpid.LimpidWarning, match='looks as if z pointed up.*give up="z"'):
        assert renderer.render(turned, scene=solid, size=SMALL).up == "y", "solids are in a world of y up"


@pytest.mark.parametrize("scene", [None, limpid.Scene(look="night")])
def test_a_standing_wall_may_be_a_settled_tank(renderer, recwarn, scene):
    tank = grid(16, 12, 5)
    keywords = dict(radius=0.05, size=SMALL)
    with pytest.warns(limpid.LimpidWarning, match='which axis points up.*give up="z"'):
        picture = renderer.render(tank, scene=scene, **keywords)
    assert picture.up == "y"
    recwarn.clear()
    for positions, more in (
        (tank, dict(up="y")),
        (tank, dict(up="z")),
        (tank, dict(scene=picture.scene)),
        (tank[:, [0, 2, 1]], dict(scene=scene)),
        (grid(8, 8, 8), dict(scene=scene)),
        (grid(4, 12, 4), dict(scene=scene)),
    ):
        renderer.render(positions, **keywords, **more)
        assert not [w for w in recwarn if "axis" in str(w.message)], more
