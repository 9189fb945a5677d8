"""Every numerical tolerance of the library, in one place.

Lengths are in the unit that the name ends with; what has no unit in its name is dimensionless.
"""

from __future__ import annotations

#: Relative error within which two floating-point results count as equal.
ROUNDING = 1e-9

#: Squared lengths and pivots count as at least this, so that one can divide by them.
TINY = 1e-300

#: Speeds along a curve count as at least this.
STILL = 1e-12

#: Axes whose cosine exceeds this are not at right angles: slices are tilted, pixels would be no rectangles.
ORTHOGONALITY = 1e-3

#: Tilted slices lie no flatter than this share of the distance between their first pixels (70 degrees).
FLATTEST = 1 / 3

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

#: Coordinates of stored control points are rounded by at most this share of a pixel: zero bits pack well.
CONTROL_POINT_PIXELS = 0.008

#: Smoothed distances enclose this share of a part of few voxels.
SHRUNK_PART = 0.5

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

#: Weight of a control polygon's bending against the data's; it only decides what the data leave open.
RIDGE = 1e-7

#: Samples of a curve to be fitted lie at least this far apart.
LEAST_SPACING_PX = 0.1

#: Spans between a curve's knots that are shorter than this are not halved.
LEAST_SPAN_PX = 0.05

#: Samples per pixel, and per span at least, at which a spline is checked for crossings ...
CHECKED_PER_PIXEL = 3.0
CHECKED_PER_SPAN = 12
#: ... and where these turn by more than this (radians), the gaps beside are quartered, so many times.
CHECKED_TURN = 0.5
CHECKED_CLOSER = 3
#: Whether it strays is asked of every third sample: excursions are as long as the spans, crossings are not.
CHECKED_EVERY = 3

#: A spline lies at most this much further from its curve than its fit's tolerance: the filter that takes the
#: steps away moves a curve by up to half a pixel.
STRAY_PX = 0.75

#: Values of a floating-point label map may differ by this from whole numbers.
LABEL_VALUE = 1e-3

#: Probabilities may lie so far below 0 or above 1, by rounding.
PROBABILITY = 1e-3

#: Neighbouring points of a drawn contour nearer than this, in pixels, are one point.
SAME_POINT_VOXELS = 1e-6

#: A surface whose volume differs from its organ's by more than this share gets a warning.
VOLUME_BIAS = 0.05

#: A surface that is moved until it holds a volume holds it but for this share.
HELD_VOLUME = 1e-4

#: A solid whose volume differs from its mesh's by more than this share gets a warning.
SOLID_VOLUME = 0.005

#: Grey values that span no more than this, in their own units, have no contrast to scale by.
CONTRAST = 1e-6

#: Triangles and radii smaller than this, in pixels, count as this small where they divide or weigh.
LEAST_PX = 1e-6

#: Capacities up to this are used up when a minimum cut is sought (energies are of the order of one).
FLOW = 1e-9
