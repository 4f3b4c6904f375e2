"""Types: the stubs are those of the native half, and the package passes strict checks."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("mypy")


def run(*arguments, **more):
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, **more)


def test_stubs_agree_with_the_package():
    done = run("mypy.stubtest", "limpid", "--ignore-missing-stub")
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_is_typed(root):
    done = run("mypy", "--strict", "-p", "limpid")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_wrong_call_is_found(tmp_path):
    script = tmp_path / "wrong.py"
    script.write_text(
        "import limpid\nlimpid.Camera('front', 3)\nlimpid.render([[0, 0, 0]]).rgbaa\n"
        "limpid.render('water.vtu', aovs=['dept'])\nlimpid.film([], up='x')\n"
    )
    done = run("mypy", "--strict", str(script))
    assert done.returncode == 1 and "rgbaa" in done.stdout and "Camera" in done.stdout
    assert "dept" in done.stdout and '"up"' in done.stdout


def test_everything_has_a_docstring():
    import limpid

    for name in limpid.__all__:
        value = getattr(limpid, name)
        if callable(value):
            assert value.__doc__, name
            for member, inner in vars(value).items() if isinstance(value, type) else []:
                if not member.startswith("_") and callable(inner):
                    assert inner.__doc__, f"{name}.{member}"
