"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Reader

_FILES = ("zarr.json", ".zgroup", ".zarray")
_ZARR = Reader("cccd_formats.zarr_labels.read_zarr", holds="volume", inside=_FILES)

READERS = {"nnU-Net": Reader("cccd_formats.nnunet.read_classes"), ".ome.zarr": _ZARR, ".zarr": _ZARR}
