"""Surfaces: from the ordered curves of a stack of slices to one closed spline.

`loft` reads as the whole pipeline, one module per step: `outlines` (splines of the curves), `stack` (signed
distances on slices and between them), `rough` (the mesh on which they vanish), `spline` (control mesh, fit,
refinement), `checks` (what must hold).
"""

from cccd.surface.loft import loft_before_walls, loft_mesh, loft_surface
from cccd.surface.surface import LoftedSurface

__all__ = ["LoftedSurface", "loft_before_walls", "loft_mesh", "loft_surface"]
