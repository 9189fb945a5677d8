"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Reader

READERS = {
    "nnU-Net": Reader("cccd_formats.nnunet.read_classes"),
    "Zarr": Reader("cccd_formats.zarr_labels.read_zarr"),
}
