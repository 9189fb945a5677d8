"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Command

API = {"reconstruct_labels": "cccd_labels.whole_map.reconstruct_labels"}

COMMANDS = {
    "relabel": Command(
        "a label map on finer, cubic or any other voxels, without stairs", "cccd_labels.commands.add_relabel"
    ),
}

OPTIONS = {"all_labels": "cccd_labels.all_surfaces.make_all_surfaces"}
