"""Threads, signals, processes: the interpreter's lock is released, Ctrl-C ends work, and nothing crashes at the end."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import limpid
from conftest import SMALL

LONG = """
import numpy as np, limpid, sys, time
rng = np.random.default_rng(1)
positions = rng.uniform(0, 1, (60_000, 3))
scene = limpid.Scene(settings={"refract.samples": 16})
renderer = limpid.Renderer()
renderer.render(positions[:2000], scene=scene, size=(64, 48))
print("ready", flush=True)
try:
    while True:
        renderer.render(positions, scene=scene, size=(1600, 1200))
except KeyboardInterrupt:
    print("interrupted", time.time(), flush=True)
    raise
"""


def test_ctrl_c_ends_a_long_picture(tmp_path):
    """The exception comes and the process ends; how long that takes is measured by benches/interrupt.py."""
    process = subprocess.Popen(
        [sys.executable, "-c", LONG], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=120)
    assert out.startswith("interrupted")
    assert errors.rstrip().endswith("KeyboardInterrupt")
    # As any Python program that Ctrl-C ends.
    assert process.returncode in (-signal.SIGINT, 130)


def test_a_renderer_draws_on_after_ctrl_c(renderer, ball, scene, monkeypatch):
    expected = renderer.render(ball, radius=0.05, scene=scene, size=SMALL).rgba
    heavy = limpid.Scene(look=None, environment=(1, 1, 1), camera=scene.camera, settings={"refract.samples": 64})
    timer = threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            renderer.render(ball, radius=0.05, scene=heavy, size=(1000, 800))
    timer.join()
    again = renderer.render(ball, radius=0.05, scene=scene, size=SMALL).rgba
    assert np.array_equal(expected, again)


def test_other_threads_run_while_a_picture_is_drawn(renderer, dam):
    count = 0
    done = False

    def work():
        nonlocal count
        while not done:
            count += 1
            time.sleep(0.001)

    thread = threading.Thread(target=work)
    thread.start()
    before = count
    started = time.perf_counter()
    renderer.render(dam, size=(512, 384), samples=4)
    seconds = time.perf_counter() - started
    steps = count - before
    done = True
    thread.join()
    # With the lock held, the thread would have waited all the time.
    assert steps > 20 * seconds, f"{steps} steps in {seconds} s"


@pytest.mark.parametrize("devices", [1, 2])
def test_threads_draw_at_once(ball, scene, devices):
    """On one device or two, with the pictures of one thread alone."""
    renderers = [limpid.Renderer() for _ in range(devices)]
    shift = [0.0, 0.1, 0.2, 0.3]
    expected = [renderers[0].render(ball + s, radius=0.05, scene=scene, size=SMALL).rgba for s in shift]

    def draw(i):
        renderer = renderers[i % devices]
        return renderer.render(ball + shift[i % 4], radius=0.05, scene=scene, size=SMALL).rgba

    with ThreadPoolExecutor(4) as pool:
        for i, drawn in enumerate(pool.map(draw, range(16))):
            assert np.array_equal(drawn, expected[i % 4]), i
    for renderer in renderers:
        renderer.close()


def test_a_closed_renderer_says_so(ball):
    with limpid.Renderer() as renderer:
        picture = renderer.render(ball, radius=0.05, size=SMALL)
    with pytest.raises(limpid.Error, match="closed"):
        renderer.render(ball, radius=0.05, size=SMALL)
    with pytest.raises(limpid.Error, match="closed"):
        renderer.adapter
    assert picture.radiance.shape == (72, 96, 3), "pictures stay"


def test_a_wrong_device_is_named():
    with pytest.raises(limpid.NoAdapter, match="no graphics adapter fits `Voodoo 2`; there are: .+"):
        limpid.Renderer("Voodoo 2")
    with pytest.raises(ValueError, match="device"):
        limpid.Renderer("")


def test_without_a_driver_the_remedy_is_told(python):
    script = """
import limpid
try:
    limpid.render([[0, 0, 0]], radius=1)
except limpid.NoAdapter as error:
    print(error)
"""
    environment = {**os.environ, "VK_DRIVER_FILES": "/dev/null", "VK_ICD_FILENAMES": "/dev/null"}
    environment["WGPU_BACKEND"] = ""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.stdout == "" and done.returncode == 0:
        pytest.skip("the machine has another adapter, of OpenGL")
    assert "mesa-vulkan-drivers" in done.stdout, done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_fork_is_told_what_to_do(python):
    """A child of a process that has drawn gets an error, not a deadlock; one of a process that has not draws."""
    script = """
import os, sys, limpid
def child():
    pid = os.fork()
    if pid == 0:
        try:
            limpid.render([[0, 0, 0]], radius=0.5, size=(32, 24))
            print("drawn", flush=True)
        except limpid.Error as error:
            print(error, flush=True)
        os._exit(0)
    os.waitpid(pid, 0)
child()
limpid.render([[0, 0, 0]], radius=0.5, size=(32, 24))
child()
"""
    done = python(script)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first == "drawn"
    assert "forked" in second and "spawn" in second


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_a_fork_leaves_its_parent_s_film_and_renderer(python, tmp_path):
    """A child that ends as usual neither removes the unfinished film nor closes the device; nor does it wait."""
    script = """
import os, sys, limpid
renderer = limpid.Renderer()
frames = [[[0, 0, 0]], [[0, 1, 0]]]
film = renderer.film(frames, sys.argv[1], radius=0.5, size=(32, 24))
first = next(film)
for how in ("end", "draw"):
    pid = os.fork()
    if pid == 0:
        if how == "draw":
            try:
                next(film)
            except limpid.Error as error:
                print("forked" in str(error), flush=True)
            try:
                print(renderer.adapter)
            except limpid.Error as error:
                print("forked" in str(error), flush=True)
            del first, film, renderer
        sys.exit(0)
    assert os.waitpid(pid, 0)[1] == 0
film.run()
print(first.radiance.shape, os.path.exists(sys.argv[1]))
"""
    command = [sys.executable, "-c", script, str(tmp_path / "a.gif")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["True", "True", "(24, 32, 3) True"], done.stderr


def test_a_late_signal_does_not_end_the_next_picture(renderer, ball, scene):
    """The handler is slow, and the picture is drawn meanwhile."""

    def slowly(number, frame):
        time.sleep(1.0)
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, slowly)
    try:
        for _ in range(3):
            signal.setitimer(signal.ITIMER_REAL, 0.06)
            with pytest.raises(TimeoutError):
                while True:
                    renderer.render(ball, radius=0.05, scene=scene, size=(200, 150))
            renderer.render(ball, radius=0.05, scene=scene, size=SMALL)
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_bake_loses_no_frame_by_a_signal(root):
    def end(number, frame):
        raise TimeoutError

    expected = [len(p) for p in limpid.bake(root / "sims" / "crown.toml", frames=3)]
    before = signal.signal(signal.SIGALRM, end)
    frames = limpid.bake(root / "sims" / "crown.toml", frames=3)
    found = []
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        while len(found) < 3:
            try:
                found.append(len(next(frames)))
            except TimeoutError:
                pass
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert found == expected and list(frames) == []


def draw_elsewhere(scene):
    ball = np.random.default_rng(1).uniform(-0.5, 0.5, (500, 3))
    return limpid.render(ball, radius=0.05, scene=scene, size=SMALL)


def test_pictures_and_scenes_go_to_other_processes(scene):
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        picture = pool.apply(draw_elsewhere, (scene,))
    assert np.array_equal(picture.rgba, draw_elsewhere(scene).rgba)


def test_a_renderer_is_not_pickled(renderer):
    import pickle

    with pytest.raises(TypeError, match="each process opens a device of its own"):
        pickle.dumps(renderer)


def test_nothing_is_drawn_after_the_end(python):
    script = """
import atexit, numpy as np
positions = np.random.default_rng(1).uniform(0, 1, (100, 3))
def late():
    try:
        limpid.render(positions, radius=0.01, size=(32, 24))
    except limpid.Error as error:
        print(error)
atexit.register(late)  # called after limpid's own
import limpid
limpid.render(positions, radius=0.01, size=(32, 24))
"""
    done = python(script)
    told = ("the renderer was closed\n", "the interpreter is ending, and draws nothing any more\n")
    assert done.returncode == 0 and done.stdout in told, (done.stdout, done.stderr)


def test_the_process_ends_while_a_thread_draws(python):
    script = """
import threading, limpid, numpy as np, time
positions = np.random.default_rng(1).uniform(0, 1, (20_000, 3))
limpid.render(positions[:100], radius=0.01, size=(32, 24))
def work():
    try:
        while True:
            limpid.render(positions, radius=0.01, size=(400, 300))
    except Exception:
        pass
threading.Thread(target=work, daemon=True).start()
time.sleep(0.3)
print("end")
"""
    for _ in range(3):
        done = python(script)
        assert (done.returncode, done.stdout) == (0, "end\n"), done.stderr


def test_the_lock_is_declared(python):
    """Whoever runs a free-threaded build is told: it has not been tested, so the lock is turned on."""
    if not hasattr(sys, "_is_gil_enabled"):
        pytest.skip("this interpreter always has the lock")
    assert sys._is_gil_enabled()
