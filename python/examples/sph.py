"""A dam breaks against a ball: a small simulation in NumPy, drawn while it runs.

    python sph.py [out.gif] [frames]

Position-based fluids (Macklin and Müller 2013): particles fall freely, and are then pushed apart until none is
denser than a regular lattice of them. Lengths are in metres, times in seconds, and y is up.
"""

import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

import limpid

Array = npt.NDArray[Any]
Indices = npt.NDArray[np.int64]

RADIUS = 0.02  # of a particle: half the spacing
REACH = 4 * RADIUS  # particles nearer than this act on each other
LOW, HIGH = np.array([-0.7, 0.0, -0.3]), np.array([0.7, 9.0, 0.3])  # the walls
BALL, BALL_RADIUS = np.array([0.2, 0.1, 0.0]), 0.12  # an obstacle
FPS = 30
STEPS = 3  # of the simulation, for each picture
ITERATIONS = 4  # of the solver, for each step


def column() -> Array:
    """A column of water at the left wall, slightly irregular."""
    grid = np.indices((11, 19, 15)).reshape(3, -1).T + 0.5
    grid += np.random.default_rng(1).uniform(-0.05, 0.05, grid.shape)
    return LOW + 2 * RADIUS * grid


def pairs(positions: Array) -> tuple[Indices, Indices]:
    """All pairs i, j of particles nearer than REACH, sorted by i."""
    cells = np.floor((positions - positions.min(axis=0)) / REACH).astype(int) + 1
    _, height, depth = cells.max(axis=0) + 2
    keys = (cells[:, 0] * height + cells[:, 1]) * depth + cells[:, 2]
    order = np.argsort(keys)
    # The 27 cells around a particle are nine rows of three; each row is one range of the sorted keys.
    around = np.array([-1, 0, 1])
    rows = (keys[:, None] + ((around[:, None] * height + around) * depth).ravel()).ravel()
    first = np.searchsorted(keys[order], rows - 1, "left")
    counts = np.searchsorted(keys[order], rows + 1, "right") - first
    i = np.repeat(np.arange(len(rows)) // 9, counts)
    j = order[np.arange(counts.sum()) + np.repeat(first - np.cumsum(counts) + counts, counts)]
    near = (i != j) & (np.square(positions[i] - positions[j]).sum(axis=1) < REACH**2)
    return i[near], j[near]


def closeness(distances: Array) -> Array:
    """1 at the particle, 0 at REACH. Its square is the kernel."""
    return np.maximum(1 - distances / REACH, 0)


def total(i: Indices, values: Array, count: int) -> Array:
    """For each particle, the sum over its pairs."""
    return np.stack([np.bincount(i, axis, count) for axis in values.T], axis=1)


LATTICE = 2 * RADIUS * np.linalg.norm(np.indices((5, 5, 5)).reshape(3, -1).T - 2.0, axis=1)
REST = np.square(closeness(LATTICE)).sum()  # the density of the lattice


def confine(positions: Array) -> Array:
    """Particles that are back in the box and out of the ball."""
    away = positions - BALL
    distances = np.linalg.norm(away, axis=1, keepdims=True)
    away *= np.maximum((BALL_RADIUS + RADIUS) / np.maximum(distances, 1e-9), 1)
    return np.clip(BALL + away, LOW + RADIUS, HIGH - RADIUS)


def step(positions: Array, velocities: Array, dt: float) -> tuple[Array, Array]:
    """Positions and velocities after dt."""
    count = len(positions)
    velocities = velocities - [0.0, 9.81 * dt, 0.0]
    moved = confine(positions + dt * velocities)
    i, j = pairs(moved)
    for _ in range(ITERATIONS):
        away = moved[i] - moved[j]
        distances = np.linalg.norm(away, axis=1)
        close = closeness(distances)
        # A wall adds about as much density as liquid behind it would.
        low, high = (np.maximum(1 - gap / (3 * RADIUS), 0) for gap in (moved - LOW, HIGH - moved))
        density = 1 + np.bincount(i, close**2, count) + 1.4 * (low**2 + high**2).sum(axis=1)
        slopes = away * (-2 / REACH / REST * close / np.maximum(distances, 1e-9))[:, None]
        walls = 1.4 * 2 / (3 * RADIUS) / REST * (high - low)
        own = total(i, slopes, count) + walls
        # The constant (1/m²) makes the pushes of particles with few neighbours weak.
        steepness = np.square(own).sum(axis=1) + np.bincount(i, np.square(slopes).sum(axis=1), count) + 60.0
        push = -np.maximum(density / REST - 1, 0) / steepness
        shifts = total(i, (push[i] + push[j])[:, None] * slopes, count) + push[:, None] * walls
        moved = confine(moved + np.clip(shifts, -RADIUS / 4, RADIUS / 4))
    velocities = (moved - positions) / dt
    # Viscosity: each particle follows its neighbours a little.
    weights = 0.05 / REST * closeness(np.linalg.norm(moved[i] - moved[j], axis=1))[:, None] ** 2
    return moved, velocities + total(i, weights * (velocities[j] - velocities[i]), count)


def simulate(frames: int) -> Iterator[Array]:
    """The positions for each picture. The simulation waits while the picture is drawn."""
    positions = column()
    velocities = np.zeros_like(positions)
    for _ in range(frames):
        yield positions
        for _ in range(STEPS):
            positions, velocities = step(positions, velocities, 1 / (FPS * STEPS))


def main() -> None:
    path = sys.argv[1] if len(sys.argv) > 1 else "out.gif"
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 48
    scene = limpid.Scene(
        solids=[
            limpid.Plane(ground=limpid.Ground(tile=0.2, fade=8.0), lit=True),
            limpid.Sphere(BALL, BALL_RADIUS, color=(0.8, 0.25, 0.1), lit=True),
        ],
        lights=[limpid.Sun(direction=(-0.5, -1.0, -0.3))],
        camera=limpid.Camera(eye=(1.2, 1.2, 2.4), target=(0.0, 0.35, 0.0), fov_y=32),
    )
    with limpid.Renderer() as renderer:
        print(f"drawn by {renderer.adapter}")
        start = time.perf_counter()
        film = renderer.film(simulate(frames), path, fps=FPS, radius=RADIUS, scene=scene, size=(400, 300))
        for number, picture in enumerate(film, start=1):
            seconds = time.perf_counter() - start
            print(f"frame {number} of {frames} after {seconds:.1f} s, drawn in {picture.seconds:.2f} s", flush=True)


if __name__ == "__main__":
    main()
