"""Writes the files of this folder with the programs that people have: VTK 9.7, ASE 3.29, PySPH 1.0b2, h5py 3.16.

Each has the same 120 particles: particle i at (i % 4, i // 4 % 5, i // 20) / 10 m, with velocity (i, 0, -i) / 8 m/s,
radius 0.05 m and id 1000 + i. `pip install vtk ase h5py pysph`, then `python make.py`.
"""

import ase
import ase.io
import h5py
import numpy
import vtk
from pysph.base.utils import get_particle_array
from pysph.solver.output import dump
from vtk.util.numpy_support import numpy_to_vtk

COUNT = 120
i = numpy.arange(COUNT)
positions = numpy.stack([i % 4, i // 4 % 5, i // 20], axis=1) / 10.0
velocities = numpy.stack([i, 0 * i, -i], axis=1) / 8.0


def grid(part, kind=vtk.vtkUnstructuredGrid):
    points = vtk.vtkPoints()
    points.SetDataTypeToFloat()
    points.SetData(numpy_to_vtk(positions[part].astype(numpy.float32), deep=True))
    data = kind()
    data.SetPoints(points)
    if kind is vtk.vtkUnstructuredGrid:
        for k in range(points.GetNumberOfPoints()):
            data.InsertNextCell(vtk.VTK_VERTEX, 1, [k])
    else:
        cells = vtk.vtkCellArray()
        for k in range(points.GetNumberOfPoints()):
            cells.InsertNextCell(1, [k])
        data.SetVerts(cells)
    for name, values in [
        ("velocity", velocities[part].astype(numpy.float32)),
        ("radius", numpy.full(len(positions[part]), 0.05, numpy.float32)),
        ("id", 1000 + i[part]),
    ]:
        array = numpy_to_vtk(values, deep=True)
        array.SetName(name)
        data.GetPointData().AddArray(array)
    return data


def write(writer, name, data):
    writer.SetFileName(name)
    writer.SetInputData(data)
    assert writer.Write() == 1, name


everything = slice(0, COUNT)
for name, compressor in [("zlib", "ZLib"), ("lz4", "LZ4"), ("lzma", "LZMA")]:
    for mode, word in [("appended", "Appended"), ("binary", "Binary")]:
        writer = vtk.vtkXMLUnstructuredGridWriter()
        getattr(writer, f"SetDataModeTo{word}")()
        getattr(writer, f"SetCompressorTypeTo{compressor}")()
        writer.SetBlockSize(1024)
        if (name, mode) != ("lzma", "binary"):
            write(writer, f"vtk_{name}_{mode}.vtu", grid(everything))

# Two pieces, as two ranks would write them.
halves = [slice(0, 70), slice(70, COUNT)]
for kind, extension, writer_of in [
    (vtk.vtkUnstructuredGrid, "vtu", vtk.vtkXMLPUnstructuredGridWriter),
    (vtk.vtkPolyData, "vtp", vtk.vtkXMLPPolyDataWriter),
]:
    writer = writer_of()
    writer.SetNumberOfPieces(1)
    write(writer, f"vtk_pieces.p{extension}", grid(everything, kind))
blocks = vtk.vtkMultiBlockDataSet()
for k, part in enumerate(halves):
    blocks.SetBlock(k, grid(part))
write(vtk.vtkXMLMultiBlockDataWriter(), "vtk_blocks.vtm", blocks)

atoms = ase.Atoms("O" * COUNT, positions=positions)
atoms.set_array("velo", velocities)
atoms.set_array("radius", numpy.full(COUNT, 0.05))
atoms.set_array("id", 1000 + i)
ase.io.write("ase.extxyz", atoms, format="extxyz")
ase.io.write("ase_plain.xyz", atoms, format="xyz")

# A trajectory: three frames, in each of which the particles are 1 m further along x.
frames = [ase.Atoms("O" * 8, positions=positions[:8] + [k, 0, 0]) for k in range(3)]
ase.io.write("ase_frames.extxyz", frames, format="extxyz")

# The layout of SWIFT's snapshots: compressed, with checksums, and with units beside the numbers.
with h5py.File("swift.hdf5", "w") as file:
    header = file.create_group("Header").attrs
    header["BoxSize"] = [1.0, 1.0, 1.0]
    header["NumPart_ThisFile"] = [COUNT, 0, 0, 0, 0, 0, 0]
    file.create_group("Units").attrs["Unit length in cgs (U_L)"] = [100.0]
    gas = file.create_group("PartType0")
    for name, values in [
        ("Coordinates", positions),
        ("Velocities", velocities.astype("f4")),
        ("Densities", numpy.full(COUNT, 998.5, "f4")),
        ("SmoothingLengths", numpy.full(COUNT, 0.12, "f4")),
        ("ParticleIDs", (1000 + i).astype("u8")),
    ]:
        data = gas.create_dataset(
            name, data=values, chunks=(64,) + values.shape[1:], compression=4, shuffle=True, fletcher32=True
        )
        data.attrs["U_L exponent"] = [1.0]
    file.create_group("PartType4").create_dataset("Coordinates", data=positions[:3] + 9.0)

# PySPH's own output: a liquid, and a wall that is none of it.
fluid = get_particle_array(
    name="fluid", rho=998.5, m=1.0, h=0.12, **dict(zip("xyz", positions.T)), **dict(zip("uvw", velocities.T))
)
wall = get_particle_array(name="boundary", x=[0.0, 0.1], y=[-0.1, -0.1], z=[0.0, 0.0])
dump("pysph.hdf5", [fluid, wall], {"t": 0.5, "dt": 0.01, "count": 50})

for kind, name in [(vtk.vtkUnstructuredGrid, "grid"), (vtk.vtkPolyData, "points")]:
    writer = vtk.vtkHDFWriter()
    writer.SetChunkSize(COUNT)
    writer.SetCompressionLevel(4)
    write(writer, f"vtk_{name}.vtkhdf", grid(everything, kind))

# Arrays as anyone may write them, in the newest version of the format and big-endian.
with h5py.File("plain.h5", "w", libver="latest") as file:
    for name, values in [
        ("pos", positions.astype(">f8")),
        ("vel", velocities.astype(">f4")),
        ("radius", numpy.full(COUNT, 0.05, ">f4")),
        ("id", (1000 + i).astype(">i4")),
    ]:
        file.create_dataset(name, data=values)
