"""What this package adds to the core: see `cccd.plugins`."""

API = {"reconstruct_labels": "cccd_labels.whole_map.reconstruct_labels"}
