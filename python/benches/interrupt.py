"""How long Ctrl-C takes: from the signal to the exception, and to the end of the process.

    python python/benches/interrupt.py [rounds]
"""

from __future__ import annotations

import signal
import statistics
import subprocess
import sys
import time

SCRIPT = """
import numpy as np, limpid, time
positions = np.random.default_rng(1).uniform(0, 1, (60_000, 3))
scene = limpid.Scene(settings={"refract.samples": 16})
renderer = limpid.Renderer()
renderer.render(positions[:2000], scene=scene, size=(64, 48))
print("ready", flush=True)
try:
    while True:
        renderer.render(positions, scene=scene, size=(1600, 1200))
except KeyboardInterrupt:
    print(time.time(), flush=True)
    raise
"""


def main() -> None:
    raised, ended = [], []
    for i in range(int(sys.argv[1]) if len(sys.argv) > 1 else 8):
        process = subprocess.Popen(
            [sys.executable, "-c", SCRIPT], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        # In all stages of a picture.
        time.sleep(1.0 + 0.7 * i)
        sent = time.time()
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate()
        raised.append(float(out) - sent)
        ended.append(time.time() - sent)
    for name, times in (("exception", raised), ("end of the process", ended)):
        print(f"{name}: median {statistics.median(times):.3f} s, at most {max(times):.3f} s")


if __name__ == "__main__":
    main()
