"""Files in place of arrays: pictures and films of them are the program's, and their frames are read one by one."""

from __future__ import annotations

import functools
import warnings

import numpy as np
import pytest

import limpid
from conftest import SMALL
from test_render import assert_same_png


@pytest.fixture
def files(ball, tmp_path):
    """Three frames, numbered 8, 10, 12, z up and in millimetres, with a temperature."""
    for number in (8, 10, 12):
        squeezed = ball * np.float32([1, 1, 1 - 0.02 * number]) * 1000
        lines = ["x,y,z,temperature"]
        lines += [f"{x},{y},{z},{20 + x / 100}" for x, y, z in squeezed.tolist()]
        (tmp_path / f"ball_{number:02}.csv").write_text("\n".join(lines))
    return tmp_path / "ball_{}.csv"


def test_a_path_is_drawn_as_by_the_program(renderer, program, root, tmp_path):
    source = root / "sims" / "demo.bgeo"
    for arguments, keywords in (
        ((), {}),
        (("--alpha", "--radius", "0.03"), dict(alpha=True, radius=0.03)),
        (("--color-by", "velocity", "--colormap", "turbo"), dict(values="velocity", colormap="turbo")),
    ):
        program("render", source, "--size", "160x120", *arguments, "-o", tmp_path / "a.png")
        for path in (source, str(source)):
            picture = renderer.render(path, size=(160, 120), **keywords)
        picture.save(tmp_path / "b.png")
        assert_same_png(tmp_path / "a.png", tmp_path / "b.png")
    assert picture.colormap == "turbo" and picture.range is not None
    picture.legend()


def test_one_of_several_files_is_drawn_by_its_number(renderer, files):
    keywords = dict(size=SMALL, radius=50)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        first = renderer.render(files, **keywords)
        assert np.array_equal(first.rgba, renderer.render(files, frame=8, **keywords).rgba)
        assert not np.array_equal(first.rgba, renderer.render(files, frame=12, **keywords).rgba)
    with pytest.raises(ValueError, match="frame is 9; .*has 3 frames, 8 to 12"):
        renderer.render(files, frame=9, **keywords)
    for wrong, problem in (
        (dict(velocities=np.zeros((3, 3))), "velocities is given, and files have their own"),
        (dict(radius=[1, 2]), "radius is an array; files take one"),
        (dict(values=[1, 2]), "values is an array; of files, name an attribute"),
        (dict(colormap="turbo"), "name an attribute of the files"),
    ):
        with pytest.raises(ValueError, match=problem):
            renderer.render(files, **{**keywords, **wrong})
    with pytest.raises(ValueError, match="names are for files"):
        renderer.render(np.zeros((3, 3)), values="velocity")
    with pytest.raises(OSError):
        renderer.render("none.vtu")


def test_images_of_files(renderer, root):
    picture = renderer.render(root / "sims" / "demo.bgeo", size=SMALL, aovs=["depth", "motion"])
    assert picture.aov["depth"].max() > 0 and np.abs(picture.aov["motion"]).max() > 0


def test_frames_are_a_sequence(ball, files):
    frames = limpid.frames(files, up="z", scale=0.001, values="temperature")
    assert len(frames) == 3 and frames.numbers == [8, 10, 12] and frames.fps is None
    assert "3 of" in repr(frames)
    first = frames[0]
    expected = (ball * np.float32([1, 1, 0.84]))[:, [0, 2, 1]] * np.float32([1, 1, -1])
    assert np.allclose(first.positions, expected, atol=1e-5), "y up, in metres"
    assert np.allclose(first.values, 20 + ball[:, 0] * 10, atol=1e-3)
    assert [len(particles) for particles in frames] == [len(ball)] * 3
    assert np.array_equal(frames[-1].positions, list(frames)[2].positions)
    part = frames[1:]
    assert part.numbers == [10, 12] and np.array_equal(part[0].positions, frames[1].positions)
    with pytest.raises(IndexError, match="no frame 3"):
        frames[3]
    own = limpid.frames(files)[0]
    assert np.array_equal(own.positions, limpid.read(str(files).replace("{}", "08")).positions)


def test_frames_that_cannot_be_read_are_told(files):
    for wrong, problem in (
        (dict(scale=-1), "scale is -1"),
        (dict(scale="mm"), "scale is 'mm'"),
        (dict(up="x"), "up is 'x'"),
        (dict(values=3), "values is 3"),
        (dict(map="nonsense"), "nonsense"),
    ):
        with pytest.raises(ValueError, match=problem):
            limpid.frames(files, **wrong)
    with pytest.raises(OSError):
        limpid.frames(files.with_name("none_{}.csv"))
    with pytest.raises((OSError, ValueError), match="pressure"):
        limpid.frames(files, values="pressure")[0]


def test_files_with_several_frames(ball, tmp_path):
    several = np.stack([ball, ball + np.float32(1), ball + np.float32(2)])
    np.save(tmp_path / "all.npy", several)
    frames = limpid.frames(tmp_path / "all.npy")
    assert len(frames) == 3
    for i, particles in enumerate(frames):
        assert np.array_equal(particles.positions, several[i])


def test_frames_of_a_scene_file(files, tmp_path):
    text = '[particles]\nsource = "ball_{}.csv"\nup = "z"\nscale = 0.001\nradius = 0.05\nfps = 24.0\n'
    (tmp_path / "scene.toml").write_text(text)
    frames = limpid.frames(tmp_path / "scene.toml")
    assert frames.fps == 24 and frames[0].radius == pytest.approx(0.05)
    given = limpid.frames(files, up="z", scale=0.001)
    assert np.array_equal(frames[1].positions, given[1].positions)
    with pytest.raises(ValueError, match="up and scale are those of the scene"):
        limpid.frames(tmp_path / "scene.toml", up="z")


def test_frames_are_read_when_they_are_asked_for(ball, tmp_path):
    """However many there are, one is in memory."""
    for i in range(3):
        limpid.write(tmp_path / f"w_{i}.npz", ball)
    frames = limpid.frames(tmp_path / "w_{}.npz")
    (tmp_path / "w_1.npz").write_bytes(b"no particles")
    (tmp_path / "w_2.npz").unlink()
    assert len(frames) == 3 and len(frames[0]) == len(ball)
    with pytest.raises(limpid.FileError):
        frames[1]
    with pytest.raises(OSError):
        frames[2]


def test_a_film_of_frames_is_one_of_the_files(renderer, files, tmp_path):
    keywords = dict(size=SMALL, values="temperature", colormap="plasma", radius=0.05)
    frames = limpid.frames(files, up="z", scale=0.001, values="temperature")
    film = renderer.film(frames, tmp_path / "####.png", size=SMALL, radius=0.05, colormap="plasma")
    assert len(film) == 3
    film.run()
    names = sorted(path.name for path in tmp_path.glob("*.png"))
    assert names == ["0008.png", "0010.png", "0012.png"], "by the numbers of the frames"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pictures = list(renderer.film(files, tmp_path / "a.gif", **{**keywords, "radius": 50}, up="z"))
    assert [p.colormap for p in pictures] == ["plasma"] * 3
    assert len({p.range for p in pictures}) == 1


def test_the_range_of_files_own_values_may_replace_the_scenes(renderer, ball, tmp_path):
    limpid.write(tmp_path / "a.npz", ball, velocities=ball, radius=0.05)
    (tmp_path / "a.toml").write_text('look = "paint"\n[liquid]\ncolor_by = "velocity"\ncolor_range = [0, 9]\n')
    draw = functools.partial(renderer.render, tmp_path / "a.npz", size=SMALL)
    own = draw(values="velocity").range
    given = draw(scene=tmp_path / "a.toml")
    assert given.range == (0, 9) != own
    whole = draw(scene=given.scene, range="auto")
    assert whole.range == own == draw(scene=whole.scene).range
    assert draw(range="auto").range is None, "without values there is no range"
