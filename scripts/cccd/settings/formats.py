"""The table of formats that a surface is written in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

__all__ = [
    "BAND_FORMATS",
    "CASE_FORMATS",
    "COLOUR",
    "FORMATS",
    "NOTE",
    "SOLID_FORMATS",
    "TETRAHEDRA_FORMATS",
    "Format",
]

#: Red, green and blue (sRGB, 0 to 1) of an organ that nothing gives a colour.
COLOUR = (0.80, 0.47, 0.40)

#: Written wherever a format has room for text; ``SPACE=RAS`` is what 3D Slicer looks for.
NOTE = "CCCD surface; unit mm; SPACE=RAS"


@dataclass(frozen=True)
class Format:
    """A format of files.

    Attributes
    ----------
    name : str
        The files' suffix without its dot, and the name in ``surface.formats``.
    holds : str
        What the file contains, for people.
    writer : str
        Path of a function, called with path, surface and `cccd.files.options.ExportOptions`. Named, not
        imported: the workflow reads this table each time it starts.
    extra : str
        The extra that writes it.
    made_of : {"mesh", "solids", "tetrahedra"}
        Writers of solids and of tetrahedra return a report.
    """

    name: str
    holds: str
    writer: str
    extra: str = ""
    made_of: Literal["mesh", "solids", "tetrahedra"] = "mesh"


_ALL = (
    Format(
        "3mf", "mesh for printing: millimetres, colour, thinnest wall", "cccd.files.threemf.write", "print"
    ),
    Format("brep", "closed solids, in OpenCASCADE's own format", "cccd_solids.files.write", "cad", "solids"),
    Format("dcm", "contours on the scan's slices (RTSTRUCT)", "cccd_dicom.rtstruct.write", "dicom"),
    Format("feb", "tetrahedra (FEBio)", "cccd_tetrahedra.files.write", "fe", "tetrahedra"),
    Format("gii", "mesh (GIfTI)", "cccd.files.meshes.write_gii"),
    Format("glb", "mesh in metres, y up (binary glTF)", "cccd.files.gltf.write"),
    Format("iges", "closed solids (IGES 5.3)", "cccd_solids.files.write", "cad", "solids"),
    Format("inp", "tetrahedra (Abaqus, CalculiX)", "cccd_tetrahedra.files.write", "fe", "tetrahedra"),
    Format("msh", "tetrahedra (Gmsh 2.2)", "cccd_tetrahedra.files.write", "fe", "tetrahedra"),
    Format("nii.gz", "label map on the scan's grid", "cccd.files.label_map.write"),
    Format("obj", "mesh", "cccd.files.meshes.write_obj"),
    Format("ply", "mesh; every later step reads it", "cccd.files.meshes.write_ply"),
    Format("seg.dcm", "voxels of the row's DICOM series (SEG)", "cccd_dicom.seg.write", "dicom"),
    Format("step", "closed solids (STEP AP242)", "cccd_solids.files.write", "cad", "solids"),
    Format("stl", "mesh", "cccd.files.meshes.write_stl"),
    Format("stl.dcm", "mesh within DICOM (encapsulated STL)", "cccd_dicom.encapsulated_stl.write", "dicom"),
    Format("usd", "the spline itself: control meshes and creases", "cccd_solids.usd.write", "usd"),
    Format("usda", "the same in text", "cccd_solids.usd.write", "usd"),
    Format("usdc", "the same in binary", "cccd_solids.usd.write", "usd"),
    Format("vtp", "mesh with curvature and the body's number at its vertices", "cccd.files.meshes.write_vtp"),
    Format("vtu", "tetrahedra (VTK)", "cccd_tetrahedra.files.write", "fe", "tetrahedra"),
)

#: Every format by its name.
FORMATS = {form.name: form for form in _ALL}
SOLID_FORMATS = tuple(form.name for form in _ALL if form.made_of == "solids")
TETRAHEDRA_FORMATS = tuple(form.name for form in _ALL if form.made_of == "tetrahedra")
#: Formats that hold all organs of a case.
CASE_FORMATS = SOLID_FORMATS + TETRAHEDRA_FORMATS
#: Names for the error band's inner and outer surface, surface_inner.stl and surface_outer.stl: meshes alone.
BAND_FORMATS = tuple(f"band.{name}" for name in ("3mf", "gii", "glb", "nii.gz", "obj", "ply", "stl", "vtp"))
