"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Reader

_ZARR = Reader(
    "cccd_formats.zarr_labels.read_zarr", holds="volume", inside=("zarr.json", ".zgroup", ".zarray")
)

READERS = {
    "nnU-Net": Reader("cccd_formats.nnunet.read_classes"),
    **dict.fromkeys((".ome.zarr", ".zarr"), _ZARR),
}
