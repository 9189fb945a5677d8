"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Command

COMMANDS = {
    "segment": Command(
        "find an organ in a scan without a mask, and make its surface",
        "cccd_segmentation.commands.add_segment",
    )
}

MASKS = {
    "seed": "cccd_segmentation.regions.by_seed",
    "stripped": "cccd_segmentation.regions.by_stripping",
    "threshold": "cccd_segmentation.regions.by_threshold",
}

SETTINGS = {"segmentation": "cccd_segmentation.settings.SECTION"}
