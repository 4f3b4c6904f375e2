#!/usr/bin/env python3
"""Writes the licences of all crates that a package of the workspace is built from:

    scripts/packaging/licences.py limpid-python [FEATURE ...] >LICENSE-THIRD-PARTY.txt

Texts that several crates share stand there once. Reads what cargo has fetched; deny.toml decides what may be among them.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = re.compile(r"(licen[cs]e|copying|copyright|notice|unlicense|ofl|ufl).*", re.IGNORECASE)
SOURCES = {".rs", ".toml", ".json", ".py"}


def crates(package: str, features: list[str]) -> list[dict]:
    """The crates that end up in a package, without those of the workspace, tests and build scripts."""
    command = ["cargo", "metadata", "--locked", "--format-version=1", f"--manifest-path=crates/{package}/Cargo.toml"]
    command += ["--filter-platform=x86_64-unknown-linux-gnu", f"--features={','.join(features)}"]
    found = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout)
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    known = {crate["id"]: crate for crate in found["packages"]}
    (first,) = (crate["id"] for crate in known.values() if crate["name"] == package)
    waiting, seen = [first], {first}
    while waiting:
        for dependency in nodes[waiting.pop()]["deps"]:
            is_part = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            if is_part and dependency["pkg"] not in seen:
                seen.add(dependency["pkg"])
                waiting.append(dependency["pkg"])
    # The workspace's own have no source.
    return sorted((known[i] for i in seen if known[i]["source"]), key=lambda crate: crate["name"])


def texts(crate: dict) -> list[str]:
    """The licence files of a crate, also those of fonts in a folder of it."""
    folder = Path(crate["manifest_path"]).parent
    there = [path for path in [*folder.glob("*"), *folder.glob("fonts/*")] if FILES.fullmatch(path.name)]
    there = sorted(path for path in there if path.is_file() and path.suffix not in SOURCES)
    return [path.read_text(errors="replace").strip() for path in there]


def main() -> None:
    package, *features = sys.argv[1:]
    users: dict[str, list[str]] = defaultdict(list)
    whole: dict[str, str] = {}
    without = []
    for crate in crates(package, features):
        name = f"{crate['name']} {crate['version']} ({crate['license'] or 'see its text'})"
        found = texts(crate)
        for text in found:
            same = " ".join(text.split())
            whole[same] = text
            users[same].append(name)
        if not found:
            without.append(f"{name}  {crate['repository'] or ''}")
    line = "=" * 80
    print("What limpid is built from, and under which licences.")
    for same in sorted(users, key=lambda same: (-len(users[same]), users[same])):
        print(f"\n{line}\n" + "\n".join(users[same]) + f"\n{'-' * 80}\n{whole[same]}")
    if without:
        print(f"\n{line}\nWithout a text of their own; their licences are among those above or limpid's own:\n")
        print("\n".join(without))


if __name__ == "__main__":
    main()
