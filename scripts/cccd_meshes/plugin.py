"""What this package adds to the core: see `cccd.plugins`."""

API = {"smooth_mesh": "cccd_meshes.smooth.smooth_mesh"}

OPTIONS = {"planes": "cccd_meshes.closed_meshes.drawn_planes"}
