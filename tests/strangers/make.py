"""Makes the data sets of ten strangers: liquid of ten kinds and sizes, each as another tool writes it.

    pip install numpy ase meshio vtk
    python make.py FOLDER

The particles of a set lie on a lattice of spacing 2 r, and each is moved by up to a tenth of that along every axis.
So the radius is known; no file has it. `truth.json` lists it with the file of each set. The files are the same on
every run. Sets whose tool is not installed are left out, and named.
"""

import gzip
import json
import struct
import sys
from pathlib import Path

import numpy as np

JITTER = 0.1


def lattice(low, high, spacing, inside, seed):
    """Jittered lattice points of a box where `inside(x, y, z)` holds."""
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[inside(*grid.T)]
    jitter = np.random.default_rng(seed).uniform(-JITTER, JITTER, grid.shape)
    return grid + jitter * spacing


def ball(centre, radius, spacing, seed):
    """A drop; one of less than a spacing is a single particle."""
    if radius < spacing:
        return np.array([centre])
    box = np.array([[-radius] * 3, [radius] * 3])
    return centre + lattice(*box, spacing, lambda x, y, z: x * x + y * y + z * z < radius**2, seed)


def apart(drops, spacing):
    """Joins drops, without particles that would lie in an earlier one."""
    taken, kept = set(), []
    for drop in drops:
        cells = [tuple(cell) for cell in np.floor(drop / spacing).astype(int)]
        free = np.array([cell not in taken for cell in cells])
        kept.append(drop[free])
        taken.update(tuple(np.add(c, (i, j, k))) for c in cells
                     for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1))
    return np.concatenate(kept)


# The sets: places (m), velocities (m/s) and the radius (m).


def spray():
    """A jet from a nozzle that breaks up into drops: 0.35 m."""
    random, h = np.random.default_rng(1), 0.0013
    core = lattice((-0.02, -0.01, -0.01), (0.09, 0.01, 0.01), h,
                   lambda x, y, z: np.hypot(y + 0.0012 * np.sin(240 * x), z) < 0.0058 + 0.0012 * np.sin(310 * x), 1)
    drops = [core]
    for i in range(520):
        s = random.uniform(0.085, 0.33)
        angle, tilt = random.uniform(0, 2 * np.pi), 0.25 * np.sqrt(random.uniform())
        off = s * tilt * np.array([0, np.cos(angle), np.sin(angle)])
        centre = np.array([s, -0.35 * s * s, 0]) + off
        drops.append(ball(centre, random.lognormal(np.log(0.0027), 0.45) * (1.15 - 1.5 * s), h, i))
    places = apart(drops, h)
    velocities = np.stack([np.full(len(places), 6.0), 20 * places[:, 1], 20 * places[:, 2]], axis=1)
    return places, velocities, h / 2


def sheet():
    """A water bell: a thin sheet that falls in a dome from a jet's impact, and breaks at its rim; 0.4 m."""
    h, random = 0.003, np.random.default_rng(2)

    def inside(x, y, z):
        s = np.hypot(x, z)
        dome = 0.16 - 0.2 * (s / 0.2) ** 2.4 * 0.75
        rim = 0.182 + 0.012 * np.sin(9 * np.arctan2(z, x))
        return (np.abs(y - dome) < 0.8 * h * np.sqrt(1 + (2.4 * (dome - 0.16) / np.maximum(s, h)) ** 2)) & (s < rim)

    drops = [lattice((-0.21, -0.1, -0.21), (0.21, 0.18, 0.21), h, inside, 2)]
    for i in range(60):
        angle, s = random.uniform(0, 2 * np.pi), random.uniform(0.195, 0.215)
        y = 0.16 - 0.15 * (s / 0.2) ** 2.4 - random.uniform(0.01, 0.04)
        drops.append(ball((s * np.cos(angle), y, s * np.sin(angle)), random.uniform(0.002, 0.008), h, i))
    places = apart(drops, h)
    out = places / np.maximum(np.hypot(places[:, 0], places[:, 2]), h)[:, None] * (1.5, 0, 1.5)
    return places, out - (0, 0.8, 0), h / 2


def drop():
    """A falling drop that oscillates: 70 mm."""
    h = 0.0022
    places = lattice((-0.05,) * 3, (0.05,) * 3, h,
                     lambda x, y, z: (x / 0.037) ** 2 + (z / 0.037) ** 2 + (y / 0.028) ** 2
                     + 0.1 * np.sin(90 * y) < 1, 3)
    return places + (0, 1.2, 0), np.tile((0.0, -4.8, 0.0), (len(places), 1)), h / 2


def tank():
    """Sloshing in a tank of 2 m by 0.8 m: y up."""
    h = 0.028

    def surface(x, z):
        return 0.42 + 0.2 * np.cos(np.pi * x / 2) + 0.05 * np.sin(7 * x + 2 * z) + 0.02 * np.cos(11 * z)

    places = lattice((0, 0, 0), (2, 1, 0.8), h, lambda x, y, z: y < surface(x, z), 4)
    slosh = np.sin(np.pi * places[:, 0] / 2)
    return places, np.stack([0.6 * slosh, 0.2 * slosh, 0 * slosh], axis=1), h / 2


def river():
    """A river of 60 m that winds down a slope, over stones."""
    h = 0.21
    stones = [(12, 0.5, 1.1), (21, -1.0, 1.4), (33, 0.8, 1.2), (44, -0.4, 1.5), (52, 0.9, 1.0)]

    def middle(x):
        return 4 * np.sin(x / 9) + 1.5 * np.sin(x / 4 + 1)

    def inside(x, y, z):
        across = (z - middle(x)) / 2.9
        bed = -0.05 * x - 1.0 * (1 - across**2)
        surface = -0.05 * x + 0.07 * np.sin(2.2 * x + z) * np.cos(1.4 * z) - 0.03
        for at, side, size in stones:
            near = np.hypot(x - at, z - middle(at) - side)
            bed = np.maximum(bed, -0.05 * x - 0.35 + np.sqrt(np.maximum(size**2 - near**2, 0)) - 0.45 * size)
            surface = surface + 0.18 * np.exp(-((x - at + size) ** 2 + (z - middle(at) - side) ** 2) / size)
        return (np.abs(across) < 1) & (y > bed) & (y < surface)

    places = lattice((0, -5, -9), (60, 1, 9), h, inside, 5)
    slope = 4 / 9 * np.cos(places[:, 0] / 9) + 0.375 * np.cos(places[:, 0] / 4 + 1)
    along = np.stack([np.ones_like(slope), np.full_like(slope, -0.05), slope], axis=1)
    return places, 2.2 * along / np.linalg.norm(along, axis=1)[:, None], h / 2


def millimetres():
    """A drop of 3 mm that has hit a plate and spreads in fingers."""
    h = 0.00007

    def inside(x, y, z):
        s, angle = np.hypot(x, z), np.arctan2(z, x)
        reach = 0.0026 + 0.00025 * np.cos(13 * angle) + 0.0001 * np.sin(5 * angle)
        film = 0.0002 + 0.0011 * np.exp(-((s / 0.0011) ** 2))
        rim = np.hypot(s - reach + 0.00025, y - 0.00026) < 0.00028
        return (s < reach) & (y < film) | rim & (y > 0)

    places = lattice((-0.0031, 0, -0.0031), (0.0031, 0.002, 0.0031), h, inside, 6)
    return places, 600 * places * (1, -0.3, 1), h / 2


def kilometres():
    """A lake of 3 km with bays and an island."""
    h = 15.0

    def inside(x, y, z):
        shore = 1 + 0.16 * np.sin(3 * np.arctan2(z, x) + 1) + 0.1 * np.sin(7 * np.arctan2(z, x))
        s = np.hypot(x / 1500, z / 850) / shore
        bed = -75 * (1 - s**2) + 100 * np.exp(-(((x - 420) / 170) ** 2 + ((z + 130) / 130) ** 2))
        return (y > bed) & (y < 0)

    places = lattice((-1950, -90, -1150), (1950, 15, 1150), h, inside, 7)
    return places + (0, 412, 0), np.zeros_like(places), h / 2


def dam(h, seed):
    """A dam that has broken: the front has reached the far wall and runs up; 1.6 m by 0.65 m by 0.6 m, y up."""

    def inside(x, y, z):
        body = 0.30 - 0.12 * x + 0.015 * np.sin(14 * x + 3 * z) + 0.01 * np.sin(17 * z)
        jet = 0.5 + 0.06 * np.sin(13 * z) + 0.03 * np.sin(31 * z)
        wall = (x > 1.6 - 0.14 * np.maximum(1 - y / jet, 0.28)) & (y < jet)
        return (y < body) | wall

    places = lattice((0, 0, 0), (1.6, 0.8, 0.65), h, inside, seed)
    speed = np.clip(1.5 - places[:, 0], -0.1, 1.4)
    return places, np.stack([speed, np.where(places[:, 0] > 1.5, 1.2, 0), 0 * speed], axis=1)


def z_up():
    """The broken dam, z up."""
    h = 0.021
    turned = [np.stack([x[:, 0], -x[:, 2], x[:, 1]], axis=1) for x in dam(h, 8)]
    return turned[0] + (0, 0.65, 0), turned[1], h / 2


def escaped():
    """The broken dam in a tank with a leak: one particle has fallen for 20 s."""
    h = 0.026
    places, velocities = dam(h, 9)
    places[777], velocities[777] = (1.61, -1962.0, 0.3), (0.4, -196.2, 0.0)
    return places, velocities, h / 2


def far():
    """A flood wave of 60 m in coordinates of a national grid, 1e6 m from the origin."""
    h = 0.7

    def inside(x, y, z):
        front = 46 + 5 * np.sin(z / 5) + 2 * np.sin(z / 1.7)
        height = 3.2 - 0.02 * x + 2.4 * np.exp(-(((x - front + 6) / 5) ** 2)) + 0.3 * np.sin(x / 2 + z / 3)
        return (y < height * np.sqrt(np.clip((front - x) / 8, 0, 1))) & (x < front)

    places = lattice((0, 0, 0), (60, 8, 34), h, inside, 10)
    velocities = np.stack([np.full(len(places), 7.0), 0 * places[:, 0], 0 * places[:, 0]], axis=1)
    return places + (1_043_210.0, 118.0, -702_345.0), velocities, h / 2


# The writers: each as the tool named writes it.


def extended_xyz(path, x, v):
    """ASE."""
    import ase
    import ase.io

    atoms = ase.Atoms("O" * len(x), positions=x)
    atoms.set_array("velo", v)
    ase.io.write(path, atoms, format="extxyz")


def ply(path, x, v):
    """meshio, binary."""
    import meshio

    mesh = meshio.Mesh(x, [], point_data={k: v[:, i].copy() for i, k in enumerate(("vx", "vy", "vz"))})
    meshio.write(path, mesh, binary=True)


def bgeo(path, x, v):
    """Partio, and with it SPlisHSPlasH: Houdini's classic geometry, gzip."""
    head = b"Bgeo" + b"V" + struct.pack(">9i", 5, len(x), 1, 0, 0, 1, 0, 1, 0)
    definition = struct.pack(">H", 8) + b"velocity" + struct.pack(">Hi3f", 3, 5, 0, 0, 0)
    points = np.concatenate([x, np.ones((len(x), 1)), v], axis=1).astype(">f4").tobytes()
    generator = struct.pack(">H", 9) + b"generator" + struct.pack(">Hii", 1, 4, 1)
    generator += struct.pack(">H", 6) + b"papi  "
    run = struct.pack(">Ii", 0x8000, len(x)) + np.arange(len(x)).astype(">u2" if len(x) < 65536 else ">u4").tobytes()
    rest = generator + run + struct.pack(">i", 0) + b"\x00\xff"
    with open(path, "wb") as file, gzip.GzipFile(fileobj=file, mode="wb", mtime=0, filename="") as packed:
        packed.write(head + definition + points + rest)


def vtu(path, x, v):
    """VTK, appended and compressed, as ParaView writes it."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(x.astype(np.float32), deep=True))
    grid = vtk.vtkUnstructuredGrid()
    grid.SetPoints(points)
    for k in range(len(x)):
        grid.InsertNextCell(vtk.VTK_VERTEX, 1, [k])
    velocity = numpy_to_vtk(v.astype(np.float32), deep=True)
    velocity.SetName("velocity")
    grid.GetPointData().AddArray(velocity)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    assert writer.Write() == 1


def double_vtu(path, x, v):
    """meshio, 64-bit."""
    import meshio

    meshio.write(path, meshio.Mesh(x, [("vertex", np.arange(len(x))[:, None])], point_data={"velocity": v}))


def csv(path, x, v):
    """ParaView's table of a point cloud."""
    names = [f"{name}:{i}" for name in ("velocity", "Points") for i in range(3)]
    header = ",".join(f'"{name}"' for name in names)
    np.savetxt(path, np.concatenate([v, x], axis=1), fmt="%.7g", delimiter=",", header=header, comments="")


def npz(path, x, v):
    """numpy."""
    np.savez(path, positions=x, velocities=v)


def legacy_vtk(path, x, v, names=("velocity",)):
    """Legacy VTK, binary: polygonal data with a vertex for each particle."""
    count = len(x)
    cells = np.stack([np.ones(count), np.arange(count)], axis=1).astype(">i4")
    with open(path, "wb") as file:
        file.write(b"# vtk DataFile Version 3.0\nparticles\nBINARY\nDATASET POLYDATA\n")
        file.write(f"POINTS {count} double\n".encode() + x.astype(">f8").tobytes())
        file.write(f"\nVERTICES {count} {2 * count}\n".encode() + cells.tobytes())
        file.write(f"\nPOINT_DATA {count}\nVECTORS velocity float\n".encode() + v.astype(">f4").tobytes() + b"\n")


def dualsphysics(path, x, v):
    """PartVTK of DualSPHysics, which has z up."""
    count = len(x)
    cells = np.stack([np.ones(count), np.arange(count)], axis=1).astype(">i4")
    with open(path, "wb") as file:
        file.write(b"# vtk DataFile Version 3.0\nDualSPHysics\nBINARY\nDATASET POLYDATA\n")
        file.write(f"POINTS {count} float\n".encode() + x.astype(">f4").tobytes())
        file.write(f"\nVERTICES {count} {2 * count}\n".encode() + cells.tobytes())
        file.write(f"\nPOINT_DATA {count}\nSCALARS Idp unsigned_int\nLOOKUP_TABLE default\n".encode())
        file.write(np.arange(count).astype(">u4").tobytes())
        file.write(b"\nFIELD FieldData 2\n")
        file.write(f"Vel 3 {count} float\n".encode() + v.astype(">f4").tobytes())
        rhop = 1000 + 0.07 * np.max(x[:, 2]) - 0.07 * x[:, 2]
        file.write(f"\nRhop 1 {count} float\n".encode() + rhop.astype(">f4").tobytes() + b"\n")


def lammps(path, x, v):
    """LAMMPS, `dump custom`."""
    bounds = "\n".join(f"{a:.16e} {b:.16e}" for a, b in zip(x.min(axis=0), x.max(axis=0)))
    rows = "\n".join(f"{i + 1} 1 " + " ".join(f"{value:g}" for value in (*p, *q)) for i, (p, q) in enumerate(zip(x, v)))
    head = f"ITEM: TIMESTEP\n40000\nITEM: NUMBER OF ATOMS\n{len(x)}\nITEM: BOX BOUNDS ss ss ss\n{bounds}\n"
    path.write_text(f"{head}ITEM: ATOMS id type x y z vx vy vz\n{rows}\n")


SETS = {
    "spray.xyz": (spray, extended_xyz),
    "sheet.ply": (sheet, ply),
    "drop.bgeo": (drop, bgeo),
    "tank.vtu": (tank, vtu),
    "river.csv": (river, csv),
    "millimetres.npz": (millimetres, npz),
    "kilometres.vtk": (kilometres, legacy_vtk),
    "z_up.vtk": (z_up, dualsphysics),
    "escaped.lammpstrj": (escaped, lammps),
    "far.vtu": (far, double_vtu),
}


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    truth = {}
    for name, (make, write) in SETS.items():
        x, v, radius = make()
        try:
            write(folder / name, x, v)
        except ImportError as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
            continue
        says = make.__doc__.strip().rstrip(".")
        by = write.__doc__.partition(",")[0].rstrip(".")
        truth[name] = {"radius": radius, "particles": len(x), "by": by, "says": says, "lost": make is escaped}
        print(f"{name}: {len(x)} particles, radius {radius:g} m")
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: make.py FOLDER")
    main(Path(sys.argv[1]))
