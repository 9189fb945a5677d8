"""What this package adds to the core: see `cccd.plugins`."""

API = {"order": "cccd_junctions.maps.order"}

CURVES = {
    "boundary": "cccd_junctions.ordering.order_maps",
    "region": "cccd_junctions.ordering.order_maps",
    "pixels": "cccd_junctions.ordering.order_pixels",
}
