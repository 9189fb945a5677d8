"""Triangle meshes in the formats of viewers and printers, and the label map of what they hold."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, cast

import numpy as np
from nibabel.gifti.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage, GiftiMetaData
from scipy.spatial import cKDTree

from cccd.files.write import ExportOptions
from cccd.geometry._vtk import xml_of
from cccd.geometry.arrays import IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.ply import write_ply as write_mesh
from cccd.geometry.raster import voxelise
from cccd.inputs.annotation import fill_mask
from cccd.settings.formats import NOTE
from cccd.surface.surface import LoftedSurface

#: NIfTI's code of the scanner's space.
_SCANNER = 1


def write_ply(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write binary PLY in mm RAS, with float64 vertices: nothing of the mesh's soundness is rounded away."""
    write_mesh(path, surface.mesh, NOTE)


def write_stl(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write binary STL in mm RAS."""
    path.write_bytes(binary_stl(surface.mesh, NOTE))


def write_obj(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write Wavefront OBJ in mm RAS."""
    mesh = cast(Any, surface.mesh.to_trimesh())
    path.write_text(mesh.export(file_type="obj", header=NOTE, include_normals=False), encoding="utf-8")


def write_vtp(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write VTK's polygonal data in mm RAS; unit and frame are field data.

    At its vertices are curvature (1/mm), the error band (mm) and, where no wall is shared, the body's number.
    """
    mesh = surface.mesh.to_polydata()
    mesh.point_data["curvature"] = surface.mesh.mean_curvature(surface.vertices)
    if surface.bodies:
        mesh.point_data["body"] = _body_numbers(surface)
    if surface.band is not None:
        mesh.point_data["inner_mm"] = surface.band.inner
        mesh.point_data["outer_mm"] = surface.band.outer
        mesh.field_data["band"] = [surface.band.share]
    mesh.field_data["SpaceUnit"] = ["mm"]
    mesh.field_data["Space"] = ["RAS"]
    path.write_text(xml_of(mesh), encoding="ascii")


def _body_numbers(surface: LoftedSurface) -> IntArray:
    """Which body (V,) is the nearest, by its samples, to each vertex."""
    samples = [body.tessellate().vertices for body in surface.bodies]
    owner = np.repeat(np.arange(len(samples)), [len(part) for part in samples])
    _, nearest = cKDTree(np.concatenate(samples)).query(surface.vertices)
    return owner[nearest]


def write_gii(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write GIfTI in mm RAS (scanner's space), as FreeSurfer and fMRIPrep keep surfaces.

    Vertices are float32, as the format has them. Such files are usually called ``.surf.gii``.
    """
    points = GiftiDataArray(
        np.asarray(surface.vertices, np.float32),
        intent="NIFTI_INTENT_POINTSET",
        datatype="NIFTI_TYPE_FLOAT32",
        coordsys=GiftiCoordSystem(_SCANNER, _SCANNER, np.eye(4)),
        # programs for cortices want to know which one it is
        meta=GiftiMetaData({"AnatomicalStructurePrimary": "Other", "GeometricType": "Anatomical"}),
    )
    triangles = GiftiDataArray(
        np.asarray(surface.faces, np.int32), intent="NIFTI_INTENT_TRIANGLE", datatype="NIFTI_TYPE_INT32"
    )
    about = GiftiMetaData({"Name": options.organ, "Description": NOTE})
    image = cast(Any, GiftiImage(meta=about, darrays=[points, triangles]))
    path.write_bytes(image.to_xml())


def binary_stl(mesh: Mesh, note: str) -> bytes:
    """Write a mesh as binary STL, in its own unit and frame, of which a note of at most 80 letters tells.

    A binary STL must not begin with "solid": readers would take it for text.
    """
    corners = mesh.vertices[mesh.faces]
    table = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table["normal"] = mesh.unit_normals
    table["corners"] = corners
    head = note.encode("ascii", "replace").removeprefix(b"solid")[:80].ljust(80)
    return head + struct.pack("<I", len(corners)) + table.tobytes()


def write_label_map(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the voxels inside as 1; slices that were drawn, where only some were, as they were drawn."""
    from cccd.inputs.nifti_export import write_nifti

    frame = surface.frame.of_file
    if options.drawn is None:
        mask = voxelise(surface.mesh, frame.affine, frame.shape)
    else:
        mask = fill_mask(options.drawn, surface.mesh, whole=True)
    write_nifti(path, mask.astype(np.uint8), frame.affine)
