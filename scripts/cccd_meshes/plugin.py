"""What this package adds to the core: see `cccd.plugins`."""

API = {"smooth_mesh": "cccd_meshes.smooth.smooth_mesh"}

OPTIONS = {
    "mesh": "cccd_meshes.commands.make_surface_of_mesh",
    "uniform": "cccd_meshes.uniform.with_uniform_triangles",
}
