"""Compares what limpid reads from HDF5 files with what h5py reads: `scripts/nightly.sh hdf5`.

    python hdf5.py FOLDER [PROGRAM [ROUNDS]]

FOLDER has the mutants of the test `changed_fields_are_refused_or_said` (LIMPID_HOSTILE_HDF5), each beside what limpid
made of it. With PROGRAM, the program limpid, as many files (1,000) are written by h5py itself, in all its layouts, and
four of five changed by a byte, from the seed LIMPID_SEED on.

A damaged file that limpid refuses is no fault. One that it reads must have the places of the valid file, or those that
h5py reads from it.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np


# Places beyond are no positions, m: `usable.rs`.
FARTHEST = 1e18


def places_by_h5py(path):
    """The places of the particles in any of the layouts below."""
    with h5py.File(path) as file:
        group = file["PartType0"] if "PartType0" in file else file
        for name in ("Coordinates", "positions"):
            if name in group:
                return np.asarray(group[name][...], dtype=np.float64)
        return np.stack([np.asarray(group[axis][...], dtype=np.float64) for axis in "xyz"], axis=-1)


def truth(path):
    """As above, in a process of its own, since damage may end it; None if h5py refuses the file."""

    def read(pipe):
        try:
            pipe.send(places_by_h5py(path))
        except Exception:
            pipe.send(None)

    ours, theirs = multiprocessing.get_context("fork").Pipe()
    process = multiprocessing.get_context("fork").Process(target=read, args=(theirs,))
    process.start()
    theirs.close()
    try:
        places = ours.recv() if ours.poll(60) else None
    except EOFError:
        places = None
    process.kill()
    process.join()
    return places


def alike(found, expected):
    """Whether these are the same places, to the digits of 32-bit numbers."""
    if found.shape != expected.shape:
        return False
    return np.allclose(found, expected, rtol=1e-6, atol=1e-6 * max(1.0, np.abs(expected).max(initial=0.0)))


def fault(path, found, valid):
    """The problem with the places that limpid has read, or None."""
    if alike(found, valid):
        return None
    expected = truth(path)
    if expected is None:
        return f"{len(found)} other particles, and h5py refuses the file"
    # limpid leaves out what is nowhere, and says so.
    expected = expected[(np.abs(expected) < FARTHEST).all(axis=-1)]
    return None if alike(found, expected) else f"{len(found)} particles, by h5py {expected.shape} others"


def mutants(folder):
    """The files of the test, and what limpid has read of each."""
    for path in sorted(folder.glob("*.h5")):
        lines = path.with_suffix(".txt").read_text().split("\n")
        if lines[0] == "read":
            found = np.array([line.split() for line in lines[1:] if line], dtype=np.float64).reshape(-1, 3)
            yield path, found, np.loadtxt(folder / f"{path.stem.split('-')[0]}.valid").reshape(-1, 3)


LAYOUTS = (
    {},
    {"chunks": True},
    {"chunks": True, "compression": "gzip", "shuffle": True},
    {"chunks": True, "compression": "lzf"},
    {"chunks": True, "fletcher32": True},
    {"chunks": True, "maxshape": True},
)


def write(path, places, draw):
    """Writes these places by h5py, in a layout and a type by chance."""
    options = dict(draw.choice(LAYOUTS))
    kind = draw.choice(["<f4", "<f8", ">f4", ">f8"])
    versions = draw.choice(["earliest", "v108", "v110", "latest"])
    with h5py.File(path, "w", libver=(versions, "latest")) as file:
        group = file.create_group("PartType0") if draw.random() < 0.5 else file
        if draw.random() < 0.7:
            members = {"Coordinates" if group is not file else "positions": places}
        else:
            members = dict(zip("xyz", places.T))
        for name, numbers in members.items():
            more = dict(options)
            if more.get("maxshape"):
                more["maxshape"] = (None, *numbers.shape[1:])
            group.create_dataset(name, data=numbers.astype(kind), **more)
        group.create_dataset("ParticleIDs", data=np.arange(len(places)))
        if draw.random() < 0.5:
            file.create_group("Header").attrs["Time"] = 0.5


def change(data, draw):
    """Changes a byte of a file, most often where its structure is."""
    marks = [b"\x89HDF", b"TREE", b"SNOD", b"HEAP", b"OHDR", b"OCHK", b"FRHP", b"BTHD", b"FADB", b"EAHD"]
    starts = [data.find(mark) for mark in marks if mark in data]
    near = draw.choice(starts) + draw.randrange(200) if draw.random() < 0.7 else draw.randrange(len(data))
    at = min(near, len(data) - 1)
    data[at] = draw.choice([0, 1, 255, data[at] ^ 1 << draw.randrange(8), (data[at] + 1) % 256, (data[at] - 1) % 256])


def written_by_h5py(program, folder, rounds):
    """Files by h5py, changed or not, and what limpid has read of each."""
    seed = int(os.environ.get("LIMPID_SEED", "0"))
    for number in range(seed, seed + rounds):
        draw = random.Random(number)
        places = np.random.default_rng(number).random((draw.randrange(2, 200), 3))
        path, out = folder / f"by-h5py-{number}.h5", folder / "out.npy"
        write(path, places, draw)
        if number % 5:
            data = bytearray(path.read_bytes())
            change(data, draw)
            path.write_bytes(data)
        out.unlink(missing_ok=True)
        done = subprocess.run([program, "convert", "--up", "y", path, out], capture_output=True, text=True, timeout=120, check=False)
        valid = number % 5 == 0
        if done.returncode not in (0, 3, 4) or "panicked" in done.stderr or (valid and done.returncode):
            raise SystemExit(f"{path.name}: exit code {done.returncode}: {done.stderr}")
        if done.returncode == 0:
            yield path, np.load(out), places.astype(np.float32)


def main():
    folder = Path(sys.argv[1])
    count, faults = 0, []
    sources = [mutants(folder)]
    made = tempfile.TemporaryDirectory()
    if len(sys.argv) > 2:
        rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 1000
        sources.append(written_by_h5py(Path(sys.argv[2]).resolve(), Path(made.name), rounds))
    for source in sources:
        for path, found, valid in source:
            count += 1
            problem = fault(path, found, valid)
            if problem:
                faults.append(f"{path.name}: {problem}")
    print(f"{count} files that limpid reads, {len(faults)} unlike h5py's")
    print("\n".join(faults[:50]))
    if count == 0 or faults:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
