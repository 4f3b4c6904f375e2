"""Particle files and simulations."""

from __future__ import annotations

import numpy as np
import pytest

import limpid


def test_attributes_come_back(tmp_path, ball):
    rng = np.random.default_rng(1)
    n = len(ball)
    written = dict(
        velocities=rng.normal(size=(n, 3)).astype(np.float32),
        densities=rng.uniform(900, 1100, n).astype(np.float32),
        radius=rng.uniform(0.04, 0.06, n).astype(np.float32),
        ids=np.arange(n)[::-1],
    )
    for name in ("a.vtk", "a.npz", "a.vtu"):
        limpid.write(tmp_path / name, ball, **written)
        read = limpid.read(tmp_path / name)
        assert len(read) == n
        assert np.array_equal(read.positions, ball) and read.positions.dtype == np.float32
        assert np.array_equal(read.velocities, written["velocities"])
        assert np.array_equal(read.densities, written["densities"])
        assert np.array_equal(read.radii, written["radius"])
        assert np.array_equal(read.ids, written["ids"]) and read.ids.dtype == np.int64
        again = tmp_path / f"again-{name}"
        limpid.write(again, read)
        assert again.read_bytes() == (tmp_path / name).read_bytes()


def test_what_a_format_does_not_hold_is_told(tmp_path, ball):
    with pytest.warns(limpid.LimpidWarning, match="does not hold velocities"):
        limpid.write(tmp_path / "a.xyz", ball, velocities=ball)


def test_far_positions_are_64_bit(tmp_path, ball):
    far = ball.astype(np.float64) + 1e6
    limpid.write(tmp_path / "far.npz", far)
    read = limpid.read(tmp_path / "far.npz").positions
    assert read.dtype == np.float64 and np.abs(read - far).max() < 1e-6


def test_bad_files_are_os_errors(tmp_path, ball):
    with pytest.raises(FileNotFoundError) as caught:
        limpid.read(tmp_path / "none.vtk")
    assert caught.value.filename == str(tmp_path / "none.vtk")
    with pytest.raises(OSError):
        limpid.read(tmp_path)
    (tmp_path / "bad.bgeo").write_bytes(b"not geometry")
    with pytest.raises(limpid.FileError, match="bad.bgeo") as error:
        limpid.read(tmp_path / "bad.bgeo")
    assert isinstance(error.value, OSError) and isinstance(error.value, limpid.Error)
    with pytest.raises(OSError):
        limpid.write(tmp_path / "a.jpeg", ball)
    with pytest.raises(ValueError, match="radius"):
        limpid.write(tmp_path / "a.vtk", ball, radius=[1, 2])
    assert [f.name for f in tmp_path.iterdir()] == ["bad.bgeo"]


def test_some_of_a_file_is_read(tmp_path):
    path = tmp_path / "walls.csv"
    path.write_text("x,y,z,Type,Idp,d\n0,0,0,0,1,0.2\n1,0,0,3,2,0.2\n2,0,0,3,3,0.2\nnan,0,0,3,4,0.2\n")
    with pytest.warns(limpid.LimpidWarning) as caught:
        read = limpid.read(path, map="diameter=d")
    assert len(caught) == 2 and "walls and bodies are left out (Type 0)" in str(caught[0].message)
    assert read.positions[:, 0].tolist() == [1, 2] and read.radii.tolist() == pytest.approx([0.1, 0.1])
    with pytest.warns(limpid.LimpidWarning, match="no finite position"):
        assert len(limpid.read(path, select="all")) == 3
    assert len(limpid.read(path, select="idp in 1..2")) == 2
    with pytest.raises(ValueError, match="select `idp`"):
        limpid.read(path, select="idp")


def test_bake_is_the_program_s(program, root, tmp_path):
    program("bake", root / "sims" / "crown.toml", "--frames", "3", "-o", tmp_path)
    frames = limpid.bake(root / "sims" / "crown.toml", frames=3)
    assert len(frames) == 3 and frames.fps > 0
    files = sorted(tmp_path.glob("crown_*.bgeo"))
    assert len(files) == 3
    for path, particles in zip(files, frames):
        read = limpid.read(path)
        assert np.array_equal(read.positions, particles.positions)
        assert np.array_equal(read.velocities, particles.velocities)
        assert particles.radius and particles.radius > 0
    with pytest.raises(StopIteration):
        next(frames)
    with pytest.raises(ValueError, match="no \\[simulation\\]"):
        limpid.bake(root / "sims" / "demo.toml")
    with pytest.raises(ValueError, match="frames is 0"):
        limpid.bake(root / "sims" / "crown.toml", frames=0)
