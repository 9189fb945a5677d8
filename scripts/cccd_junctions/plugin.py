"""What this package adds to the core: see `cccd.plugins`."""

API = {"order": "cccd_junctions.maps.order"}

CURVES = {
    "BoundaryMaps": "cccd_junctions.ordering.order_maps",
    "GreyImage": "cccd_junctions.ordering.order_maps",
    "Boundaries": "cccd_junctions.ordering.order_pixels",
}
