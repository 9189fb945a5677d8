"""Surfaces: contours matched between slices, lofted, joined, closed."""

from cccd.surface.loft import Surface, loft_surface
from cccd.surface.measure import measure_surface

__all__ = ["Surface", "loft_surface", "measure_surface"]
