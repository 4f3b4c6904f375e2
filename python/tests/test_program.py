"""The program that the package installs: its results, exit codes and signals are those of the program itself."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest

import limpid


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "limpid", *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_the_script_is_installed():
    script = Path(sysconfig.get_path("scripts")) / "limpid"
    if not script.exists():
        script = Path(shutil.which("limpid") or pytest.fail("there is no script"))
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"limpid {limpid.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(("--version",), 0), (("--help",), 0), (("render", "--nonsense"), 2), (("info", "/none.vtk"), 4)],
)
def test_exit_codes(arguments, code):
    done = run(*arguments)
    assert done.returncode == code, done.stderr
    if code:
        assert done.stderr.startswith("limpid: ") and done.stderr.count("\n") == 1
        assert "Traceback" not in done.stderr


def test_a_signal_ends_it_as_the_program(tmp_path, root):
    command = [sys.executable, "-m", "limpid", "render", root / "sims" / "demo.toml"]
    command += ["--turntable", "20", "--size", "320x240", "-o", tmp_path / "turn.apng"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    time.sleep(3)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == [], "the unfinished film is removed"
