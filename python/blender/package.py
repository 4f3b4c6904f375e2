#!/usr/bin/env python3
"""Makes the extension for Blender: a zip for a platform that carries limpid's wheel.

    python/blender/package.py WHEEL... [-o FOLDER]

Blender installs it from disk, without a package index.
"""

import argparse
import re
import sys
import tomllib
import zipfile
from pathlib import Path

ADDON = Path(__file__).parent / "limpid_render"

# Blender's names of platforms, by the end of a wheel's.
PLATFORMS = {
    r"manylinux_\d+_\d+_x86_64": ["linux-x64"],
    r"win_amd64": ["windows-x64"],
    r"win_arm64": ["windows-arm64"],
    r"macosx_\d+_\d+_arm64": ["macos-arm64"],
    r"macosx_\d+_\d+_x86_64": ["macos-x64"],
    r"macosx_\d+_\d+_universal2": ["macos-arm64", "macos-x64"],
}

# Zips of the same files are the same to the byte.
_DATE = (1980, 1, 1, 0, 0, 0)


class Refused(Exception):
    """A wheel that no extension can carry."""


def package(wheel, folder):
    """Writes the extension with this wheel into a folder; returns its path."""
    manifest = (ADDON / "blender_manifest.toml").read_text(encoding="utf-8")
    version = tomllib.loads(manifest)["version"]
    platforms = _platforms(wheel.name, version)
    if not zipfile.is_zipfile(wheel):
        raise Refused(f"{wheel} is no wheel")
    lines = [f"platforms = {_list(platforms)}", f"wheels = {_list([f'./wheels/{wheel.name}'])}"]
    # Before the tables.
    manifest = manifest.replace("\n[permissions]", "\n".join(["", *lines, "", "[permissions]"]), 1)
    name = f"limpid_render-{version}-{'-'.join(platforms)}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    files = {"blender_manifest.toml": manifest.encode()}
    files |= {path.name: path.read_bytes() for path in sorted(ADDON.glob("*.py"))}
    files |= {path.name: path.read_bytes() for path in sorted(ADDON.parents[2].glob("LICENSE-*"))}
    partial = folder / f"{name}.part"
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
            for file, content in files.items():
                archive.writestr(zipfile.ZipInfo(file, _DATE), content, zipfile.ZIP_DEFLATED)
            # A wheel is compressed already.
            info = zipfile.ZipInfo(f"wheels/{wheel.name}", _DATE)
            archive.writestr(info, wheel.read_bytes(), zipfile.ZIP_STORED)
        return partial.replace(folder / name)
    finally:
        partial.unlink(missing_ok=True)


def _platforms(name, version):
    """Blender's platforms of a wheel with this file name."""
    parts = re.fullmatch(r"limpid_renderer-([^-]+)-cp3\d+-abi3-([^-]+)\.whl", name)
    if parts is None:
        raise Refused(f"{name} is no wheel of limpid-renderer with Python's stable interface")
    if parts[1] != version:
        raise Refused(f"{name} is of version {parts[1]}, and the extension is of {version}")
    for tag in parts[2].split("."):
        for pattern, platforms in PLATFORMS.items():
            if re.fullmatch(pattern, tag):
                return platforms
    raise Refused(f"{name} is for {parts[2]}, where Blender does not run")


def _list(values):
    return "[" + ", ".join(f'"{value}"' for value in values) + "]"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, nargs="+", metavar="WHEEL")
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="FOLDER")
    arguments = parser.parse_args()
    try:
        for wheel in arguments.wheels:
            print(package(wheel, arguments.output))
    except (OSError, Refused) as error:
        sys.exit(f"package: {error}")


if __name__ == "__main__":
    main()
