"""Writes the files of this folder with the programs that people have: VTK 9.7, ASE 3.29.

Each has the same 120 particles: particle i at (i % 4, i // 4 % 5, i // 20) / 10 m, with velocity (i, 0, -i) / 8 m/s,
radius 0.05 m and id 1000 + i. `pip install vtk ase`, then `python make.py`.
"""

import ase
import ase.io
import numpy
import vtk
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
