"""Costs of a call beyond the picture: arrays to particles, threads, and the picture to an array.

    python python/benches/overhead.py [calls]

40,000 particles in a complete scene, at two sizes, with one kept renderer. Each call is paired with its own
``picture.seconds``: the time of the calls that the program makes for a frame (classification, drawing, reading back).
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

import limpid


def main() -> None:
    calls = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(np.arange(50), np.arange(20), np.arange(40)), axis=-1)
    positions = 0.02 * (grid.reshape(-1, 3) + rng.uniform(-0.1, 0.1, (40_000, 3)))
    scene = limpid.Scene(
        look=None,
        environment=(0.7, 0.8, 0.9),
        solids=[limpid.Plane((0, -0.01, 0), checker=limpid.Checker(0.1))],
        camera=limpid.Camera((1.6, 1.2, 2.4), (0.5, 0.15, 0.4)),
    )
    with limpid.Renderer() as renderer:
        print(f"{renderer.adapter}; {calls} calls each")
        print("| size | array | call, ms | picture, ms | beyond it, ms | share |")
        print("|---|---|---|---|---|---|")
        for size in ((320, 240), (1024, 768)):
            for kind in ("float32", "float64"):
                array = positions.astype(kind)
                arguments = dict(scene=scene, radius=0.01, size=size)
                for _ in range(3):
                    renderer.render(array, **arguments)
                whole, beyond = [], []
                for _ in range(calls):
                    started = time.perf_counter()
                    picture = renderer.render(array, **arguments)
                    whole.append(1e3 * (time.perf_counter() - started))
                    beyond.append(whole[-1] - 1e3 * picture.seconds)
                call, more = statistics.median(whole), statistics.median(beyond)
                share = 100 * more / (call - more)
                width, height = size
                print(
                    f"| {width}x{height} | {kind} | {call:.1f} | {call - more:.1f} | {more:.2f} | {share:.2f} % |"
                )


if __name__ == "__main__":
    main()
