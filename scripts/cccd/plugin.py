"""The core's own rows in the tables of `cccd.plugins`."""

from cccd.plugins import Command, Format

WRITERS = {
    "3mf": Format(
        "mesh for printing: millimetres, colour, thinnest wall", "cccd.files.threemf.write", "print"
    ),
    "gii": Format("mesh (GIfTI)", "cccd.files.meshes.write_gii"),
    "glb": Format("mesh in metres, y up (binary glTF)", "cccd.files.gltf.write"),
    "nii.gz": Format("label map on the scan's grid", "cccd.files.meshes.write_label_map"),
    "obj": Format("mesh", "cccd.files.meshes.write_obj"),
    "ply": Format("mesh; every later step reads it", "cccd.files.meshes.write_ply"),
    "stl": Format("mesh", "cccd.files.meshes.write_stl"),
    "vtp": Format("mesh with curvature and the body's number at its vertices", "cccd.files.meshes.write_vtp"),
}

COMMANDS = {
    "surface": Command("make a surface of one organ, or of every label", "cccd.commands.surface.add_surface"),
}
