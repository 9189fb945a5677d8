"""The core's own rows in the tables of `cccd.plugins`."""

from cccd.plugins import Command, Format, Reader

_NIFTI = Reader("cccd.inputs.readers.read_nifti", holds="volume")
_ITK = Reader("cccd.inputs.readers.read_itk", holds="volume")

READERS = {
    **dict.fromkeys((".nii.gz", ".nii", ".hdr", ".img", ".mgz", ".mgh"), _NIFTI),
    **dict.fromkeys((".seg.nrrd", ".nrrd", ".nhdr", ".mha", ".mhd"), _ITK),
}

WRITERS = {
    "3mf": Format("mesh for printing: millimetres, colour, thinnest wall", "cccd.files.write_3mf", "print"),
    "gii": Format("mesh (GIfTI)", "cccd.files.write_gii"),
    "glb": Format("mesh in metres, y up (binary glTF)", "cccd.files.write_glb"),
    "nii.gz": Format("label map on the scan's grid", "cccd.files.write_label_map"),
    "obj": Format("mesh", "cccd.files.write_obj"),
    "ply": Format("mesh; every later step reads it", "cccd.files.write_ply"),
    "stl": Format("mesh", "cccd.files.write_stl"),
    "vtp": Format("mesh with curvature and the body's number at its vertices", "cccd.files.write_vtp"),
}

API = {
    name: f"cccd.api.{name}"
    for name in (
        *("ControlMesh", "Curves", "FittedCurves", "InputError", "Settings", "Structure", "Surface"),
        *("fit_contours", "labels", "read", "reconstruct"),
    )
}

COMMANDS = {
    "surface": Command("make a surface of one organ, or of every label", "cccd.commands.add_surface"),
}
