"""Films: iterators that draw, as the program draws, and leave nothing unfinished."""

from __future__ import annotations

import numpy as np
import pytest

import limpid
from conftest import SMALL


@pytest.fixture
def frames(ball):
    return [ball * np.float32([1, 1 - 0.1 * i, 1]) for i in range(4)]


def test_a_film_is_an_iterator_with_a_length(renderer, frames, tmp_path):
    film = renderer.film(frames, tmp_path / "a.apng", fps=12, radius=0.05, size=SMALL)
    assert len(film) == 4
    pictures = []
    for picture in film:
        assert not (tmp_path / "a.apng").exists(), "only a whole film has its name"
        pictures.append(picture)
    assert len(pictures) == 4 and list(film) == []
    assert {p.camera for p in pictures} == {pictures[0].camera}, "the view does not jump"
    assert [f.name for f in tmp_path.iterdir()] == ["a.apng"]
    image = pytest.importorskip("PIL.Image").open(tmp_path / "a.apng")
    assert image.n_frames == 4
    for i, picture in enumerate(pictures):
        image.seek(i)
        assert np.array_equal(np.asarray(image.convert("RGB")), picture.rgba[..., :3])


def test_films_of_files_are_those_of_the_program(renderer, program, frames, tmp_path):
    for i, positions in enumerate(frames):
        limpid.write(tmp_path / f"ball_{i:02}.npz", positions)
    source = tmp_path / "ball_{}.npz"
    program("render", source, "--size", "96x72", "--fps", "12", "-o", tmp_path / "a.apng")
    film = renderer.film(source, tmp_path / "b.apng", fps=12, size=SMALL)
    assert len(film) == 4
    for _ in film:
        pass
    assert (tmp_path / "a.apng").read_bytes() == (tmp_path / "b.apng").read_bytes()


def test_a_generator_and_a_moving_camera(renderer, frames, tmp_path):
    camera = limpid.Camera((0, 1, 3), (0, 0, 0))
    cameras = (camera.turned(30 * i) for i in range(4))
    film = renderer.film((f for f in frames), tmp_path / "a.gif", radius=0.05, camera=cameras, size=SMALL)
    with pytest.raises(TypeError):
        len(film)
    pictures = list(film)
    assert len({p.camera for p in pictures}) == 4
    assert (tmp_path / "a.gif").stat().st_size > 1000


def test_z_up_stays_as_in_the_first_frame(renderer, frames, tmp_path):
    turned = [f[:, [0, 2, 1]] * np.float32([1, -1, 1]) for f in frames]
    y = list(renderer.film(frames, tmp_path / "y.gif", radius=0.05, up="y", size=SMALL))
    z = list(renderer.film(turned, tmp_path / "z.gif", radius=0.05, up="z", size=SMALL))
    cameras = [z[0].camera.turned(0)] * 4
    given = list(renderer.film(turned, tmp_path / "g.gif", radius=0.05, camera=cameras, up="z", size=SMALL))
    for a, b, c in zip(y, z, given):
        assert limpid.flip(a, b)[0] < 1e-3 and limpid.flip(a, c)[0] < 1e-3
        assert b.camera == c.camera == cameras[0]


def test_the_first_frame_with_particles_settles_a_film(renderer, frames, tmp_path):
    """Emitters begin with nothing."""
    source = [np.zeros((0, 3)), *frames]
    pictures = list(renderer.film(source, tmp_path / "a.gif", size=SMALL))
    assert [p.particles for p in pictures][0] == 0
    assert len({(p.camera, p.radius) for p in pictures[1:]}) == 1


def test_colors_do_not_depend_on_what_joins_later(renderer, ball, tmp_path):
    """A colour is that behind the liquid of the first frame, although later ones have more."""
    colors = np.tile(np.float32([0.9, 0.3, 0.3]), (len(ball), 1))
    small = limpid.Particles(ball, colors=colors)
    more = limpid.Particles(
        np.concatenate([ball, ball + [0, 1.5, 0]]), colors=np.concatenate([colors, colors])
    )
    camera = limpid.Camera((0, 1, 4), (0, 0, 0))
    arguments = dict(radius=0.05, camera=camera, size=SMALL)
    first, later = renderer.film([small, more], tmp_path / "a.gif", **arguments)
    alone = renderer.render(more, **arguments)

    def red(picture):
        pixel = picture.rgba[40, 48].astype(int)
        return pixel[0] - pixel[1]

    assert abs(red(later) - red(first)) < 12
    assert abs(red(alone) - red(first)) > abs(red(later) - red(first))


@pytest.mark.parametrize("how", ["close", "forget", "error", "with"])
def test_an_unfinished_film_is_removed(renderer, frames, tmp_path, how):
    film = renderer.film(frames, tmp_path / "a.gif", radius=0.05, size=SMALL)
    next(film)
    if how == "close":
        film.close()
    elif how == "forget":
        del film
    elif how == "with":
        with film:
            next(film)
    else:
        bad = renderer.film([frames[0], frames[1][:, :2]], tmp_path / "b.gif", radius=0.05, size=SMALL)
        next(bad)
        with pytest.raises(ValueError, match="positions has the shape"):
            next(bad)
        assert list(bad) == []
        film.close()
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_filmed_is_told_before_drawing(renderer, frames, tmp_path):
    for name, keywords, problem in [
        ("a.avi", {}, "film"),
        ("a.gif", {"fps": -1}, "frames per second|fps"),
        ("a.gif", {"fps": "fast"}, "fps is 'fast'"),
        ("a.gif", {"size": (0, 1)}, "size is"),
    ]:
        with pytest.raises(ValueError, match=problem):
            renderer.film(frames, tmp_path / name, **{"size": SMALL, **keywords})
    with pytest.raises(OSError):
        renderer.film(tmp_path / "none_{}.vtk", tmp_path / "a.gif", size=SMALL)
    with pytest.raises(OSError):
        renderer.film(frames, tmp_path / "no" / "a.gif", size=SMALL)
    for wrong, problem in ((dict(camera=5), "camera is 5"), (dict(up=1), "up is 1")):
        with pytest.raises(ValueError, match=problem):
            renderer.film(frames, tmp_path / "a.gif", size=SMALL, **wrong)
    with pytest.raises(ValueError, match="source is 5"):
        renderer.film(5, tmp_path / "a.gif", size=SMALL)
    for one in (frames[0], limpid.Particles(frames[0])):
        with pytest.raises(ValueError, match="source is one frame"):
            renderer.film(one, tmp_path / "a.gif", size=SMALL)
    few = renderer.film(frames, tmp_path / "a.gif", camera=[limpid.Camera((0, 1, 3), (0, 0, 0))], size=SMALL)
    with pytest.raises(ValueError, match="camera has 1 entries"):
        few.run()
    for wrong, problem in (
        (dict(alpha=True), "films have no coverage"),
        (dict(colors=5), "colors is 5; expected one array for each frame"),
        (dict(values="velocity"), "names are for files"),
        (dict(progress=3), "progress is 3"),
    ):
        with pytest.raises(ValueError, match=problem):
            renderer.film(frames, tmp_path / "a.gif", size=SMALL, **wrong)
    with pytest.raises(ValueError, match="cannot all be"):
        renderer.film(frames, tmp_path / "a.png", size=SMALL)
    with pytest.raises(FileNotFoundError):
        renderer.film(frames, tmp_path / "no" / "####.png", size=SMALL)
    short = renderer.film(iter(frames), tmp_path / "a.gif", values=[np.zeros(len(frames[0]))], size=SMALL)
    with pytest.raises(ValueError, match="values has 1 entries"):
        short.run()
    few = np.zeros((4, len(frames[0])))
    for wrong, problem in (
        (dict(values=few.T), f"values has {len(few.T)} entries for 4 frames; .*, as values.swapaxes"),
        (dict(values=few[0]), r"values has the shape \(.*; expected one array for each frame, as \[values, ...\]"),
        (dict(velocities=frames[0]), "velocities has the shape .* expected one array for each frame"),
        (dict(colors=frames[:3]), "colors has 3 entries for 4 frames; expected one array for each frame$"),
    ):
        with pytest.raises(ValueError, match=problem):
            renderer.film(frames, tmp_path / "a.gif", size=SMALL, **wrong)
    with pytest.raises(ValueError, match="without pictures"):
        list(renderer.film([], tmp_path / "a.gif", size=SMALL))
    assert list(tmp_path.iterdir()) == []


def test_each_frame_has_its_own_arrays(renderer, frames, tmp_path):
    values = [f[:, 0] for f in frames]
    velocities = [np.full_like(f, 0.1 * i) for i, f in enumerate(frames)]
    camera = limpid.Camera((0, 1, 4), (0, 0, 0))
    keywords = dict(radius=0.05, camera=camera, size=SMALL, aovs=["motion"])
    film = renderer.film(frames, tmp_path / "a.gif", values=values, velocities=velocities, **keywords)
    pictures = list(film)
    assert len({p.range for p in pictures}) == 1, "the range of the first frame is kept"
    moved = [np.abs(p.aov["motion"]).max() for p in pictures]
    assert moved[0] < 1e-4 and moved[1] < moved[2] < moved[3]
    alone = renderer.render(frames[0], values=values[0], velocities=velocities[0], **keywords)
    assert np.array_equal(alone.rgba, pictures[0].rgba)
    colors = [np.tile(np.float32([1, 0.2 * i, 0]), (len(f), 1)) for i, f in enumerate(frames)]
    tinted = list(renderer.film(frames, tmp_path / "b.gif", colors=colors, radius=0.05, size=SMALL))
    assert not np.array_equal(tinted[0].rgba, tinted[3].rgba)


def test_pictures_of_a_film_have_files_of_their_own(renderer, frames, tmp_path):
    keywords = dict(radius=0.05, size=SMALL, alpha=True, aovs=["depth"])
    film = renderer.film(frames, tmp_path / "w_####.png", **keywords)
    pictures = list(film)
    assert sorted(f.name for f in tmp_path.iterdir()) == [f"w_000{i}.png" for i in range(4)]
    image = pytest.importorskip("PIL.Image").open(tmp_path / "w_0002.png")
    assert np.array_equal(np.asarray(image), pictures[2].rgba), "with coverage"
    stopped = renderer.film(frames, f"{tmp_path}/folder/", **keywords)
    next(stopped)
    stopped.close()
    assert [f.name for f in (tmp_path / "folder").iterdir()] == ["frame_0000.png"], "whole pictures stay"
    renderer.film(frames, tmp_path / "w_{}.exr", **keywords).run()
    assert len(list(tmp_path.glob("*.exr"))) == 4


def test_several_cameras_see_one_frame(renderer, frames, tmp_path):
    camera = limpid.Camera((0, 1, 3), (0, 0, 0))
    cameras = [camera.turned(30 * i) for i in range(5)]
    limpid.write(tmp_path / "ball.npz", frames[0])
    for source in (frames[0], limpid.Particles(frames[0]), tmp_path / "ball.npz"):
        film = renderer.film(source, tmp_path / "a.gif", camera=cameras, radius=0.05, size=SMALL)
        assert len(film) == 5
        assert [p.camera for p in film] == cameras
    for i, f in enumerate(frames):
        limpid.write(tmp_path / f"s_{i}.npz", f)
    film = renderer.film(tmp_path / "s_{}.npz", tmp_path / "a.gif", camera=cameras, radius=0.05, size=SMALL)
    assert [p.camera for p in film] == cameras[:4]
    with pytest.raises(ValueError, match="camera has no entries"):
        renderer.film(tmp_path / "s_{}.npz", tmp_path / "a.gif", camera=[], size=SMALL)


def test_notebooks_play_films(renderer, frames, tmp_path):
    keywords = dict(radius=0.05, size=SMALL)
    film = renderer.film(frames, tmp_path / "a.gif", **keywords)
    assert "4 pictures" in repr(film) and "0 of" not in repr(film), "notebooks write it beside the finished film"
    next(film)
    assert "1 of 4 pictures drawn" in repr(film)
    shown = film._repr_html_()
    assert shown.startswith('<img src="data:image/gif;base64,') and "complete" in repr(film)
    assert shown == film._repr_html_(), "drawn once"
    kept = renderer.film(frames, **keywords)
    shown = kept._repr_html_()
    assert "data:video/mp4;base64," in shown or "data:image/gif;base64," in shown
    folder = kept.path
    del kept, film
    import os

    assert not os.path.exists(folder), "nothing is left of a film without a path"
    closed = renderer.film(frames, tmp_path / "b.gif", **keywords)
    closed.close()
    assert "closed" in repr(closed) and "complete" not in repr(closed)
    assert "data:" not in closed._repr_html_()
    assert "4 pictures" in renderer.film(frames, tmp_path / "####.png", **keywords)._repr_html_()


def test_a_film_tells_how_far_it_is_and_can_be_stopped(renderer, frames, tmp_path):
    told = []
    film = renderer.film(iter(frames), tmp_path / "a.gif", radius=0.05, size=SMALL, progress=lambda *x: told.append(x))
    film.run()
    assert sorted(set(told)) == sorted((i, None) for i in {done for done, _ in told})
    assert {1, 2, 3, 4} <= {done for done, _ in told} and told[-1] == (4, None)
    film = renderer.film(
        frames, tmp_path / "b.gif", radius=0.05, size=SMALL, progress=lambda done, total: (done, total) != (2, 4)
    )
    with pytest.raises(limpid.Cancelled):
        film.run()
    assert [f.name for f in tmp_path.iterdir()] == ["a.gif"] and list(film) == []


def test_film_is_a_function(frames, tmp_path):
    limpid.film(frames, tmp_path / "a.gif", radius=0.05, size=SMALL).run()
    assert (tmp_path / "a.gif").stat().st_size > 1000
