"""What this package adds to the core: see `cccd.plugins`."""

SETTINGS = {"gnn": "cccd_networks.settings.SECTION"}
