"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Format

_TETRAHEDRA = ("cccd_tetrahedra.files.write", "fe", "tetrahedra")

WRITERS = {
    "feb": Format("tetrahedra (FEBio)", *_TETRAHEDRA),
    "inp": Format("tetrahedra (Abaqus, CalculiX)", *_TETRAHEDRA),
    "msh": Format("tetrahedra (Gmsh 2.2)", *_TETRAHEDRA),
    "vtu": Format("tetrahedra (VTK)", *_TETRAHEDRA),
}

OPTIONS = {"materials": "cccd_tetrahedra.commands.with_materials"}
