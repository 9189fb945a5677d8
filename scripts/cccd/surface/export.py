"""Surfaces to files: meshes for viewers, spline faces for CAD. Everything is in mm RAS, and says so.

PLY, STL and VTP carry a line with unit and frame. 3D Slicer takes meshes for LPS unless a comment
``SPACE=RAS`` says otherwise, so that comment is there in the form Slicer reads. GLB by its standard is
in metres with y up: its root node carries the transform from mm RAS.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from cccd.errors import InputError
from cccd.geometry.bsplines import Patch
from cccd.geometry.ply import read_ply, write_ply
from cccd.store import atomic_path, read_patches, read_report, read_surface_frame
from cccd.surface.surface import Surface

__all__ = ["FORMATS", "read_surface", "write_surface"]

#: Written wherever a format has room for text; ``SPACE=RAS`` is what 3D Slicer looks for.
NOTE = "CCCD surface; unit mm; SPACE=RAS"
#: mm RAS to glTF's metres, y up, z towards the viewer: x right, y superior, z anterior-to-viewer.
TO_GLTF = np.array([[1e-3, 0, 0, 0], [0, 0, 1e-3, 0], [0, -1e-3, 0, 0], [0, 0, 0, 1.0]])


def write_surface(path: str | Path, surface: Surface) -> None:
    """Write a surface; the suffix chooses the format.

    ``.ply`` (binary), ``.stl`` (binary), ``.vtp``, ``.glb`` hold the triangle mesh, ``.step`` the
    B-spline patches.

    Raises
    ------
    InputError
        For another suffix, or STEP without OpenCASCADE.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise InputError(
            str(path), f"unknown surface format {suffix!r}", f"choose one of {', '.join(FORMATS)}"
        )
    with atomic_path(path) as temporary:
        FORMATS[suffix](temporary, surface)


def read_surface(patches_path: str | Path, mesh_path: str | Path) -> Surface:
    """Read back what the lofting wrote: ``surface.h5`` and the PLY mesh."""
    mesh = read_ply(mesh_path)
    return Surface(
        read_patches(patches_path),
        mesh,
        read_surface_frame(patches_path),
        read_report(patches_path),
    )


def _write_ply(path: Path, surface: Surface) -> None:
    write_ply(path, surface.mesh, NOTE)


def _write_stl(path: Path, surface: Surface) -> None:
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    table = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table["normal"] = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)
    table["corners"] = corners
    # A binary STL must not begin with "solid": readers would take it for text.
    path.write_bytes(NOTE.encode().ljust(80) + struct.pack("<I", len(corners)) + table.tobytes())


def _write_vtp(path: Path, surface: Surface) -> None:
    import pyvista  # VTK takes a second to load
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    mesh = pyvista.PolyData.from_regular_faces(surface.vertices, surface.faces)
    mesh.field_data["SpaceUnit"] = ["mm"]
    mesh.field_data["Space"] = ["RAS"]
    # to a string first: on a full disk VTK leaves an empty file and says nothing
    writer = vtkXMLPolyDataWriter()
    writer.SetInputData(mesh)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    path.write_text(writer.GetOutputString(), encoding="ascii")


def _write_glb(path: Path, surface: Surface) -> None:
    import trimesh

    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(
            baseColorFactor=[0.80, 0.47, 0.40, 1.0], metallicFactor=0.0, roughnessFactor=0.6
        )
    )
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="surface", geom_name="surface", transform=TO_GLTF)
    scene.metadata["note"] = f"{NOTE}; the node's matrix turns mm RAS into metres, y up"
    path.write_bytes(scene.export(file_type="glb"))


def _write_step(path: Path, surface: Surface) -> None:
    """Write every patch as a (rational) B-spline face, periodic where it is closed; unit mm."""
    try:
        from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
        from OCP.IFSelect import IFSelect_RetDone
        from OCP.Interface import Interface_Static
        from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
    except ImportError:
        raise InputError(
            str(path), "STEP needs OpenCASCADE", "pip install 'cadquery-ocp-novtk>=8.0'"
        ) from None
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    Interface_Static.SetCVal_s("write.step.product.name", NOTE)
    for patch in surface.patches:
        face = BRepBuilderAPI_MakeFace(_occ_surface(patch), 1e-6).Face()
        writer.Transfer(face, STEPControl_AsIs)
    if writer.Write(str(path)) != IFSelect_RetDone:
        raise InputError(
            str(path), "OpenCASCADE could not write the file", "check the folder's space and rights"
        )


def _occ_surface(patch: Patch):
    """Turn a patch into a ``Geom_BSplineSurface``; a closed direction becomes a periodic one."""
    from OCP.collections import Array1_double, Array1_int, Array2_double, Array2_gp_Pnt
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt

    nu, nv = patch.weights.shape
    poles, weights = Array2_gp_Pnt(1, nu, 1, nv), Array2_double(1, nu, 1, nv)
    for a in range(nu):
        for b in range(nv):
            poles.SetValue(a + 1, b + 1, gp_Pnt(*(float(x) for x in patch.control_points[a, b])))
            weights.SetValue(a + 1, b + 1, float(patch.weights[a, b]))

    def knots(vector: np.ndarray, degree: int, closed: bool):
        inner = vector[degree : len(vector) - degree]
        values, counts = np.unique(inner, return_counts=True)
        if not closed:
            counts[[0, -1]] += degree
        levels, times = Array1_double(1, len(values)), Array1_int(1, len(values))
        for n, (value, count) in enumerate(zip(values, counts, strict=True)):
            levels.SetValue(n + 1, float(value))
            times.SetValue(n + 1, int(count))
        return levels, times

    ku, mu = knots(patch.knots_u, patch.degree_u, patch.closed_u)
    kv, mv = knots(patch.knots_v, patch.degree_v, patch.closed_v)
    return Geom_BSplineSurface(
        poles, weights, ku, kv, mu, mv, patch.degree_u, patch.degree_v, patch.closed_u, patch.closed_v
    )


#: Writers by suffix.
FORMATS = {
    ".ply": _write_ply,
    ".stl": _write_stl,
    ".vtp": _write_vtp,
    ".glb": _write_glb,
    ".step": _write_step,
}
