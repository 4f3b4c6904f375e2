"""Fixtures of the tests: particles, a renderer, and the files of the repository."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import limpid

ROOT = Path(__file__).parents[2]

SMALL = (96, 72)

# Where the tests were started without it, as a shell's background jobs are, those of Ctrl-C would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def dam() -> Any:
    """The positions of a dam break, (n, 3), float32."""
    return limpid.read(ROOT / "sims" / "demo.bgeo").positions


@pytest.fixture(scope="session")
def ball() -> Any:
    """A ball of 1,400 particles with a spacing of 0.1 m."""
    axis = np.arange(-7, 8) * 0.1
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    return grid[np.linalg.norm(grid, axis=1) < 0.7].astype(np.float32)


@pytest.fixture(scope="session")
def renderer() -> Iterator[limpid.Renderer]:
    with limpid.Renderer() as renderer:
        yield renderer


@pytest.fixture(scope="session")
def scene() -> limpid.Scene:
    """A complete scene: nothing is measured for it."""
    return limpid.Scene(
        look=None,
        environment=(0.6, 0.7, 0.9),
        solids=[limpid.Plane((0, -1, 0), checker=limpid.Checker(0.25), half_extent=4)],
        camera=limpid.Camera((0, 1, 4), (0, 0, 0)),
    )


@pytest.fixture
def program() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs the program of the package."""

    def run(*arguments: Any) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "limpid", *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done

    return run


@pytest.fixture
def python() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs a script in a process of its own."""

    def run(script: str, **more: Any) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-W", "error::RuntimeWarning", "-c", script]
        environment = {**os.environ, "PYTHONFAULTHANDLER": "1"}
        return subprocess.run(
            command, capture_output=True, text=True, check=False, env=environment, timeout=300, **more
        )

    return run
