"""VTK's polygonal data, with unit and frame as field data."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter  # VTK takes a second to load

    mesh = surface.mesh.to_polydata()
    mesh.field_data["SpaceUnit"] = ["mm"]
    mesh.field_data["Space"] = ["RAS"]
    # to a string first: on a full disk VTK leaves an empty file and says nothing
    writer = cast(Any, vtkXMLPolyDataWriter())
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    path.write_text(writer.GetOutputString(), encoding="ascii")
