"""The extension that carries a wheel."""

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import limpid

from blender_tools import ADDON, DAM

# After the tools, which skip these tests without it.
import bpy

SCRIPT = ADDON.parent / "package.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("package", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """A wheel of the package that is installed here."""
    version = limpid.__version__
    path = tmp_path_factory.mktemp("wheel")
    path /= f"limpid_renderer-{version}-cp310-abi3-manylinux_2_28_x86_64.whl"
    information = f"limpid_renderer-{version}.dist-info"
    texts = {
        "METADATA": f"Metadata-Version: 2.1\nName: limpid-renderer\nVersion: {version}\n",
        "WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: false\n"
        "Tag: cp310-abi3-manylinux_2_28_x86_64\n",
    }
    folder = Path(limpid.__file__).parent
    files = [file for file in folder.iterdir() if file.is_file()]
    names = [f"limpid/{file.name}" for file in files] + [f"{information}/{n}" for n in texts]
    texts["RECORD"] = "".join(f"{name},,\n" for name in names) + f"{information}/RECORD,,\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for file in files:
            archive.write(file, f"limpid/{file.name}")
        for name, text in texts.items():
            archive.writestr(f"{information}/{name}", text)
    return path


INSTALLED = """
import importlib.machinery, sys
archive, user, particles, picture = sys.argv[1:]

class Own:
    # The package of the environment is hidden: limpid comes with the extension.
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "limpid":
            places = [place for place in sys.path if place.startswith(user)]
            found = importlib.machinery.PathFinder.find_spec(name, places)
            if found is None:
                raise ModuleNotFoundError("no limpid", name=name)
            return found

sys.meta_path.insert(0, Own)
import bpy
bpy.ops.extensions.package_install_files(
    filepath=archive, repo="user_default", enable_on_install=True)
scene = bpy.context.scene
scene.render.engine = "LIMPID"
scene.limpid.particles = particles
scene.render.resolution_x, scene.render.resolution_y = 64, 48
scene.render.filepath = picture
bpy.ops.render.render(write_still=True)
import limpid
print("limpid of", limpid.__file__)
"""


def test_the_extension_brings_limpid(tmp_path, wheel):
    command = [sys.executable, SCRIPT, wheel, "-o", tmp_path]
    made = subprocess.run(command, capture_output=True, text=True, check=True)
    archive = Path(made.stdout.strip())
    assert archive.name == f"limpid_render-{limpid.__version__}-linux-x64.zip"

    user, picture = tmp_path / "user", tmp_path / "picture.png"
    done = subprocess.run(
        [sys.executable, "-c", INSTALLED, archive, user, DAM, picture],
        capture_output=True,
        text=True,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(user)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert picture.exists()
    assert f"limpid of {user}" in done.stdout


def test_the_manifest_of_the_extension_is_valid(tmp_path, script, wheel):
    archive = script.package(wheel, tmp_path)
    with zipfile.ZipFile(archive) as files:
        manifest = tomllib.loads(files.read("blender_manifest.toml").decode())
        names = set(files.namelist())
    assert manifest["platforms"] == ["linux-x64"]
    assert manifest["wheels"] == [f"./wheels/{wheel.name}"] and f"wheels/{wheel.name}" in names
    assert {path.name for path in ADDON.glob("*.py")} <= names
    assert {"LICENSE-MIT", "LICENSE-APACHE"} <= names
    scripts = Path(bpy.utils.resource_path("LOCAL")) / "scripts"
    tool = scripts / "addons_core/bl_pkg/cli/blender_ext.py"
    checked = subprocess.run(
        [sys.executable, tool, "validate", archive], capture_output=True, text=True
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


PLATFORMS = {
    "manylinux_2_28_x86_64": "linux-x64",
    "manylinux_2_17_x86_64.manylinux2014_x86_64": "linux-x64",
    "win_amd64": "windows-x64",
    "macosx_11_0_arm64": "macos-arm64",
    "macosx_11_0_universal2": "macos-arm64-macos-x64",
}


@pytest.mark.parametrize("tag", PLATFORMS)
def test_wheels_are_for_the_platforms_of_blender(tmp_path, script, tag):
    wheel = tmp_path / f"limpid_renderer-{limpid.__version__}-cp310-abi3-{tag}.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("limpid/__init__.py", "")
    first = script.package(wheel, tmp_path / "a")
    assert first.name == f"limpid_render-{limpid.__version__}-{PLATFORMS[tag]}.zip"
    assert first.read_bytes() == script.package(wheel, tmp_path / "b").read_bytes()


REFUSED = {
    "limpid_renderer-9.9.9-cp310-abi3-win_amd64.whl": "is of version 9.9.9, and the extension",
    "limpid_renderer-{}-cp310-abi3-musllinux_1_2_x86_64.whl": "where Blender does not run",
    "limpid_renderer-{}-cp311-cp311-win_amd64.whl": "no wheel of limpid-renderer with Python",
    "limpid_renderer-{}-cp310-abi3-win_amd64.whl": "is no wheel",
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_wheels_are_refused(tmp_path, name):
    wheel = tmp_path / name.format(limpid.__version__)
    wheel.write_bytes(b"no zip")
    command = [sys.executable, SCRIPT, wheel, "-o", tmp_path / "out"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and re.search(REFUSED[name], done.stderr), done.stderr
    assert not list(tmp_path.glob("out/*"))
