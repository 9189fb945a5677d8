"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Reader

API = {"smooth_mesh": "cccd_meshes.smooth.smooth_mesh"}

READERS = {"planes": Reader("cccd_meshes.closed_meshes.drawn_planes")}
