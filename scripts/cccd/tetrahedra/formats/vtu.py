"""VTK's unstructured grid."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.surface.formats import Scan
from cccd.surface.surface import Surface
from cccd.tetrahedra.build import fill_surface
from cccd.tetrahedra.filling import TetrahedralMesh

__all__ = ["write", "write_tetrahedra"]


def write_tetrahedra(path: Path, filled: TetrahedralMesh) -> None:
    """Write VTK's unstructured grid: cell data ``region`` (organ, from 1) and ``group`` (of faces, from 1).

    Each is 0 on the cells of the other kind; field data name them.
    """
    import pyvista  # VTK takes a second to load
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    cells = {pyvista.CellType.TETRA: filled.tetrahedra, pyvista.CellType.TRIANGLE: filled.triangles}
    grid = cast(Any, pyvista.UnstructuredGrid(cells, filled.vertices))
    faces = np.zeros(len(filled.triangles), np.int32)
    solids = np.zeros(len(filled.tetrahedra), np.int32)
    grid.cell_data["region"] = np.concatenate([filled.regions.astype(np.int32) + 1, faces])
    grid.cell_data["group"] = np.concatenate([solids, filled.groups.astype(np.int32) + 1])
    grid.field_data["region_names"] = list(filled.names)
    grid.field_data["group_names"] = list(filled.group_names)
    grid.field_data["SpaceUnit"] = ["mm"]
    grid.field_data["Space"] = ["RAS"]
    # to a string first: on a full disk VTK leaves an empty file and says nothing
    writer = cast(Any, vtkXMLUnstructuredGridWriter())
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    path.write_text(writer.GetOutputString(), encoding="ascii")


def write(path: Path, surface: Surface, scan: Scan) -> dict[str, Any]:
    """Fill the surface, and write the tetrahedra."""
    filled, report = fill_surface(surface, scan)
    write_tetrahedra(path, filled)
    return {"format": "vtu", **report}
