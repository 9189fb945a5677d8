"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Command

COMMANDS = {
    "centrelines": Command(
        "centrelines, radii and angles of a vessel, an airway or a duct",
        "cccd_vessels.commands.add_centrelines",
    ),
    "hollow": Command(
        "a wall of one thickness, as of a vessel or a print", "cccd_vessels.commands.add_hollow"
    ),
    "lumen": Command(
        "cut the ends of a vessel square and name them, for flow", "cccd_vessels.commands.add_lumen"
    ),
}
