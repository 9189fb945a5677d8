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

#: Numbers in the headers of one series' slices may differ by this much (they are written with few digits).
SAME_HEADER = 1e-4

#: Slices whose positions differ by less than this, in pixels, lie at one place.
SAME_POSITION_PX = 1e-3

#: Two grids are the same when their affines agree to this share of a voxel at every corner.
SAME_GRID_VOXELS = 0.05

#: Spacings that differ by less than this share count as equal when the slice axis is chosen.
SAME_SPACING = 0.05

#: Vertices of a phantom's true surface lie this near to its zero set.
PROJECTION_MM = 1e-4

#: Contour planes may lie this share of the slice spacing away from a slice.
CONTOUR_PLANE = 0.1

#: Drawn contours may leave their plane by this share of their width; likewise 1 - cosine of directions.
SLICE_DIRECTION = 1e-3

#: Areas of drawn contours that agree to this share are equal.
CONTOUR_AREA = 1e-3

#: Contours nearer than this along the normal lie in one plane (coordinates are written with few digits).
SAME_PLANE_MM = 0.01

#: A pixel boundary's staircase is smoothed over this many fitting tolerances (and no more than the
#: pixels below) to make the reference of the automatic fit.
STAIRCASE_TOLERANCES = 3.0
STAIRCASE_PX = 1.5

#: A corner is sharp when straight arms of this length meet in it ...
SHARP_ARM_PX = 6
#: ... that deviate from straight by no more than the digitisation of a straight line ...
SHARP_STRAIGHT_PX = 0.5
#: ... and turn by at least this angle in degrees.
SHARP_TURN_DEG = 60.0

#: Values of a floating-point label map may differ by this from whole numbers.
LABEL_VALUE = 1e-3

#: Neighbouring points of a drawn contour nearer than this, in pixels, are one point.
SAME_POINT_VOXELS = 1e-6

#: A surface whose volume differs from its organ's by more than this share gets a warning.
VOLUME_BIAS = 0.05

#: Grey values that span no more than this, in their own units, have no contrast to scale by.
CONTRAST = 1e-6

#: Triangles and radii smaller than this, in pixels, count as this small where they divide or weigh.
LEAST_PX = 1e-6

#: Capacities up to this are used up when a minimum cut is sought (energies are of the order of one).
FLOW = 1e-9
