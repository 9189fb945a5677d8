"""VTK's own modules, each loaded where it is needed: a tenth of a second, without PyVista."""

from __future__ import annotations

from importlib import import_module
from typing import Any, cast

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray


def vtk(name: str) -> Any:
    """Load a module of VTK by its name; its types are looser than what it returns."""
    return cast(Any, import_module(f"vtkmodules.{name}"))


def triangles_of(filter_: Any) -> tuple[FloatArray, IntArray]:
    """Run a filter that makes triangles and return their vertices (V, 3) and faces (F, 3)."""
    filter_.Update()
    mesh, support = filter_.GetOutput(), vtk("util.numpy_support")
    vertices = support.vtk_to_numpy(mesh.GetPoints().GetData())
    faces = support.vtk_to_numpy(mesh.GetPolys().GetConnectivityArray())
    return vertices.astype(float), faces.reshape(-1, 3).astype(np.int64)


def xml_of(data: Any) -> str:
    """Return VTK's binary XML: VTK itself leaves an empty file on a full disk, and reports nothing."""
    kind = "PolyData" if data.IsA("vtkPolyData") else "UnstructuredGrid"
    writer = getattr(vtk("vtkIOXML"), f"vtkXML{kind}Writer")()
    writer.SetInputData(data)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString())
