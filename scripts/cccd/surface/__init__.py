"""Surfaces: contours matched between slices into tubes, lofted, joined, closed.

`loft` reads as the whole pipeline, one module per step: `stack` (levels between slices), `matching` (tubes),
`patches` (control nets), `solid` (one closed mesh).
"""

from cccd.surface.loft import loft_surface
from cccd.surface.measure import measure_surface
from cccd.surface.surface import Surface

__all__ = ["Surface", "loft_surface", "measure_surface"]
