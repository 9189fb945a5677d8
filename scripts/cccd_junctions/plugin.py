"""What this package adds to the core: see `cccd.plugins`."""

CURVES = {
    "BoundaryMaps": "cccd_junctions.ordering.order_maps",
    "GreyImage": "cccd_junctions.ordering.order_maps",
    "Boundaries": "cccd_junctions.ordering.order_pixels",
}
