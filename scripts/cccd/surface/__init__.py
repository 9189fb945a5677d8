"""Surfaces: from the ordered curves of a stack of slices to one closed spline.

`loft` reads as the whole pipeline, one module per step: `outlines` (splines of the curves), `stack` (signed
distances on slices and between them), `spline` (control mesh, fit, refinement), `checks` (what must hold).
"""

from cccd.surface.loft import loft_surface
from cccd.surface.surface import LoftedSurface

__all__ = ["LoftedSurface", "loft_surface"]
