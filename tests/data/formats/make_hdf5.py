"""Writes HDF5 files with links and types that need h5py (3.16, HDF5 2.0) into this folder: 8 particles each, with
twice their places as velocities."""
import pathlib

import h5py
import numpy as np

folder = pathlib.Path(__file__).parent
places = (np.stack(np.mgrid[0:2, 0:2, 0:2], -1).reshape(-1, 3) * 0.5 + 0.25).astype("f4")

# Soft links in groups of the first version: to an array through another link, to one, to nothing, and to groups.
with h5py.File(folder / "h5py_soft_links.h5", "w") as file:
    file["data/places"], file["data/speeds"] = places, 2 * places
    group = file.create_group("PartType0")
    group["Coordinates"] = h5py.SoftLink("/alias/places")
    group["Velocities"] = h5py.SoftLink("/data/speeds")
    group["Densities"] = h5py.SoftLink("/data/absent")
    file["alias"], file["GasParticles"] = h5py.SoftLink("/data"), h5py.SoftLink("PartType0")

# Links in groups of the second version, one of them to another file.
with h5py.File(folder / "h5py_links_latest.h5", "w", libver=("v110", "v110")) as file:
    file["places"] = places
    group = file.create_group("PartType0")
    group["Coordinates"] = h5py.SoftLink("/places")
    group["Velocities"] = h5py.ExternalLink("other.h5", "/speeds")

# The same in a group with many, which are in several blocks of a heap.
with h5py.File(folder / "h5py_many_links.h5", "w", libver=("v110", "v110")) as file:
    file["places"] = places
    group = file.create_group("PartType0")
    for name in [f"alias_{k:02}" for k in range(40)] + ["Coordinates"]:
        group[name] = h5py.SoftLink("/places")

with h5py.File(folder / "h5py_external.h5", "w") as file:
    file.create_group("PartType0")["Coordinates"] = h5py.ExternalLink("other.h5", "/places")

# Layouts of version 5, with a fixed array, a single chunk and an extensible array as the index.
with h5py.File(folder / "h5py_layout_5.h5", "w", libver="latest") as file:
    group = file.create_group("PartType0")
    group.create_dataset("Coordinates", data=places, chunks=(3, 3), compression="gzip")
    group.create_dataset("Velocities", data=2 * places, chunks=(8, 3), compression="gzip")
    density = np.full(8, 1000, "f4")
    group.create_dataset("Densities", data=density, chunks=(2,), maxshape=(None,), compression="gzip")
    group["ParticleIDs"] = np.arange(8)

# Floats whose exponent has another bias than IEEE 754's.
kind = h5py.h5t.IEEE_F32LE.copy()
kind.set_ebias(125)
with h5py.File(folder / "h5py_bias.h5", "w") as file:
    space, group = h5py.h5s.create_simple(places.shape), file.create_group("PartType0")
    dataset = h5py.h5d.create(group.id, b"Coordinates", kind, space)
    dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, places.astype("f8"))

# One chunk without filters, in a tree that tells its length.
with h5py.File(folder / "h5py_chunk.h5", "w") as file:
    numbers = np.random.default_rng(2078400506).random((10, 3)).astype(">f4")
    file.create_dataset("PartType0/Coordinates", data=numbers, chunks=True)
