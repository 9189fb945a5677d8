"""Lofting, beside the isosurface and the smoothing that people take today."""

from collections.abc import Callable

from organ import make_organ

from cccd.chaincode import trace_mask
from cccd.comparisons.volume_meshes import flying_edges, windowed_sinc
from cccd.surface import loft_surface

TITLE = "Surface"
SIZES = (8, 16, 32, 64)


def prepare(slices: int, settings: dict) -> dict[str, Callable]:
    """Give the methods to time on an organ of so many slices."""
    organ = make_organ(slices)
    curves = trace_mask(organ)
    return {
        "B-spline lofting": lambda: loft_surface(curves, settings["surface"]),
        "flying edges": lambda: flying_edges(organ),
        "flying edges + windowed sinc": lambda: windowed_sinc(flying_edges(organ)),
    }
