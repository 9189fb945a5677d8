"""VTK's own modules: loaded where they are needed, a quarter of a second, without PyVista."""

from __future__ import annotations

from importlib import import_module
from typing import Any, cast

__all__ = ["vtk", "xml_of"]


def vtk(name: str) -> Any:
    """Load a module of VTK by its name; its types are looser than what it returns."""
    return cast(Any, import_module(f"vtkmodules.{name}"))


def xml_of(data: Any) -> str:
    """Return VTK's binary XML: VTK itself leaves an empty file on a full disk, and reports nothing."""
    kind = "PolyData" if data.IsA("vtkPolyData") else "UnstructuredGrid"
    writer = getattr(vtk("vtkIOXML"), f"vtkXML{kind}Writer")()
    writer.SetInputData(data)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString())
