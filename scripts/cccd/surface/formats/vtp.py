"""VTK's polygonal data: at its vertices curvature (1/mm) and the number of the body.

Of a surface of tubes it is the tube's number, coordinates on it and the distance to it (mm).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from cccd.geometry.curvature import mean_curvature
from cccd.surface.coordinates import body_numbers, tube_coordinates
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
    else:
        coordinates = tube_coordinates(surface.vertices, surface)
        mesh.point_data["tube"] = coordinates.tube
        mesh.point_data["around"], mesh.point_data["along"] = coordinates.around, coordinates.along
        mesh.point_data["distance_to_tube"] = coordinates.distance
    mesh.field_data["SpaceUnit"] = ["mm"]
    mesh.field_data["Space"] = ["RAS"]
    # to a string first: on a full disk VTK leaves an empty file and says nothing
    writer = cast(Any, vtkXMLPolyDataWriter())
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    path.write_text(writer.GetOutputString(), encoding="ascii")
