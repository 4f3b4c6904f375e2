"""Bridges to VTK and PyVista; neither is imported unless it is used."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from ._limpid import Camera
from ._particles import Particles

# Names of arrays in lower case, as particle files have them.
_VELOCITIES = ("velocity", "velocities", "vel", "v", "u")
_DENSITIES = ("density", "densities", "rho", "rhop")
_RADII = ("radius", "radii", "pscale")
_IDS = ("id", "ids", "idp", "particleids")


def from_vtk(data: Any) -> Particles:
    """The points of a ``vtkPointSet`` (``vtkPolyData``, ``vtkUnstructuredGrid``) or of a PyVista mesh
    as particles, with the point arrays that have the usual names: velocity, density, radius, id.

    Parameters
    ----------
    data : vtkPointSet or pyvista.DataSet
        Points, m. Cells are ignored.

    Returns
    -------
    Particles
        Arrays that share VTK's memory; `render` copies them.

    Raises
    ------
    TypeError
        If `data` has no points.
    """
    # Its types are there or not, as VTK is.
    vtk_to_numpy: Any = importlib.import_module("vtkmodules.util.numpy_support").vtk_to_numpy

    points = data.GetPoints() if hasattr(data, "GetPoints") else None
    if not hasattr(data, "GetPointData"):
        raise TypeError(f"{type(data).__name__} has no points; expected a vtkPointSet")
    if points is None:
        return Particles(np.empty((0, 3), np.float32))
    point_data = data.GetPointData()
    found: dict[str, Any] = {}
    wanted = {
        "velocities": (_VELOCITIES, 3),
        "densities": (_DENSITIES, 1),
        "radii": (_RADII, 1),
        "ids": (_IDS, 1),
    }
    for i in range(point_data.GetNumberOfArrays()):
        array = point_data.GetArray(i)
        name = (point_data.GetArrayName(i) or "").lower()
        for attribute, (names, columns) in wanted.items():
            if array is None or name not in names or attribute in found:
                continue
            if array.GetNumberOfComponents() == columns:
                found[attribute] = vtk_to_numpy(array)
    radii = found.get("radii")
    if radii is not None and not radii.any():
        # An array that was never filled in.
        del found["radii"]
    ids = found.get("ids")
    if ids is not None:
        found["ids"] = ids.astype(np.int64)
    return Particles(vtk_to_numpy(points.GetData()), **found)


def from_pyvista_camera(plotter: Any) -> Camera:
    """The camera of a ``pyvista.Plotter``, a ``vtkRenderer`` or a ``vtkCamera``: what it shows, in a
    picture of the same shape.

    Parameters
    ----------
    plotter : pyvista.Plotter, vtkRenderer or vtkCamera
        Whose world is that of the positions.

    Raises
    ------
    TypeError
        If it has no camera.
    """
    camera = plotter
    if not hasattr(camera, "GetViewAngle"):
        camera = getattr(plotter, "camera", None)
        if camera is None and hasattr(plotter, "GetActiveCamera"):
            camera = plotter.GetActiveCamera()
    if camera is None or not hasattr(camera, "GetViewAngle"):
        raise TypeError(f"{type(plotter).__name__} has no camera")
    eye, target, up = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
    if camera.GetParallelProjection():
        return Camera.orthographic(eye, target, 2.0 * camera.GetParallelScale(), up)
    return Camera(eye, target, camera.GetViewAngle(), up)
