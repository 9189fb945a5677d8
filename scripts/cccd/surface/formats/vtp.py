"""VTK's polygonal data: at its vertices curvature (1/mm) and, where no wall is shared, the body's number."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from cccd.geometry.curvature import mean_curvature
from cccd.surface.coordinates import body_numbers
from cccd.surface.formats import Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS; unit and frame are field data."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter  # VTK takes a second to load

    mesh = surface.mesh.to_polydata()
    mesh.point_data["curvature"] = mean_curvature(surface.mesh, surface.vertices)
    if surface.bodies:
        mesh.point_data["body"] = body_numbers(surface.vertices, surface.bodies)
    mesh.field_data["SpaceUnit"] = ["mm"]
    mesh.field_data["Space"] = ["RAS"]
    # to a string first: on a full disk VTK leaves an empty file and says nothing
    writer = cast(Any, vtkXMLPolyDataWriter())
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    path.write_text(writer.GetOutputString(), encoding="ascii")
