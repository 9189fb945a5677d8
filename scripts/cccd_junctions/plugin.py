"""What this package adds to the core: see `cccd.plugins`."""

CURVES = dict.fromkeys(("BoundaryMaps", "GreyImage"), "cccd_junctions.ordering.order_maps")
CURVES["Boundaries"] = "cccd_junctions.ordering.order_pixels"
