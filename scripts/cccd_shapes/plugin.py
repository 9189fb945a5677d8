"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Command

COMMANDS = {
    "shapes": Command(
        "one spline for a cohort: mean, modes, scores, differences of groups",
        "cccd_shapes.commands.add_shapes",
    )
}
