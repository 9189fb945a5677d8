"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Command

COMMANDS = {
    "calibrate": Command(
        "calibrate the error bands on your own masks or readers", "cccd_calibration.commands.add_calibrate"
    )
}

OPTIONS = {name: f"cccd_calibration.samples.{name}" for name in ("draw_meshes", "intervals")}
