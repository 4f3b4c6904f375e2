"""Memory: it does not grow from call to call."""

from __future__ import annotations

import os

import pytest

import limpid

#: Calls; 10,000 make a long run.
CALLS = int(os.environ.get("LIMPID_CALLS", "1000"))


def test_memory_does_not_grow(ball, scene):
    psutil = pytest.importorskip("psutil")
    process = psutil.Process()
    with limpid.Renderer() as renderer:

        def draw(count):
            for _ in range(count):
                picture = renderer.render(ball, radius=0.05, scene=scene, size=(48, 36))
                picture.radiance
            return process.memory_info().rss

        first = draw(100)
        last = draw(CALLS - 100)
    # The allocator's own noise is some MiB: of a thousand calls, 7 KB each would be found.
    assert last - first < 6 << 20, f"{(last - first) / 2**20:.1f} MiB in {CALLS} calls"
