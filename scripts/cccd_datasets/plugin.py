"""What this package adds to the core: see `cccd.plugins`."""

SOURCES = {
    "phantom": "cccd_datasets.scans.make_row_phantom",
    "damaged_phantom": "cccd_datasets.scans.make_row_phantom",
    "phantom_scan": "cccd_datasets.scans.scan_row_phantom",
    "mni152": "cccd_datasets.scans.read_packaged",
    "mni152_scan": "cccd_datasets.scans.scan_brain",
    "mni152_head": "cccd_datasets.scans.scan_brain",
    "chest_ct": "cccd_datasets.scans.read_packaged",
    "whole_body_ct": "cccd_datasets.scans.read_packaged",
}

LAYOUTS = {
    "lits17": "cccd_datasets.layouts.complete_lits",
    "upenn_gbm": "cccd_datasets.layouts.complete_upenn",
    "msd": "cccd_datasets.layouts.complete_decathlon",
}
