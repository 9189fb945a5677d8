"""Every numerical tolerance of the library, in one place.

Lengths are in the unit that the name ends with; what has no unit in its name is dimensionless.
"""

from __future__ import annotations

#: Relative error within which two floating-point results count as equal.
ROUNDING = 1e-9

#: Affines whose columns' cosines exceed this are not orthogonal (sheared scans are refused).
ORTHOGONALITY = 1e-3

#: Slice positions may differ from even spacing by this share of the spacing.
EVEN_SPACING = 0.02

#: Two grids are the same when their affines agree to this share of a voxel at every corner.
SAME_GRID_VOXELS = 0.05

#: Spacings that differ by less than this share count as equal when the slice axis is chosen.
SAME_SPACING = 1e-3

#: Vertices of a phantom's true surface lie this near to its zero set.
PROJECTION_MM = 1e-4
